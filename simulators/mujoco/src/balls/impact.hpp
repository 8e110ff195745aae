#pragma once

#include <algorithm>
#include <limits>
#include <optional>
#include <span>

#include "balls/ball_flight.hpp"
#include "balls/surface.hpp"

// The law of impact, one for racket, table, net and floor: the relative motion of ball and surface
// is swept through the step, the ball reflected at the moment of contact, and flown for the rest.

namespace o80::mujoco {

/// The way of a ball's centre from a share of the step to its end; straight.
struct Path {
  Vector from{}, to{};                    // [m]
  Vector velocity_from{}, velocity_to{};  // [m/s]
  double begin = 0;                       // share of the step

  double part(double share) const noexcept { return (share - begin) / (1 - begin); }
  Vector position(double share) const noexcept { return between(from, to, part(share)); }
  Vector velocity(double share) const noexcept {
    return between(velocity_from, velocity_to, part(share));
  }
};

/// One contact of ball and surface.
struct Touch {
  double share = 0;           // of the step
  Vector point{};             // of the surface [m]
  Vector normal{};            // from the surface to the ball
  Vector surface_velocity{};  // at the point [m/s]
};

/// What a sweep found.
struct Swept {
  std::optional<Touch> touch;
  double smallest = std::numeric_limits<double>::infinity();  // gap on the way [m]
};

inline constexpr double kTouching = 1e-9;     // a gap below this is none [m]
inline constexpr double kFinestStep = 1e-4;   // of a sweep: a graze within it is 60 nm deep [m]
inline constexpr int kMostSweepSteps = 4096;  // a way of 40 cm within kFinestStep of a surface
inline constexpr int kMostImpacts = 8;        // in one step

/// The first moment at which a ball touches a surface while nearing it; nothing is jumped over,
/// however fast it is.
inline Swept sweep(const Surface& surface, const Path& path, double radius) noexcept {
  const Motion& motion = surface.motion;
  const auto look = [&](double share) {
    return near(surface.shape, motion.inside(path.position(share), share));
  };
  // the ball's centre, seen from the surface, moves no faster than this [m/step]
  const double lever = std::max(length(path.position(path.begin) - motion.position(path.begin)),
                                length(path.to - motion.position(1)));
  const double speed = length((1 / (1 - path.begin)) * (path.to - path.from) - motion.travel()) +
                       motion.angle() * lever;

  Swept result;
  double share = path.begin;
  double clear = -1;  // the last share at which they were apart
  for (int step = 0; step < kMostSweepSteps; ++step) {
    Near here = look(share);
    const double gap = here.distance - radius;
    if (gap > kTouching) {
      clear = share;
    } else {
      // inside already: back to where they touched
      double touching = share;
      if (clear >= 0 && gap < -kTouching) {
        for (int i = 0; i < 50 && touching - clear > 1e-15; ++i) {
          const double middle = 0.5 * (clear + touching);
          (look(middle).distance - radius > kTouching ? clear : touching) = middle;
        }
        here = look(touching);
      }
      clear = -1;
      const Vector normal = motion.outside(here.normal, touching);
      const Vector point = path.position(touching) - here.distance * normal;
      const Vector surface_velocity = motion.velocity(point, touching);
      result.smallest = std::min(result.smallest, std::max(0.0, here.distance - radius));
      if (dot(path.velocity(touching) - surface_velocity, normal) < 0) {
        result.touch = Touch{touching, point, normal, surface_velocity};
        return result;
      }
    }
    result.smallest = std::min(result.smallest, std::max(0.0, gap));
    if (share >= 1) return result;
    if (gap > speed * (1 - share)) break;  // out of reach
    share = std::min(1.0, share + std::max(gap, kFinestStep) / speed);
  }
  result.smallest = std::min(result.smallest, std::max(0.0, look(1).distance - radius));
  return result;
}

/// A ball at the moment of a touch, reflected.
inline Ball bounced(const Ball& touching, const Touch& touch, const Surface& surface) noexcept {
  Ball ball = touching;
  const std::array<Vector, 3> axes{surface.motion.outside({1, 0, 0}, touch.share),
                                   surface.motion.outside({0, 1, 0}, touch.share),
                                   surface.motion.outside({0, 0, 1}, touch.share)};
  ball.velocity =
      reflected(touching.velocity, touch.surface_velocity, touch.normal, axes, surface.restitution);
  return ball;
}

/// Flies a ball from a share of the step to its end, bouncing as often as it must.
/// `impact(surface, touch, before, after)` hears of each bounce, `passed(surface, gap)` how near it
/// came.
template <class Impact, class Passed>
Ball flown_among(std::span<const Surface> surfaces, Ball ball, const Air& air, double radius,
                 double step, double begin, Impact&& impact, Passed&& passed) noexcept {
  for (int n = 0; n < kMostImpacts && begin < 1; ++n) {
    const Ball end = flown(ball, air, (1 - begin) * step);
    const Path path{ball.position, end.position, ball.velocity, end.velocity, begin};
    const Surface* first = nullptr;
    Touch touch;
    for (const Surface& surface : surfaces) {
      const Swept swept = sweep(surface, path, radius);
      passed(surface, swept.smallest);
      if (swept.touch && (first == nullptr || swept.touch->share < touch.share)) {
        first = &surface;
        touch = *swept.touch;
      }
    }
    if (first == nullptr) return end;
    const Ball before{path.position(touch.share), path.velocity(touch.share),
                      between(ball.spin, end.spin, path.part(touch.share))};
    ball = bounced(before, touch, *first);
    impact(*first, touch, before, ball);
    begin = touch.share;
  }
  return ball;  // at the end of the step, or wedged between surfaces until then
}

}  // namespace o80::mujoco
