#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string_view>

#include "o80/base/time.hpp"
#include "o80/describe/rows.hpp"

namespace o80 {

inline constexpr std::uint16_t kEveryActuator = 0xFFFF;
inline constexpr Iteration kNow = -1;

enum class Mode : std::uint8_t { queue, overwrite };
enum class Pace : std::uint8_t { direct, duration, speed, until, iterations, fastest, chunk };
/// Profile of a motion; from `monotone` on for rows of a chunk or trajectory (docs/chunks.md).
enum class Profile : std::uint8_t { linear, minimum_jerk, as_sent, monotone, hold, smooth };
/// True for a curve through rows.
constexpr bool is_curved(Profile profile) noexcept {
  return profile == Profile::smooth || profile == Profile::monotone;
}
/// True for profiles that only rows have.
constexpr bool is_of_rows(Profile profile) noexcept {
  return is_curved(profile) || profile == Profile::hold;
}
/// State from which a command starts.
enum class Start : std::uint8_t { desired, observed };

std::string_view to_text(Mode mode) noexcept;
std::string_view to_text(Pace pace) noexcept;
std::string_view to_text(Profile profile) noexcept;
std::string_view to_text(Start start) noexcept;

/// Pace of a motion to a target: made by direct(), duration(), speed(), until(), iterations() or
/// fastest().
struct PaceSpec {
  Pace pace = Pace::direct;
  std::int64_t amount = 0;
  double per_second = 0;
};

/// A set-point: goes to the target as fast as the limits allow (without limits: in one iteration)
/// and is replaced by the next direct command. `every`: time between the set-points of a stream;
/// with an acceleration limit, the motion then takes twice that, or longer.
constexpr PaceSpec direct(std::chrono::nanoseconds every = std::chrono::nanoseconds(0)) {
  return {Pace::direct, every.count(), 0};
}
constexpr PaceSpec duration(std::chrono::nanoseconds time) {
  return {Pace::duration, time.count(), 0};
}
/// Peak speed of the first number of the state, in its unit [1/s].
constexpr PaceSpec speed(double per_second) { return {Pace::speed, 0, per_second}; }
/// Reaches the target at this iteration.
constexpr PaceSpec until(Iteration iteration) { return {Pace::until, iteration, 0}; }
/// Reaches the target in `count` iterations (a trajectory: each of its waypoints).
constexpr PaceSpec iterations(std::int64_t count) { return {Pace::iterations, count, 0}; }

/// True if each target is for one iteration; a group sends such targets as set-points.
constexpr bool is_each_iteration(const PaceSpec& pace) {
  return pace.pace == Pace::iterations && pace.amount == 1;
}

/// As fast as the limits allow, at rest at the end. Every commanded number needs a speed limit and
/// an acceleration limit.
constexpr PaceSpec fastest() { return {Pace::fastest, 0, 0}; }

/// Options of a command, besides its actuator and its target.
struct CommandOptions {
  PaceSpec pace = {};
  Mode mode = Mode::queue;
  /// Default: minimum_jerk for an actuator with acceleration limits, else linear. as_sent: for
  /// direct commands of a generator at the loop's rate, unchanged within the limits.
  std::optional<Profile> profile = {};
  Start start = Start::desired;
};

/// Row by which a batch was decided, of this or another segment. An observation converts to
/// Seen.
struct Seen {
  std::uint64_t epoch = 0;  // run that published the row
  Iteration iteration = 0;
  std::int64_t time = -1;          // time of the row's capture [ns]; -1: not known
  Clock clock = Clock::monotonic;  // clock of that time
  /// Newest iteration of the commanded robot at or before that capture: start of the decision's
  /// latency; -1: not known. Set when the batch is sent.
  Iteration since = -1;

  bool operator==(const Seen&) const = default;
};

/// Iteration at which a batch acts, the policy if that iteration has begun, and the row by which
/// the batch was decided.
struct PulseOptions {
  enum class Late : std::uint8_t { reject, now };
  Iteration at = kNow;
  Late late = Late::reject;
  std::optional<Seen> seen = {};  // changes no motion
};

/// Options of a chunk: rows of targets, each for a fixed iteration (docs/chunks.md).
struct ChunkOptions {
  Iteration anchor = 0;     ///< Iteration of the observation to which the rows refer.
  std::uint64_t epoch = 0;  ///< Run that takes the chunk; set when sent.
  std::uint64_t plan = 0;   ///< Number of a plan: within one, an older anchor is rejected.
  /// Iterations of the take-over; 0: as many as limits need, at least a step, and at most half of
  /// the iterations ahead.
  std::uint32_t ease = 0;
  std::uint32_t first = 0;   ///< Earlier rows repeat the previous plan and are not played.
  bool fixed = false;        ///< Rows keep their iterations while the actuators are still.
  bool reject_late = false;  ///< Rejects the chunk if row `first` is late: no rows are skipped.
  bool final = false;        ///< No chunk of the plan follows: as UntypedFrontend::add_close_plan.
  Profile profile = Profile::smooth;  ///< Or monotone, linear or hold.
};

/// State of one number in the iteration before a chunk began, where the take-over starts.
struct ChunkStart {
  std::uint32_t actuator = 0;
  std::uint32_t number = 0;  ///< Index in the state.
  double place = 0.0;        ///< Of the plan in force, before limits.
  double slope = 0.0;        ///< [1/iteration]
  double curvature = 0.0;    ///< [1/iteration^2]
};

}  // namespace o80
