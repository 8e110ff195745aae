#include "pam/arm.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <random>
#include <string>
#include <vector>

namespace o80::pam {
namespace {

using testing::DoubleNear;
using testing::ElementsAre;
using testing::Pointwise;

// One row of what MuJoCo computes from the model of the application; written and checked by
// tests/python/test_pam_model.py.
struct Reference {
  Motion motion{};
  Joints torque{};
  RacketMotion racket{};
  JointMatrix mass{};
  Joints bias{};
  Joints acceleration{};
};

std::vector<Reference> mujoco_reference() {
  std::ifstream file(std::filesystem::path(__FILE__).parent_path() / "mujoco_reference.txt");
  std::vector<Reference> rows;
  const auto fill = [&file](auto& numbers) {
    for (double& number : numbers) file >> number;
  };
  std::string header;
  std::getline(file, header);
  for (Reference row; file;) {
    fill(row.motion.q), fill(row.motion.dq), fill(row.torque);
    fill(row.racket.position), fill(row.racket.rotation);
    fill(row.racket.velocity), fill(row.racket.angular_velocity);
    for (Joints& line : row.mass) fill(line);
    fill(row.bias), fill(row.acceleration);
    if (file) rows.push_back(row);
  }
  return rows;
}

template <class Numbers>
void expect_near(const Numbers& ours, const Numbers& theirs, double tolerance, const char* what) {
  for (std::size_t i = 0; i < ours.size(); ++i) {
    const double scale = std::max(1.0, std::abs(theirs[i]));
    EXPECT_NEAR(ours[i] / scale, theirs[i] / scale, tolerance) << what << ", number " << i;
  }
}

TEST(Arm, HasTheKinematicsThatMujocoComputesFromTheModel) {
  const Arm arm;
  const auto rows = mujoco_reference();
  ASSERT_GE(rows.size(), 40u);
  for (const Reference& row : rows) {
    const RacketMotion racket = arm.racket(row.motion);
    expect_near(racket.position, row.racket.position, 1e-12, "position");
    expect_near(racket.rotation, row.racket.rotation, 1e-12, "rotation");
    expect_near(racket.velocity, row.racket.velocity, 1e-11, "velocity");
    expect_near(racket.angular_velocity, row.racket.angular_velocity, 1e-11, "angular velocity");
  }
}

// Dry friction brings every joint as near to rest as its largest impulse allows: a joint that
// moves gets all of it against its motion, one that sticks gets no more.
TEST(Arm, DryFrictionHoldsOrOpposesEveryJoint) {
  constexpr double kDuration = 0.001;
  std::mt19937 random(1);
  const auto uniform = [&](double most) {
    return std::uniform_real_distribution<double>(-most, most)(random);
  };
  int sticking = 0, sliding = 0;
  for (int i = 0; i < 20'000; ++i) {
    Arm::Config config;
    Motion motion;
    Joints torque{};
    for (std::size_t j = 0; j < kJoints; ++j) {
      config.friction[j] = random() % 4 == 0 ? 0.0 : std::abs(uniform(2.0));
      motion.q[j] = uniform(1.5);
      motion.dq[j] = random() % 2 == 0 ? 0.0 : uniform(random() % 2 == 0 ? 0.01 : 5.0);
      torque[j] = uniform(random() % 2 == 0 ? 1.0 : 20.0);
    }
    const Arm arm(config);
    const JointMatrix mass = arm.mass_matrix(motion.q);
    const Joints bias = arm.bias(motion.q, motion.dq);
    Motion after = motion;
    arm.advance(after, torque, kDuration);
    for (std::size_t j = 0; j < kJoints; ++j) {
      // (M + h D) dq' = M dq + h (torque - bias) + impulse
      double impulse = kDuration * config.damping[j] * after.dq[j];
      for (std::size_t k = 0; k < kJoints; ++k)
        impulse += mass[j][k] * (after.dq[k] - motion.dq[k]);
      impulse -= kDuration * (torque[j] - bias[j]);
      const double most = kDuration * config.friction[j];
      ASSERT_LE(std::abs(impulse), most + 1e-13) << "joint " << j << " of arm " << i;
      if (most == 0.0) continue;
      ++(after.dq[j] == 0.0 ? sticking : sliding);
      if (after.dq[j] == 0.0) continue;
      ASSERT_NEAR(impulse, after.dq[j] > 0.0 ? -most : most, 1e-13) << "joint " << j << " of " << i;
    }
  }
  EXPECT_GT(sticking, 1000);
  EXPECT_GT(sliding, 1000);
}

TEST(Arm, HasTheDynamicsThatMujocoComputesFromTheModel) {
  const Arm arm;
  const auto rows = mujoco_reference();
  ASSERT_GE(rows.size(), 40u);
  for (const Reference& row : rows) {
    const JointMatrix mass = arm.mass_matrix(row.motion.q);
    for (std::size_t j = 0; j < kJoints; ++j) {
      expect_near(mass[j], row.mass[j], 1e-11, "mass matrix");
    }
    expect_near(arm.bias(row.motion.q, row.motion.dq), row.bias, 1e-10, "bias");
    expect_near(arm.acceleration(row.motion, row.torque), row.acceleration, 1e-9, "acceleration");
  }
}

TEST(Arm, PointsStraightUpAtZero) {
  const RacketMotion racket = Arm().racket({});
  EXPECT_THAT(racket.position, ElementsAre(DoubleNear(0.0, 1e-15), DoubleNear(0.0, 1e-15),
                                           DoubleNear(1.21 + 0.075 + 0.36742 + 0.370, 1e-12)));
}

TEST(Arm, SwingsTheFaceOfTheRacketForwardWithTheFirstJoint) {
  // lying towards x, the blade looks along y and joint 1 moves it there
  const RacketMotion racket = Arm().racket({.q = {0.0, 1.0, 1.0, 0.0}, .dq = {2.0, 0.0, 0.0, 0.0}});
  EXPECT_NEAR(racket.rotation[4], 1.0, 1e-12);
  EXPECT_NEAR(racket.velocity[1], 2.0 * racket.position[0], 1e-12);
}

TEST(Arm, VelocityOfTheRacketIsTheDerivativeOfItsPosition) {
  const Arm arm;
  Motion motion{.q = {0.3, 0.9, 0.7, -0.4}, .dq = {1.0, -2.0, 1.5, 3.0}};
  const double h = 1e-6;
  Motion later = motion, earlier = motion;
  for (std::size_t j = 0; j < kJoints; ++j) {
    later.q[j] += h * motion.dq[j];
    earlier.q[j] -= h * motion.dq[j];
  }
  const Vector velocity = arm.racket(motion).velocity;
  for (std::size_t i = 0; i < 3; ++i) {
    const double slope =
        (arm.racket(later).position[i] - arm.racket(earlier).position[i]) / (2.0 * h);
    EXPECT_NEAR(velocity[i], slope, 1e-8);
  }
}

TEST(Arm, ConservesEnergyWithoutDampingAndTorque) {
  const Arm arm({.damping = {}});
  Motion motion{.q = {0.1, 0.4, -0.5, 0.3}, .dq = {1.0, 0.5, -0.5, 2.0}};
  const double start = arm.energy(motion);
  for (int i = 0; i < 20000; ++i) arm.advance(motion, {}, 1e-5);
  EXPECT_NEAR(arm.energy(motion), start, 2e-4);
}

TEST(Arm, LosesEnergyByDamping) {
  const Arm arm;
  Motion motion{.q = {0.1, 0.2, 0.2, 0.3}, .dq = {4.0, 3.0, -2.0, 5.0}};
  double last = arm.energy(motion);
  for (int i = 0; i < 4000; ++i) {
    arm.advance(motion, {}, 0.0005);
    const double energy = arm.energy(motion);
    ASSERT_LE(energy, last + 1e-9) << "step " << i;
    last = energy;
  }
}

TEST(Arm, StopsAtItsLimitsAndNeverPassesThem) {
  const Arm arm;
  Motion motion{.q = {1.4, 1.4, -1.4, -1.4}, .dq = {20.0, 15.0, -20.0, -30.0}};
  const double start = arm.energy(motion);
  for (int i = 0; i < 1000; ++i) {
    arm.advance(motion, {40.0, 40.0, -40.0, -40.0}, 0.0005);
    for (double angle : motion.q) ASSERT_LE(std::abs(angle), kJointLimit);
  }
  for (std::size_t j = 0; j < kJoints; ++j) {
    EXPECT_NEAR(std::abs(motion.q[j]), kJointLimit, 1e-9);
    EXPECT_NEAR(motion.dq[j], 0.0, 1e-9);
  }
  EXPECT_LT(arm.energy(motion), start);
}

TEST(Arm, LeavesAStopWhenPulledAway) {
  const Arm arm;
  Motion motion{.q = {kJointLimit, 0.5, 0.5, 0.0}};
  for (int i = 0; i < 100; ++i) arm.advance(motion, {-10.0, 0.0, 0.0, 0.0}, 0.0005);
  EXPECT_LT(motion.q[0], kJointLimit - 0.01);
}

TEST(Arm, FindsThePostureThatReachesAPoint) {
  const Arm arm;
  for (const Vector& point : {Vector{0.6, 0.3, 1.3}, Vector{0.45, 0.35, 1.0},
                              Vector{0.55, -0.1, 1.2}, Vector{0.3, 0.3, 1.6}}) {
    const auto posture = arm.posture_reaching(point, 0.4);
    ASSERT_TRUE(posture);
    EXPECT_THAT(arm.racket({.q = *posture}).position, Pointwise(DoubleNear(1e-12), point));
    EXPECT_DOUBLE_EQ((*posture)[3], 0.4);
  }
}

TEST(Arm, SaysThatAPointIsOutOfReach) {
  const Arm arm;
  EXPECT_FALSE(arm.posture_reaching({0.9, 0.3, 1.3}, 0.0));   // too far
  EXPECT_FALSE(arm.posture_reaching({0.1, 0.0, 1.25}, 0.0));  // too near: the elbow stops
  EXPECT_FALSE(arm.posture_reaching({0.6, 0.4, 0.95}, 0.0));  // too low: the shoulder stops
  EXPECT_FALSE(arm.posture_reaching({-0.5, 0.1, 1.3}, 0.0));  // behind the base
}

TEST(Links, WeighWhatIsPublished) {
  double mass = 0.0;
  for (const Link& link : published_links()) mass += link.mass;
  EXPECT_NEAR(mass, 2 * 0.03 + (0.03 + 0.148 + 0.03) + 0.03 + 0.114 + 0.02 + 0.663, 1e-12);
}

TEST(Links, JoinedKeepTheirMassCentreAndInertia) {
  const Link dumbbell = joined({.mass = 1.0, .centre = 0.0, .inertia = {}},
                               {.mass = 3.0, .centre = 0.4, .inertia = {}});
  EXPECT_DOUBLE_EQ(dumbbell.mass, 4.0);
  EXPECT_DOUBLE_EQ(dumbbell.centre, 0.3);
  EXPECT_NEAR(dumbbell.inertia[0], 0.75 * 0.16, 1e-15);  // reduced mass x distance squared
  EXPECT_NEAR(dumbbell.inertia[1], 0.75 * 0.16, 1e-15);
  EXPECT_EQ(dumbbell.inertia[2], 0.0);
}

}  // namespace
}  // namespace o80::pam
