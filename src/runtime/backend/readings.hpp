#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

#include "base/short_text.hpp"
#include "runtime/backend/backend_core.hpp"
#include "runtime/backend/reading_watch.hpp"

namespace o80 {

/// What a user may do about a reading that cannot be.
inline constexpr std::string_view kToResume =
    "resume with --accept-reading (accept_reading in code)";

/// Judges the readings from which a robot begins, resumes, or follows.
///
/// Realtime: everything but construction.
class Readings {
 public:
  Readings(BackendCore& core, const BackendOptions& options);

  bool empty() const noexcept { return watch_.empty(); }
  /// Finds NaN or infinity in the first reading or in a fresh start, which are refused because no
  /// command could start from there. True if there is one; `why` names the first.
  bool name_not_finite(const std::byte* states, std::string_view what,
                       ShortText<248>& why) const noexcept;
  /// The same; false after it has noted the failure.
  bool can_begin(const std::byte* states, std::string_view what) noexcept;
  /// True if the robot cannot be where it was read; `why` says so.
  bool is_misread(const std::byte* observed, std::string_view cure,
                  ShortText<248>& why) const noexcept;
  /// Later readings are compared with this one, which was made at `time` [ns].
  void begin(const std::byte* observed, std::int64_t time) noexcept;

  // the first reading
  bool judge_first(bool again) noexcept;
  /// Judges the first two readings of an embedded backend: row 0 by its bounds, the next by how far
  /// the robot can have come. If the second is wrong, the backend ends.
  bool agrees_with_first() noexcept { return !judges_first_ || judge_against_first(); }

  // fresh starts
  enum class Judged : std::uint8_t { none, readings, all };
  bool judges_fresh_starts() const noexcept { return judges_fresh_; }
  bool reads_fresh(FreshReading& reading) const noexcept {
    return core_.asks("the reading of a fresh start",
                      [&](RequestServer& server) { return server.read_fresh(reading); });
  }
  /// Reads the robot for a fresh start; false if it cannot begin there, and the last reading stays.
  bool read_again(FreshReading& reading, Judged judged, ShortText<248>& why) noexcept;

  // halts
  /// The last reading before a halt may be the wrong one that has caused it: begins with the one
  /// before, unless a fresh start lies between them.
  void begin_of_halt() noexcept;
  /// While the robot is halted: notes each reading, for the resume.
  void add() noexcept;

  // actuators that follow
  /// Notes each reading of actuators that follow, for the next command.
  void watch_followers(bool fresh) noexcept {
    if (!followed_.empty()) add_followed(fresh);
  }
  /// True if actuators without a command that follow can be where they are read; else rejects what
  /// moves.
  bool admitted_by_followers(const StagedBatch& sent) noexcept;
  /// The same for an actuator of a group command that is about to begin.
  bool may_begin(std::uint32_t actuator, std::uint32_t lane, CommandId id) noexcept;

 private:
  bool judge_against_first() noexcept;
  void add_followed(bool fresh) noexcept;
  double since_reading() const noexcept;

  BackendCore& core_;
  ReadingWatch watch_;
  ReadingWatch followed_;  // of actuators that follow
  std::int64_t followed_at_ = 0;
  bool judges_first_;                    // an embedded backend, until the second reading
  const bool judges_fresh_;              // the readings of fresh starts
  std::int64_t read_at_ = 0;             // time of the last row whose reading was not missed
  std::vector<std::uint64_t> last_row_;  // or observed states, while a fresh reading is judged
};

}  // namespace o80
