#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "o80/base/time.hpp"
#include "o80/control/command.hpp"
#include "o80/control/status.hpp"
#include "o80/memory/halt.hpp"
#include "o80/memory/journal_kind.hpp"
#include "o80/memory/life.hpp"

namespace o80 {

class UntypedFrontend;

/// Command, request or order of a batch in the journal.
struct JournalRecord {
  enum class Kind : std::uint8_t {
    command,
    purge,
    request,
    take_control,
    release_control,
    resume,
    mark,
    close_plan,
    unknown
  };
  /// Targets of a command for one actuator.
  struct Target {
    std::uint16_t actuator = 0;
    std::vector<std::uint64_t> mask;  // one bit for each given number; empty: all
    std::vector<std::byte> states;    // the rows, one state each
  };

  Kind kind = Kind::command;
  CommandId id = 0;
  // of a command; `pace.amount` and `pace.per_second` as in PaceSpec
  PaceSpec pace;
  Mode mode = Mode::queue;
  Profile profile = Profile::linear;
  Start start = Start::desired;
  std::uint32_t rows = 1;               // above 1: a trajectory
  std::vector<std::int64_t> row_times;  // of a trajectory with its own times [ns]
  // of a chunk; `due`: iterations of the rows after the anchor
  ChunkOptions chunk;
  std::vector<std::uint32_t> due;
  std::vector<Target> targets;  // more than one: a command of several actuators
  // of a purge
  std::uint16_t actuator = kEveryActuator;
  bool only_own = false;
  // of a request: its index in the schema, and its struct
  std::uint32_t request = 0;
  std::vector<std::byte> payload;
  // of a mark
  std::string text;
  // of a resume
  std::uint64_t halt = 0;
  // parts unknown to this o80, "record kind 10" or "pace 7", recorded by a newer one
  std::string unknown{};
};

/// Decision of a backend. `kind` determines the set members.
struct JournalEntry {
  static constexpr std::uint32_t kNoLane = 0xFFFFFFFF;

  JournalKind kind = JournalKind::none;
  std::uint64_t number = 0;  // of the entry, from 0; entries of batches in transfer count, too
  std::uint64_t missed = 0;  // previous entries that were overwritten before the read
  Iteration iteration = -1;
  std::uint32_t lane = kNoLane;
  std::uint64_t owner = 0;  // incarnation of the lane's owner that caused it; 0: unknown
  std::string who;          // its process, "pid 4711 (python)"; empty: unknown
  CommandId id = 0;         // of the batch, or, for a status and a chunk that begins, of the record

  // taken, scheduled, rejected
  std::uint64_t ticket = 0;
  Iteration at = kNow;                 // requested iteration of the batch
  std::int64_t burst = 0;              // iterations; -1: until the batch has ended
  std::vector<JournalRecord> records;  // empty with `records_lost`
  bool records_lost = false;           // the records were overwritten before the read
  std::vector<std::byte> blocks;       // the batch as it was sent; empty with `records_lost`
  std::optional<Seen> seen{};          // row by which the batch was decided, from the sender
  std::uint32_t clipped = 0;           // number of target values clamped to their bounds
  // status, rejected
  Status status = Status::none;
  Reason reason = Reason::none;
  std::uint8_t detail = 0;
  // chunk_begun: the first reached row; delay of the rows [iterations]; start of the take-over
  std::uint32_t row = 0;
  std::int64_t shift = 0;
  std::vector<ChunkStart> starts;
  // halt, halt_reason, resume: the number; burst_ended: whether it was cut short
  std::uint64_t halt = 0;
  HaltCause cause = HaltCause::none;
  bool cut = false;
  std::string text;                            // of a halt, and of the end of a failed backend
  std::uint16_t actuator = 0;                  // interrupted
  bool follows = false;                        // fresh_start: idle actuators follow from now on
  bool before_step = false;                    // interrupted before the step of the iteration
  BackendState state = BackendState::running;  // ended
  /// Parts of the entry or its records that are unknown to this o80 ("entry kind 30"), recorded by
  /// a newer o80. Empty: none.
  std::string unknown;
  // snapshot: state of the driver in a slot
  std::uint32_t slot = 0;
  std::vector<std::byte> kept;
};

/// Reads the decisions of a backend, in order, from the journal in its segment: taken and
/// rejected batches, begins and ends of their commands, halts, control, bursts, deaths
/// (src/runtime/README.md#journal).
///
/// The journal is a ring. A slow reader misses entries; `missed` of the next entry counts them.
/// The records of a batch are joined to the entry that decides on the batch.
///
/// Writer / Readers: one thread. Works on any attached segment, also read-only, also of an ended
/// backend.
class Journal {
 public:
  /// Starts at the oldest entry in the ring. Throws Closed.
  explicit Journal(const UntypedFrontend& frontend);
  Journal(Journal&&) noexcept;
  Journal& operator=(Journal&&) noexcept;
  ~Journal();

  /// False if the backend was started without a journal.
  bool exists() const;
  /// Reads the next entry; false if there is none yet. Does not wait. Throws Closed,
  /// UsedAfterFork.
  bool next(JournalEntry& entry);
  /// Continues at the entry of this number; entries before the oldest are reported as missed.
  void seek(std::uint64_t number);
  /// Continues after the newest entry.
  void seek_end();

 private:
  struct Body;
  std::unique_ptr<Body> body_;
};

}  // namespace o80
