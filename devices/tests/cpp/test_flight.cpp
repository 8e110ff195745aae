#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "vision/filter.hpp"

namespace o80::vision {
namespace {

using testing::DoubleNear;

constexpr double kFrame = 1.0 / 180;

Matrix<3, 3> variance(double deviation) {
  return (deviation * deviation) * Matrix<3, 3>::identity();
}

TEST(Flight, WithoutAirIsAParabola) {
  FlightLaw law{.drag = 0, .magnus = 0, .has_table = false};
  int bounces = 0;
  const Ball end = advanced({{{0, 0, 1}}, {{1, 2, 3}}, {}}, law, 0.5, bounces);

  EXPECT_THAT(end.position[0], DoubleNear(0.5, 1e-9));
  EXPECT_THAT(end.position[2], DoubleNear(1 + 1.5 - 9.81 / 8, 1e-9));
  EXPECT_THAT(end.velocity[2], DoubleNear(3 - 9.81 / 2, 1e-9));
}

TEST(Flight, IsTheSameInOneStepAndInMany) {
  const FlightLaw law;
  const Ball start{{{0.1, -1.2, 0.3}}, {{0.3, 4, 0.5}}, {{40, 5, -10}}};
  int bounces = 0;
  const Ball whole = advanced(start, law, 0.6, bounces);
  EXPECT_EQ(bounces, 1);
  Ball stepped = start;
  int in_steps = 0;
  for (int i = 0; i < 120; ++i) stepped = advanced(stepped, law, 0.005, in_steps);

  EXPECT_EQ(in_steps, 1);
  EXPECT_THAT(length(stepped.position - whole.position), DoubleNear(0, 1e-6));
  EXPECT_THAT(length(stepped.velocity - whole.velocity), DoubleNear(0, 1e-5));
}

TEST(Flight, DoesNotBounceBesideTheTable) {
  int bounces = 0;
  const Ball end = advanced({{{0.9, 0, 0.1}}, {{0, 0, -2}}, {}}, {}, 0.2, bounces);
  EXPECT_EQ(bounces, 0);
  EXPECT_LT(end.position[2], -0.2);
}

TEST(BallFilter, LearnsVelocityAndSpinOfAFlightWithABounce) {
  const FlightLaw law;
  Ball ball{{{0.1, 1.5, 0.35}}, {{0.2, -4.2, 1.6}}, {{-50, 0, 0}}};
  BallFilter filter(law, {});
  filter.begin(ball.position, variance(0.001));
  int bounces = 0;
  double largest = 0;
  for (int i = 1; i < 150; ++i) {
    ball = advanced(ball, law, kFrame, bounces);
    filter.predict(kFrame);
    filter.update(ball.position, variance(0.001));
    if (i > 30) largest = std::max(largest, length(filter.ball().velocity - ball.velocity));
  }
  EXPECT_EQ(bounces, 1);
  EXPECT_LT(largest, 0.4);  // at the bounce itself
  EXPECT_THAT(length(filter.ball().velocity - ball.velocity), DoubleNear(0, 0.03));
  EXPECT_THAT(filter.ball().spin[0], DoubleNear(ball.spin[0], 10));
}

TEST(BallFilter, CovarianceStaysSymmetricAndPositive) {
  const FlightLaw law;
  BallFilter filter(law, {});
  filter.begin({{0, 1, 0.3}}, variance(0.003));
  for (int i = 0; i < 400; ++i) {
    filter.predict(kFrame);
    if (i % 3 == 0) filter.update(filter.ball().position, variance(0.003));
    for (std::size_t a = 0; a < BallFilter::kSize; ++a) {
      ASSERT_GT(filter.covariance()(a, a), 0);
      for (std::size_t b = 0; b < a; ++b) {
        const double size = filter.covariance()(a, a) + filter.covariance()(b, b);
        ASSERT_THAT(filter.covariance()(a, b), DoubleNear(filter.covariance()(b, a), 1e-9 * size));
      }
    }
  }
}

TEST(BallFilter, MeasuresDistanceInStandardDeviations) {
  BallFilter filter({}, {});
  filter.begin({{0, 0, 1}}, variance(0.003));
  EXPECT_THAT(filter.distance({{0.01, 0, 1}}, variance(0.004)), DoubleNear(4, 1e-9));
}

}  // namespace
}  // namespace o80::vision
