#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "o80/control/command.hpp"
#include "o80/control/status.hpp"

namespace o80 {

/// A block in the pool of the backend.
using BlockIndex = std::uint32_t;
inline constexpr BlockIndex kNoBlock = 0xFFFFFFFF;

/// A lane transports blocks of 64 bytes; every record starts at a block.
inline constexpr std::size_t kBlockBytes = 64;
struct alignas(kBlockBytes) Block {
  std::array<std::byte, kBlockBytes> bytes;
};

enum class RecordKind : std::uint8_t {
  batch = 1,
  command,
  purge,
  request,
  take_control,
  release_control,
  resume,  // clears halts up to the number in `amount`
  group,   // one command for several actuators, with one status; `rows` members follow
  member,
  mark,        // a note for the journal; the payload is its text
  seen,        // the row by which the batch was decided; only the journal's readers use it
  close_plan,  // no chunk of the sender's plan `amount` follows; 0: of none of its plans
  // set by BatchPlanner only; invalid when sent by a frontend
  overwritten_list = 0x80,  // first of a list of records with this end status, in no queue
  purged_list,
  completed_list,
  invalid_list,
  overwriter_overwritten,  // overwrites a queue, and is then overwritten by its own batch
  overwriter_purged
};

/// True for the kinds that a lane may hold, and for those of the backend.
constexpr bool is_known(RecordKind kind) noexcept {
  return (kind >= RecordKind::batch && kind <= RecordKind::close_plan) ||
         (kind >= RecordKind::overwritten_list && kind <= RecordKind::overwriter_purged);
}

/// Longest pace [iterations]: a status stores 48 bits of an iteration.
inline constexpr std::int64_t kMaxIterations = std::int64_t{1} << 47;
/// The longest duration [ns].
inline constexpr std::int64_t kLongestDuration = std::int64_t{1} << 61;

/// The first 48 bytes of every record except the batch record; the payload follows.
///
/// Payload of a command:
/// - if `masked`: the mask, one bit for each number of the state, in 8-byte words;
/// - if a trajectory has its own times (pace `duration`, rows > 1): the end time of each row since
///   the start of the command (int64 [ns]);
/// - the rows, one state each. `iterations` and `speed` apply to each row; `until` allows one row.
/// Payload of a member of a chunk: see ChunkPlaces. Payload of a request: its struct; of a mark:
/// its text in UTF-8. A group has none; that of a chunk has a ChunkHead in its second block.
///
/// Members follow their group record. They do not count as records of the batch, have the id of the
/// group, and the layout of a command with the pace, mode, profile, start and rows of the group.
struct RecordHead {
  RecordKind kind = RecordKind::command;
  Mode mode = Mode::queue;
  Pace pace = Pace::direct;
  Profile profile = Profile::linear;
  Start start = Start::desired;
  union {
    std::uint8_t masked = 0;  // command: 1 if the payload begins with a mask
    std::uint8_t only_own;    // purge: 1 to purge only commands of this lane
    std::uint8_t accepts;     // resume: 1 to accept a reading that cannot be
  };
  std::uint16_t actuator = 0;  // purge: may be kEveryActuator; request: index of the request
  CommandId id = 0;            // record_id() of the batch and the index in it
  std::uint32_t payload_bytes = 0;
  std::uint32_t rows = 1;  // group: number of members
  union {
    // duration [ns], last iteration of until, number of iterations, time between set-points [ns]
    std::int64_t amount = 0;
    double speed;  // speed of the first commanded number [1/s]
  };
  std::array<std::uint32_t, 4> own{};  // for the backend; values from a frontend are ignored
};
static_assert(sizeof(RecordHead) == 48 && std::is_trivially_copyable_v<RecordHead> &&
              std::is_standard_layout_v<RecordHead>);

// flags of a batch
inline constexpr std::uint16_t kBurstUntilEnded = 1;
/// The batch has only purges and control orders, and does not wait for batches of other lanes
/// (src/control/README.md#order).
inline constexpr std::uint16_t kExpress = 2;

// limits of one batch: `pulse` refuses more, and the backend rejects the records beyond them
inline constexpr std::uint32_t kMaxRequests = 8;
inline constexpr std::uint32_t kMaxOrders = 8;
/// Longest text of a mark [bytes].
inline constexpr std::uint32_t kMaxMarkBytes = 1024 - sizeof(RecordHead);
/// Most records of an express batch.
inline constexpr std::uint32_t kMaxExpressRecords = 32;

/// The first block of a batch.
///
/// A batch has two ids. The status of `id` is active when the batch is taken, or rejected. The
/// status of `id + 1` is completed when the last record has ended, or rejected. Its records have
/// the ids from `id + 2` on.
struct BatchRecord {
  RecordKind kind = RecordKind::batch;
  std::uint8_t late_now = 0;
  std::uint16_t flags = 0;
  std::uint32_t records = 0;  // number of records, without members
  CommandId id = 0;
  std::uint64_t ticket = 0;
  Iteration at = kNow;
  std::int64_t burst = 0;    // iterations to run; 0: no burst
  std::uint32_t blocks = 1;  // blocks of the whole batch, with this one
  /// Numbers of its targets that its sender has put inside their bounds.
  std::uint32_t clipped = 0;
  std::array<std::uint32_t, 4> own{};
};
static_assert(sizeof(BatchRecord) == kBlockBytes && std::is_trivially_copyable_v<BatchRecord> &&
              std::is_standard_layout_v<BatchRecord>);

/// The block behind the records of a batch that says what it answers: a record of kind `seen`. It
/// is none of the records that the batch counts, so the backend passes it over: it has no id and no
/// status, and changes nothing that the batch does. Of its head, `amount` is Seen::iteration, `id`
/// is Seen::since (all bits set: not known), and `actuator` the clock.
struct SeenBlock {
  RecordHead head;
  std::uint64_t epoch = 0;
  std::int64_t time = -1;
};
static_assert(sizeof(SeenBlock) == kBlockBytes && std::is_trivially_copyable_v<SeenBlock>);

/// Number of blocks of a record with this payload.
constexpr std::uint64_t blocks_of(std::uint64_t payload_bytes) noexcept {
  return (sizeof(RecordHead) + payload_bytes + kBlockBytes - 1) / kBlockBytes;
}

/// Number of 64-bit words of a mask.
constexpr std::uint32_t mask_words(std::uint32_t bits) noexcept { return (bits + 63) / 64; }

/// Id of the record at index `place` of a batch.
constexpr CommandId record_id(CommandId batch, std::uint64_t place) noexcept {
  return batch + 2 + place;
}

}  // namespace o80
