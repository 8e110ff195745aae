#include "estimates/ball_filter.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

namespace o80::mujoco {

namespace {

constexpr double kNear = 0.1;         // a ball that rises below this height has bounced [m]
constexpr double kUnexplained = 2.0;  // a velocity farther off begins a new flight [m/s]
constexpr double kSlowest = 0.5;      // least approach speed of a ball with a crossing [m/s]
constexpr double kLongest = 2.0;      // limit of the predicted flight of a wrong estimate [s]
constexpr double kMaxLate = 0.3;      // limit of time corrections, and of times back [s]
constexpr int kPieces = 4;            // steps of a long flight
constexpr double kTiny = 1e-9;

/// Estimates omit spin about other axes than x, which a slanted bounce causes.
Ball with_spin_about_x(Ball ball) noexcept {
  ball.spin.y = ball.spin.z = 0;
  return ball;
}

Ball flown_far(Ball ball, const Air& air, double duration) noexcept {
  for (int i = 0; i < kPieces; ++i) ball = flown(ball, air, duration / kPieces);
  return ball;
}

bool explained(const Ball& ball, const Seen& seen) noexcept {
  const Vector& v = ball.velocity;
  return std::abs(seen[3] - v.x) <= kUnexplained && std::abs(seen[4] - v.y) <= kUnexplained &&
         std::abs(seen[5] - v.z) <= kUnexplained;
}

Ball corrected(Ball ball, const Seen& seen, const Gain& g) noexcept {
  Vector& p = ball.position;
  Vector& v = ball.velocity;
  const double dx = seen[0] - p.x, dy = seen[1] - p.y, dz = seen[2] - p.z;
  const double du = seen[3] - v.x, dv = seen[4] - v.y, dw = seen[5] - v.z;
  p.x += g[0] * dx + g[1] * du;
  v.x += g[2] * dx + g[3] * du;
  p.y += g[4] * dy + g[5] * dz + g[6] * dv + g[7] * dw;
  p.z += g[8] * dy + g[9] * dz + g[10] * dv + g[11] * dw;
  v.y += g[12] * dy + g[13] * dz + g[14] * dv + g[15] * dw;
  v.z += g[16] * dy + g[17] * dz + g[18] * dv + g[19] * dw;
  ball.spin.x += g[20] * dy + g[21] * dz + g[22] * dv + g[23] * dw;
  return ball;
}

}  // namespace

BallFilter::BallFilter(Settings settings, std::size_t count)
    : settings_(std::move(settings)), estimates_(count) {
  if (settings_.before.empty() || settings_.after.empty()) {
    throw std::invalid_argument("a filter needs gains for before and after the bounce");
  }
}

void BallFilter::begin(std::size_t number, const Seen& seen) noexcept {
  estimates_[number] = {
      {{seen[0], seen[1], seen[2]}, {seen[3], seen[4], seen[5]}, {settings_.mean_spin, 0, 0}},
      false,
      0};
}

void BallFilter::step(std::size_t number, const Seen* seen) noexcept {
  Estimate& estimate = estimates_[number];
  estimate.ball = flown(estimate.ball, settings_.air, settings_.step);
  if (touches(estimate, seen)) {
    estimate.ball = bounced_within(estimate.ball);
    estimate.bounced = true;
    estimate.measured = -1;
  }
  if (seen == nullptr) return;
  if (!explained(estimate.ball, *seen)) {
    begin(number, *seen);
    return;
  }
  const std::vector<Gain>& gains = estimate.bounced ? settings_.after : settings_.before;
  const auto next = static_cast<std::size_t>(++estimate.measured);
  estimate.ball = corrected(estimate.ball, *seen, gains[std::min(next, gains.size() - 1)]);
}

bool BallFilter::touches(const Estimate& estimate, const Seen* seen) const noexcept {
  const Ball& ball = estimate.ball;
  if (estimate.bounced || ball.velocity.z >= 0) return false;
  if (ball.position.z >= settings_.platform.height + kNear) return false;
  return seen == nullptr ? ball.position.z < settings_.platform.height : (*seen)[5] > 0;
}

/// Bounces a ball that was below the platform after the last step.
Ball BallFilter::bounced_within(const Ball& ball) const noexcept {
  const Platform& platform = settings_.platform;
  const double deep = (platform.height - ball.position.z) / std::max(-ball.velocity.z, kTiny);
  const double since = std::clamp(deep, 0.0, settings_.step);
  const Vector fallen = since * settings_.air.gravity;  // gravity since the touch
  Ball touching = ball;
  touching.velocity = ball.velocity - fallen;
  Ball after = with_spin_about_x(bounced(touching, platform));
  after.position = ball.position + since * (after.velocity - ball.velocity);
  after.position.z = platform.height + since * after.velocity.z;
  after.velocity = after.velocity + fallen;
  return after;
}

/// Computes a ball after its next touch of the platform, and the time until then [s].
Ball BallFilter::after_touch(const Ball& ball, double& time) const noexcept {
  const Air& air = settings_.air;
  const double height = settings_.platform.height;
  const double rise = ball.velocity.z;
  const double fall = std::max(ball.position.z - height, 0.0);
  // the ball falls even with a wrong estimate of the spin
  const double falling = std::max(-acceleration(air, ball.velocity, ball.spin).z, 1.0);
  time = std::min((rise + std::sqrt(rise * rise + 2 * falling * fall)) / falling, kLongest);
  Ball touching = flown_far(ball, air, time);

  // corrects for the changed forces on the way
  const double above = touching.position.z - height;
  const double speed = std::max(-touching.velocity.z, kSlowest);
  const double root = std::sqrt(std::max(speed * speed - 2 * air.gravity.z * above, 0.0));
  const double late = std::clamp(2 * above / (speed + root), -kMaxLate, kMaxLate);
  touching = flown(touching, air, late);
  touching.position.z = height;
  time += late;
  return with_spin_about_x(bounced(touching, settings_.platform));
}

Crossing BallFilter::crossing(std::size_t number, double plane) const noexcept {
  const Air& air = settings_.air;
  const Estimate& estimate = estimates_[number];
  if (estimate.ball.velocity.y > -kSlowest) return {};
  double before = 0;
  const Ball ball = estimate.bounced ? estimate.ball : after_touch(estimate.ball, before);

  // by a parabola, then corrected by flights
  const double way = ball.position.y - plane;
  const double speed = std::max(-ball.velocity.y, kSlowest);
  const double slowing = acceleration(air, ball.velocity, ball.spin).y;
  const double root = std::sqrt(std::max(speed * speed - 2 * slowing * way, 0.0));
  const double time = std::clamp(2 * way / (speed + root), -kMaxLate, kLongest);
  Ball there = flown_far(ball, air, time);
  const double late = std::clamp((there.position.y - plane) / std::max(-there.velocity.y, kSlowest),
                                 -kMaxLate, kMaxLate);
  there = flown(there, air, late);
  const Vector& velocity = there.velocity;
  const Crossing found{there.position.x, there.position.z, velocity.x,
                       velocity.y,       velocity.z,       before + time + late};
  const bool known = std::ranges::all_of(found, [](double each) { return std::isfinite(each); });
  return known ? found : Crossing{};
}

}  // namespace o80::mujoco
