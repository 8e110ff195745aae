#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <type_traits>

#include "balls/ball_flight.hpp"
#include "balls/sweep.hpp"
#include "o80/describe/describe.hpp"

// Contacts of one ball with each surface since the last clear.

namespace o80::mujoco {

/// Contacts of a ball with a watched surface, with all data of the first one.
struct WatchedContacts {
  std::int64_t count = 0;
  std::int64_t iteration = -1;
  double fraction = 0;
  std::array<double, 3> position{};
  std::array<double, 3> normal{};
  std::array<double, 3> velocity_before{};
  std::array<double, 3> velocity_after{};
  std::array<double, 3> surface_velocity{};
  double smallest_distance = std::numeric_limits<double>::infinity();
  double largest_speed = 0;
};
O80_DESCRIBE(WatchedContacts, (count, "contacts with this surface"),
             (iteration, "of the first contact, on the simulation's `clock`; -1: none"),
             (fraction, "of that iteration that had passed at the contact, 0 to 1"),
             (position, "of the first contact, in the world [m]"),
             (normal, "of the surface there, towards the ball"),
             (velocity_before, "of the ball [m/s]"), (velocity_after, "of the ball [m/s]"),
             (surface_velocity, "at the point of contact [m/s]"),
             (smallest_distance, "of the ball from this surface so far [m]"),
             (largest_speed, "of the ball since the first contact [m/s]"));
static_assert(std::is_trivially_copyable_v<WatchedContacts>);

/// Contacts of a ball in free flight with a surface that is not watched.
struct SurfaceContacts {
  std::int64_t count = 0;
  std::int64_t iteration = -1;
  std::array<double, 3> position{};
};
O80_DESCRIBE(SurfaceContacts, (count, "contacts with this surface in free flight"),
             (iteration,
              "of the first one after the ball met a watched surface, if there are any; -1: none"),
             (position, "of that contact, in the world [m]"));
static_assert(std::is_trivially_copyable_v<SurfaceContacts>);

constexpr std::array<double, 3> numbers(const Vector& v) noexcept { return {v.x, v.y, v.z}; }
constexpr Vector vector(const std::array<double, 3>& v) noexcept { return {v[0], v[1], v[2]}; }

/// Step of an iteration.
struct StepOfIteration {
  std::int64_t iteration = 0;  // on the simulation's clock
  std::uint32_t number = 0;
  std::uint32_t count = 1;

  bool is_first() const noexcept { return number == 0; }
  bool is_last() const noexcept { return number + 1 == count; }
  /// Shares of the iteration.
  double begin() const noexcept { return static_cast<double>(number) / count; }
  double duration() const noexcept { return 1.0 / count; }
};

/// Records of one ball, in memory of the owner.
struct ContactRecords {
  std::span<WatchedContacts> watched;
  std::span<SurfaceContacts> others;

  void clear() const noexcept {
    std::ranges::fill(watched, WatchedContacts{});
    std::ranges::fill(others, SurfaceContacts{});
  }

  /// True after the first contact with a watched surface; always, if no surface is watched.
  bool met() const noexcept {
    return watched.empty() || std::ranges::any_of(watched, [](const WatchedContacts& contacts) {
             return contacts.count > 0;
           });
  }

  /// Adds a bounce.
  void add(const StepOfIteration& step, const Contact& contact, const Ball& before,
           const Ball& after) const noexcept {
    if (contact.surface->watched) {
      add_watched(watched[contact.surface->record], step, contact, before, after);
    } else {
      add_other(others[contact.surface->record], step, contact);
    }
    add_velocity(after.velocity);
  }

  /// Adds the smallest gap between the ball and a surface [m].
  void add_gap(const Surface& surface, double gap) const noexcept {
    if (!surface.watched) return;
    double& smallest = watched[surface.record].smallest_distance;
    smallest = std::min(smallest, gap);
  }

  /// Adds a velocity of the ball [m/s].
  void add_velocity(const Vector& velocity) const noexcept {
    for (WatchedContacts& contacts : watched) {
      if (contacts.count == 0) continue;
      contacts.largest_speed = std::max(contacts.largest_speed, length(velocity));
    }
  }

 private:
  static void add_watched(WatchedContacts& contacts, const StepOfIteration& step,
                          const Contact& contact, const Ball& before, const Ball& after) noexcept {
    if (contacts.count++ > 0) return;
    contacts.iteration = step.iteration;
    contacts.fraction = step.begin() + contact.share * step.duration();
    contacts.position = numbers(contact.point);
    contacts.normal = numbers(contact.normal);
    contacts.velocity_before = numbers(before.velocity);
    contacts.velocity_after = numbers(after.velocity);
    contacts.surface_velocity = numbers(contact.surface_velocity);
    contacts.smallest_distance = 0;
  }

  void add_other(SurfaceContacts& contacts, const StepOfIteration& step,
                 const Contact& contact) const noexcept {
    ++contacts.count;
    if (contacts.iteration >= 0 || !met()) return;
    contacts.iteration = step.iteration;
    contacts.position = numbers(contact.point);
  }
};

}  // namespace o80::mujoco
