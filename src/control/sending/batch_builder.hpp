#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "control/batch/chunk.hpp"
#include "control/batch/record.hpp"

namespace o80 {

/// Builds a batch as blocks for a lane.
///
/// Each function returns the index of its record in the batch. Once the batch has its id, the id of
/// the record is `record_id(batch, index)`.
class BatchBuilder {
 public:
  BatchBuilder() : blocks_(1) {}

  struct Member {
    RecordHead head;
    std::span<const std::uint64_t> mask;
    std::span<const std::byte> states;
  };

  /// Adds a command. `head` has actuator, mode, pace, profile, start and amount. `mask` is empty or
  /// has one bit for each number of the state. `times` is empty or has one end time for each row
  /// [ns]. `states` holds `rows` states.
  std::uint32_t command(const RecordHead& head, std::span<const std::uint64_t> mask,
                        std::span<const std::int64_t> times, std::uint32_t rows,
                        std::span<const std::byte> states) {
    add_command({head, mask, states}, RecordKind::command, times, rows);
    return records_ - 1;
  }
  std::uint32_t command(const RecordHead& head, std::span<const std::byte> state) {
    return command(head, {}, {}, 1, state);
  }
  /// Adds one command for several actuators, whose heads (as above) differ only in the actuator.
  std::uint32_t group(std::span<const Member> members, std::span<const std::int64_t> times = {},
                      std::uint32_t rows = 1);
  /// Adds a chunk, of one actuator or several; their heads have actuator and profile. `chunk` has
  /// what a frontend gives, but `rows`. `due`: iterations after the anchor, rising, for each row.
  /// `layouts`: of the states of the members.
  std::uint32_t chunk(std::span<const Member> members, const ChunkHead& chunk,
                      std::span<const std::uint32_t> due,
                      std::span<const StateLayout* const> layouts);
  std::uint32_t purge(std::uint16_t actuator_or_every) {
    return add(head_of(RecordKind::purge, actuator_or_every));
  }
  /// Purges only commands of this lane.
  std::uint32_t purge_own(std::uint16_t actuator_or_every) {
    return add(head_of(RecordKind::purge, actuator_or_every, 1));
  }
  std::uint32_t request(std::uint16_t index, std::span<const std::byte> payload) {
    return add(head_of(RecordKind::request, index), payload);
  }
  std::uint32_t take_control() { return add(head_of(RecordKind::take_control)); }
  std::uint32_t release_control() { return add(head_of(RecordKind::release_control)); }
  /// Clears halts up to this number.
  std::uint32_t resume(std::uint64_t number, bool accept_reading = false) {
    return add(head_of(RecordKind::resume, 0, accept_reading ? 1 : 0, number));
  }

  /// No chunk of this plan follows; 0: of no plan of this lane.
  std::uint32_t close_plan(std::uint64_t plan) {
    return add(head_of(RecordKind::close_plan, 0, 0, plan));
  }

  /// A note for the journal: 1 to kMaxMarkBytes bytes in UTF-8. Throws InvalidArgument.
  std::uint32_t mark(std::string_view text);

  /// By which row the batch is decided, if its sender says so: a block behind its records.
  void set_seen(const std::optional<Seen>& seen) noexcept { seen_ = seen; }

  /// So many numbers of its targets were put inside their bounds.
  void note_clipped(std::size_t numbers) noexcept {
    clipped_ += static_cast<std::uint32_t>(numbers);
  }
  std::uint32_t clipped() const noexcept { return clipped_; }

  /// Completes the batch. `batch` has id, ticket, at, late_now, burst and flags. A batch of few
  /// purges and control orders, without `at` and without a burst, is marked as express.
  std::span<const Block> seal(const BatchRecord& batch);

  void clear() {
    blocks_.resize(1);
    records_ = 0;
    counts_ = {};
    seen_.reset();
    clipped_ = 0;
  }
  bool empty() const noexcept { return records_ == 0; }
  std::uint32_t records() const noexcept { return records_; }
  bool has_commands() const noexcept { return of(RecordKind::command) + of(RecordKind::group) > 0; }
  std::uint32_t requests() const noexcept {
    return of(RecordKind::request) + of(RecordKind::resume);
  }
  std::uint32_t orders() const noexcept {
    return of(RecordKind::take_control) + of(RecordKind::release_control) +
           of(RecordKind::close_plan);
  }
  /// Number of blocks of the batch.
  std::uint64_t blocks() const noexcept { return blocks_.size() + (seen_ ? 1 : 0); }

 private:
  /// `option`: only_own of a purge, accepts of a resume.
  static RecordHead head_of(RecordKind kind, std::uint16_t actuator = 0, std::uint8_t option = 0,
                            std::uint64_t amount = 0) {
    RecordHead head;
    head.kind = kind;
    head.actuator = actuator;
    head.only_own = option;
    head.amount = static_cast<std::int64_t>(amount);
    return head;
  }
  std::byte* open(const RecordHead& head, std::uint64_t payload_bytes);
  std::uint32_t add(const RecordHead& head, std::span<const std::byte> payload = {});
  void open_group(const Member& first, std::size_t members, std::span<const std::byte> payload);
  template <class Add>
  std::uint32_t add_group(Add&& add);
  void add_rows(const Member& member, std::span<const std::uint32_t> due,
                const StateLayout& layout);
  void add_command(const Member& member, RecordKind kind, std::span<const std::int64_t> times,
                   std::uint32_t rows);
  std::uint32_t of(RecordKind kind) const noexcept {
    return counts_[static_cast<std::size_t>(kind)];
  }

  std::vector<Block> blocks_;  // the first is the BatchRecord
  std::uint32_t records_ = 0;  // without members
  // of a kind
  std::array<std::uint32_t, static_cast<std::size_t>(RecordKind::close_plan) + 1> counts_{};
  std::optional<Seen> seen_;
  std::uint32_t clipped_ = 0;
};

}  // namespace o80
