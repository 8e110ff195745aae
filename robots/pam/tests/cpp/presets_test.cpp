#include "pam/presets.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <vector>

#include "pam/equilibrium.hpp"

namespace o80::pam {
namespace {

using testing::DoubleNear;
using testing::Each;
using testing::HasSubstr;
using testing::Pointwise;
using testing::ThrowsMessage;

/// The answer of a joint to a small step: up in one of its muscles, down in the other.
struct StepResponse {
  double gain = 0;       // [rad per 1000 raw units]
  double rise = 0;       // until 63 % [s]
  double overshoot = 0;  // [%]
  int still = 0;         // iterations before the first motion
};

StepResponse step_response(const Plant::Config& config, std::size_t joint, std::int32_t step) {
  Plant plant(config);
  Pressures pressures = plant.start_pressures();
  for (int i = 0; i < 1500; ++i) plant.advance(pressures);
  const double start = plant.q()[joint];
  pressures[agonist(joint)] += step;
  pressures[antagonist(joint)] -= step;
  std::vector<double> way;
  for (int i = 0; i < 2000; ++i) {
    plant.advance(pressures);
    way.push_back(plant.q()[joint] - start);
  }
  const double end = way.back();
  StepResponse response{.gain = end / step * 1000};
  for (double& each : way) each /= end;
  const auto risen = std::ranges::find_if(way, [](double share) { return share >= 0.63; });
  response.rise = static_cast<double>(risen - way.begin() + 1) * config.period;
  response.overshoot = 100 * (*std::ranges::max_element(way) - 1);
  const auto moved = std::ranges::find_if(way, [](double share) { return std::abs(share) > 1e-6; });
  response.still = static_cast<int>(moved - way.begin());
  return response;
}

TEST(Presets, TheIdentifiedArmAnswersSmallStepsLikeThePublishedRealOne) {
  const Plant::Config config = preset(Preset::identified);
  // agonists of joints 1 and 3 decrease the angle
  const Joints gains{-0.25, 0.17, -0.30, 0.30};
  const Joints rises{0.190, 0.270, 0.160, 0.110};
  const Joints overshoots{47, 31, 4, 1};
  const int dead_times[] = {20, 20, 10, 5};
  for (std::size_t j = 0; j < kJoints; ++j) {
    for (const std::int32_t step : {500, -500}) {
      const StepResponse seen = step_response(config, j, step);
      EXPECT_NEAR(seen.gain, gains[j], 0.15 * std::abs(gains[j])) << "joint " << j + 1;
      EXPECT_NEAR(seen.rise, rises[j], 0.15 * rises[j]) << "joint " << j + 1;
      EXPECT_NEAR(seen.overshoot, overshoots[j], 3) << "joint " << j + 1;
      EXPECT_NEAR(seen.still, dead_times[j], 1) << "joint " << j + 1;
    }
  }
}

TEST(Presets, EveryArmRestsInThePlayingPosture) {
  for (const Preset name : {Preset::standard, Preset::identified, Preset::published_simulation}) {
    Plant plant(preset(name));
    EXPECT_THAT(plant.q(), Pointwise(DoubleNear(1e-3), kPlayingPosture));
    const Joints start = plant.q();
    for (int i = 0; i < 2000; ++i) plant.advance(plant.start_pressures());
    EXPECT_THAT(plant.q(), Pointwise(DoubleNear(1e-9), start));
  }
}

TEST(Presets, DeadTimeDelaysTheMotionAndChangesNothingElse) {
  Plant::Config late = preset(Preset::standard);
  late.dead_time = {0.02, 0.02, 0.02, 0.02};
  Plant plain(preset(Preset::standard));
  Plant delayed(late);
  Pressures pressures = plain.start_pressures();
  for (std::size_t m = 0; m < kMuscles; ++m) pressures[m] += m % 2 == 0 ? 1500 : -900;
  for (int i = 0; i < 10; ++i) delayed.advance(pressures);
  for (int i = 0; i < 400; ++i) {
    plain.advance(pressures);
    delayed.advance(pressures);
    ASSERT_THAT(delayed.q(), Pointwise(DoubleNear(1e-6), plain.q())) << i;
  }
}

TEST(Presets, ASnapshotHoldsPressuresThatHaveNotActedYet) {
  Plant plant(preset(Preset::identified));
  Pressures pressures = plant.start_pressures();
  pressures[0] += 2000;
  for (int i = 0; i < 7; ++i) plant.advance(pressures);
  const Plant::State snapshot = plant.state();
  const auto run = [&] {
    for (int i = 0; i < 100; ++i) plant.advance(plant.start_pressures());
    return plant.q();
  };
  const Joints first = run();
  plant.restore(snapshot);
  EXPECT_EQ(run(), first);
  // a reset forgets them
  plant.reset(1);
  Plant fresh(preset(Preset::identified));
  fresh.reset(1);
  for (int i = 0; i < 100; ++i) {
    plant.advance(plant.start_pressures());
    fresh.advance(fresh.start_pressures());
  }
  EXPECT_EQ(plant.q(), fresh.q());
}

TEST(Presets, FrictionHoldsASmallPushAndSlowsNoneTooMuch) {
  Plant::Config config = preset(Preset::standard);
  config.arm.friction = {0.5, 0.5, 0.5, 0.5};
  Plant plant(config);
  const Joints start = plant.q();
  const Pressures pressures = plant.start_pressures();
  for (int i = 0; i < 500; ++i) plant.advance(pressures, {0.4, 0.0, 0.0, 0.0});
  EXPECT_NEAR(plant.q()[0], start[0], 1e-6);
  for (int i = 0; i < 500; ++i) plant.advance(pressures, {1.5, 0.0, 0.0, 0.0});
  EXPECT_GT(plant.q()[0], start[0] + 0.01);
  // where the push ends it comes to a full stop, not to the place where it began
  for (int i = 0; i < 2000; ++i) plant.advance(pressures);
  EXPECT_THAT(plant.dq(), Each(DoubleNear(0.0, 1e-12)));
  EXPECT_GT(std::abs(plant.q()[0] - start[0]), 1e-3);
}

TEST(Presets, BarsActivateAMuscleFromTheAtmosphereOn) {
  const PressureRange range = in_bar(kRealRanges, 3.6)[0];
  EXPECT_NEAR(range.least(), 1.2112 / 3.6, 1e-9);
  EXPECT_NEAR(range.most(), 3.2112 / 3.6, 1e-9);
  EXPECT_NEAR(range.pressure(range.activation(18000)), 18000, 1e-9);
}

TEST(Presets, NumbersThatCannotWorkAreRefused) {
  const auto refusal = [](const auto& change, const char* text) {
    Plant::Config config;
    change(config);
    EXPECT_THAT([&] { Plant{config}; }, ThrowsMessage<std::invalid_argument>(HasSubstr(text)));
  };
  refusal([](auto& c) { c.dead_time[1] = 0.3; }, "dead_time of joint 2 must be at most");
  refusal([](auto& c) { c.dead_time[1] = -0.01; }, "dead_time of joint 2 must be finite");
  refusal([](auto& c) { c.lag[0] = 0; }, "lag of joint 1 must be positive");
  refusal([](auto& c) { c.maximum_force[3] = NAN; }, "maximum_force of joint 4");
  refusal([](auto& c) { c.stroke[2] = -1; }, "stroke of joint 3");
  refusal([](auto& c) { c.arm.friction[2] = -1; }, "friction of joint 3");
  refusal([](auto& c) { c.arm.damping[2] = -1; }, "damping of joint 3");
  refusal([](auto& c) { c.directions[0] = 0; }, "directions of joint 1 must be 1 or -1");
  refusal([](auto& c) { c.ranges = in_bar(c.ranges, -1); }, "full_bar must be positive");
}

}  // namespace
}  // namespace o80::pam
