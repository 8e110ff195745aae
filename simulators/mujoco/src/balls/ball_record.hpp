#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>

#include "balls/impact.hpp"
#include "o80/describe/describe.hpp"

namespace o80::mujoco {

/// What has happened to one ball since it was last cleared. Contacts of a ball whose positions are
/// imposed are those with the racket only.
struct BallRecord {
  std::uint32_t count = 0;
  std::uint32_t table_count = 0;
  std::uint32_t net_count = 0;
  std::uint32_t floor_count = 0;
  std::int64_t iteration = -1;
  double fraction = 0;
  std::array<double, 3> position{};
  std::array<double, 3> normal{};
  std::array<double, 3> velocity_before{};
  std::array<double, 3> velocity_after{};
  std::array<double, 3> racket_velocity{};
  double smallest_distance = std::numeric_limits<double>::infinity();
  double largest_speed = 0;
  std::int64_t landing_iteration = -1;
  std::array<double, 3> landing_position{};
};
O80_DESCRIBE(BallRecord, (count, "contacts with the racket"),
             (table_count, "contacts with the table in free flight"),
             (net_count, "contacts with the net in free flight"),
             (floor_count, "contacts with the floor in free flight"),
             (iteration,
              "of the first contact with the racket, by the simulation's `clock`; or -1"),
             (fraction, "of that iteration that had passed, 0 to 1"),
             (position, "of that contact, in the world [m]"),
             (normal, "from the racket to the ball"), (velocity_before, "of the ball [m/s]"),
             (velocity_after, "of the ball [m/s]"),
             (racket_velocity, "where the ball touched it [m/s]"),
             (smallest_distance, "of the surfaces of ball and racket so far [m]"),
             (largest_speed, "of the ball since that contact [m/s]"),
             (landing_iteration, "of the first contact with the table after it, likewise"),
             (landing_position, "where that was, in the world [m]"));
static_assert(std::is_trivially_copyable_v<BallRecord>);

constexpr std::array<double, 3> numbers(const Vector& v) noexcept { return {v.x, v.y, v.z}; }
constexpr Vector vector(const std::array<double, 3>& v) noexcept { return {v[0], v[1], v[2]}; }

/// Which iteration, and which part of it, a step of the simulator is.
struct Moment {
  std::int64_t iteration = 0;  // by the simulation's clock
  double begin = 0;            // share of the iteration
  double share = 1;            // of the iteration that the step takes
};

/// Adds an impact to what happened to a ball.
inline void note(BallRecord& record, const Moment& moment, const Surface& surface,
                 const Touch& touch, const Ball& before, const Ball& after) noexcept {
  switch (surface.kind) {
    case SurfaceKind::racket:
      if (record.count++ > 0) break;
      record.iteration = moment.iteration;
      record.fraction = moment.begin + touch.share * moment.share;
      record.position = numbers(touch.point);
      record.normal = numbers(touch.normal);
      record.velocity_before = numbers(before.velocity);
      record.velocity_after = numbers(after.velocity);
      record.racket_velocity = numbers(touch.surface_velocity);
      record.smallest_distance = 0;
      break;
    case SurfaceKind::table:
      ++record.table_count;
      if (record.count == 0 || record.landing_iteration >= 0) break;
      record.landing_iteration = moment.iteration;
      record.landing_position = numbers(touch.point);
      break;
    case SurfaceKind::net:
      ++record.net_count;
      break;
    case SurfaceKind::floor:
      ++record.floor_count;
      break;
  }
  if (record.count > 0) {
    record.largest_speed = std::max(record.largest_speed, length(after.velocity));
  }
}

/// Adds how near a ball came to a surface.
inline void note_gap(BallRecord& record, const Surface& surface, double gap) noexcept {
  if (surface.kind != SurfaceKind::racket) return;
  record.smallest_distance = std::min(record.smallest_distance, gap);
}

}  // namespace o80::mujoco
