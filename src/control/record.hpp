#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <type_traits>

#include "o80/control/command.hpp"
#include "o80/control/status.hpp"

namespace o80 {

/// What crosses a lane is cut into these; every record starts on one.
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
  group,   // one command for several actuators: `rows` members follow, and end as one
  member,
  // what a plan makes of the kinds of some records; sent by a frontend, they are garbage
  overwritten_list = 0x80,  // the first of a list of records with this end, known to no queue
  purged_list,
  completed_list,
  invalid_list,
  overwriter_overwritten,  // overwrites a queue, and is then overwritten by its own batch
  overwriter_purged
};

/// No pace may reach further: a status holds 48 bits of an iteration.
inline constexpr std::int64_t kMostIterations = std::int64_t{1} << 47;
/// The longest duration [ns].
inline constexpr std::int64_t kLongestDuration = std::int64_t{1} << 61;

/// Starts every record but a batch's; 16 bytes of payload follow in the same block.
///
/// Payload of a command: if masked, the mask (one bit a number of the state, whole words); if a
/// trajectory has its own times (pace duration, rows > 1), the end of each row since the start of
/// the command (int64 [ns]); then the rows, each a state. Of a request: its struct.
/// `iterations` is a pace for each row, so is `speed`; `until` has one row.
///
/// A group is a record of a batch without payload; its members are not, and bear its id. Each is
/// laid out as a command, with pace, mode, profile, start and number of rows of the group.
struct RecordHead {
  RecordKind kind = RecordKind::command;
  Mode mode = Mode::queue;
  Pace pace = Pace::direct;
  Profile profile = Profile::linear;
  Start start = Start::desired;
  union {
    std::uint8_t masked = 0;  // command: 1 if a mask comes first
    std::uint8_t only_own;    // purge: 1 to drop only what this lane sent
  };
  std::uint16_t actuator = 0;  // purge: or kEveryActuator; request: which request
  CommandId id = 0;            // the batch's, plus 2, plus its place in the batch
  std::uint32_t payload_bytes = 0;
  std::uint32_t rows = 1;  // of a group: members
  union {
    std::int64_t amount = 0;  // duration [ns], last iteration of until, number of iterations
    double speed;             // of the first number of the state [1/s]
  };
  std::array<std::uint32_t, 4> own{};  // the backend's, whatever a frontend wrote there
};
static_assert(sizeof(RecordHead) == 48 && std::is_trivially_copyable_v<RecordHead> &&
              std::is_standard_layout_v<RecordHead>);

// flags of a batch
inline constexpr std::uint16_t kBurstUntilEnded = 1;
/// It holds nothing but purges and control orders: it does not wait for other lanes' batches.
inline constexpr std::uint16_t kExpress = 2;

// what one batch may hold; `pulse` refuses more, and the backend rejects the records beyond
inline constexpr std::uint32_t kMostRequests = 8;
inline constexpr std::uint32_t kMostControlOrders = 8;
/// A batch of more records is not express.
inline constexpr std::uint32_t kMostExpressRecords = 32;

/// The first block of a batch.
///
/// Its status is told under two ids: `id` is active when the batch is taken (or rejected), `id + 1`
/// completed when the last of its records has ended (or rejected). Its records have the ids after.
struct BatchRecord {
  RecordKind kind = RecordKind::batch;
  std::uint8_t late_now = 0;
  std::uint16_t flags = 0;
  std::uint32_t records = 0;  // that follow
  CommandId id = 0;
  std::uint64_t ticket = 0;
  Iteration at = kNow;
  std::int64_t burst = 0;    // iterations to run, 0 for none
  std::uint32_t blocks = 1;  // of the whole batch, this one included
  std::array<std::uint32_t, 5> own{};
};
static_assert(sizeof(BatchRecord) == kBlockBytes && std::is_trivially_copyable_v<BatchRecord> &&
              std::is_standard_layout_v<BatchRecord>);

/// Blocks of a record with so much payload.
constexpr std::uint64_t blocks_of(std::uint64_t payload_bytes) noexcept {
  return (sizeof(RecordHead) + payload_bytes + kBlockBytes - 1) / kBlockBytes;
}

/// Words of a mask with one bit for each of `bits`.
constexpr std::uint32_t mask_words(std::uint32_t bits) noexcept { return (bits + 63) / 64; }

/// Id of the record at this place of a batch.
constexpr CommandId record_id(CommandId batch, std::uint64_t place) noexcept {
  return batch + 2 + place;
}

}  // namespace o80
