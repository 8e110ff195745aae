#pragma once

#include <optional>
#include <span>

#include "balls/bounce.hpp"

// Free flight through a step: the ball flies to the first contact, bounces, and continues.

namespace o80::mujoco {

inline constexpr int kMaxBounces = 8;  // in one step

/// Flies a ball from the share `begin` of a step [s] to its end, with all bounces on the way.
/// Calls `bounced_off(contact, before, after)` for each bounce, and `passed(surface, gap)` with
/// the smallest gap to each watched surface.
template <class BouncedOff, class Passed>
Ball flown_among(std::span<const Surface> surfaces, Ball ball, const Air& air, const Sphere& sphere,
                 double step, double begin, BouncedOff&& bounced_off, Passed&& passed) noexcept {
  for (int n = 0; n < kMaxBounces && begin < 1; ++n) {
    const Ball end = flown(ball, air, (1 - begin) * step);
    const Path path{ball.position, end.position, ball.velocity, end.velocity, begin};
    const std::optional<Contact> contact = first_contact(surfaces, path, sphere.radius, passed);
    if (!contact) return end;
    const double share = contact->share;
    const Ball before{path.position(share), path.velocity(share),
                      between(ball.spin, end.spin, path.part(share))};
    ball = bounced(before, *contact, sphere);
    bounced_off(*contact, before, ball);
    begin = share;
  }
  return ball;  // the step is over, or the ball is wedged between surfaces until its end
}

}  // namespace o80::mujoco
