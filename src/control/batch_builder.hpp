#pragma once

#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "control/record.hpp"

namespace o80 {

/// Builds a batch as blocks for a lane.
///
/// Each function returns the index of its record in the batch. Once the batch has its id, the id of
/// the record is `record_id(batch, index)`.
class BatchBuilder {
 public:
  BatchBuilder();

  /// Adds a command. `head` has actuator, mode, pace, profile, start and amount. `mask` is empty or
  /// has one bit for each number of the state. `times` is empty or has one end time for each row
  /// [ns]. `states` holds `rows` states.
  std::uint32_t command(const RecordHead& head, std::span<const std::uint64_t> mask,
                        std::span<const std::int64_t> times, std::uint32_t rows,
                        std::span<const std::byte> states);
  std::uint32_t command(const RecordHead& head, std::span<const std::byte> state) {
    return command(head, {}, {}, 1, state);
  }
  /// Adds one command for several actuators. The heads (as above) differ only in the actuator;
  /// `times` and `rows` apply to each member.
  struct Member {
    RecordHead head;
    std::span<const std::uint64_t> mask;
    std::span<const std::byte> states;
  };
  std::uint32_t group(std::span<const Member> members, std::span<const std::int64_t> times = {},
                      std::uint32_t rows = 1);
  std::uint32_t purge(std::uint16_t actuator_or_every);
  /// Purges only commands of this lane.
  std::uint32_t purge_own(std::uint16_t actuator_or_every);
  std::uint32_t request(std::uint16_t index, std::span<const std::byte> payload);
  std::uint32_t take_control();
  std::uint32_t release_control();
  /// Clears halts up to this number.
  std::uint32_t resume(std::uint64_t number, bool accept_reading = false);

  /// A note for the journal: 1 to kMostMarkBytes bytes in UTF-8. Throws InvalidArgument.
  std::uint32_t mark(std::string_view text);

  /// Completes the batch. `batch` has id, ticket, at, late_now, burst and flags. A batch of few
  /// purges and control orders, without `at` and without a burst, is marked as express.
  std::span<const Block> seal(const BatchRecord& batch);

  void clear();
  bool empty() const noexcept { return records_ == 0; }
  std::uint32_t records() const noexcept { return records_; }
  bool has_commands() const noexcept { return commands_ > 0; }
  std::uint32_t requests() const noexcept { return requests_; }
  std::uint32_t control_orders() const noexcept { return control_orders_; }
  /// Number of blocks of the batch.
  std::uint64_t blocks() const noexcept { return blocks_.size(); }

 private:
  std::byte* open(const RecordHead& head, std::uint64_t payload_bytes);
  void add_command(const RecordHead& head, std::span<const std::uint64_t> mask,
                   std::span<const std::int64_t> times, std::uint32_t rows,
                   std::span<const std::byte> states);
  std::size_t set_id(std::size_t block, CommandId id);
  bool is_express(const BatchRecord& batch) const noexcept;

  std::vector<Block> blocks_;  // the first is the BatchRecord
  std::uint32_t records_ = 0;
  std::uint32_t commands_ = 0;
  std::uint32_t requests_ = 0;
  std::uint32_t control_orders_ = 0;
  std::uint32_t marks_ = 0;
};

}  // namespace o80
