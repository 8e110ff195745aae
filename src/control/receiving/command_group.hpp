#pragma once

#include <algorithm>
#include <cstdint>
#include <utility>

#include "control/batch/record.hpp"
#include "control/receiving/pool.hpp"

namespace o80 {

/// The internal id of a member of a group: this bit plus the block index of the group record. Ids
/// of records never reach this bit.
inline constexpr CommandId kMemberMark = CommandId{1} << 63;

/// True for a checked command that is a member of a group.
inline bool is_member(const RecordHead& head) noexcept { return (head.id & kMemberMark) != 0; }

/// State of a command of several actuators, stored behind the head of its group record
/// (src/control/README.md#queue). Each member is in the queue of its actuator.
struct CommandGroup {
  Iteration last_end = 0;     // last iteration in which a member has ended
  std::uint16_t open = 0;     // members that have not ended
  std::uint16_t arrived = 0;  // members that are next in their queues, in the iteration kArrivals
  Status end = Status::none;  // the first end status of a member that is not completed
  Reason reason = Reason::none;
  std::uint8_t detail = 0;
  std::uint8_t active : 1 = 0;   // reported as active
  std::uint8_t offered : 2 = 0;  // a CommandGroups::Offer
  std::uint8_t decided : 1 = 0;  // its members have nothing left to agree on
};
static_assert(sizeof(CommandGroup) == kBlockBytes - sizeof(RecordHead));

/// Lets the members of a group begin together and take the same number of iterations.
///
/// Realtime: yes.
class CommandGroups {
 public:
  explicit CommandGroups(BlockPool& pool) : pool_(&pool) {}

  /// What members agree on: the largest offer of an iteration.
  enum class Offer : std::uint8_t { none, carry, iterations };
  static BlockIndex head_of(const RecordHead& member) noexcept {
    return static_cast<BlockIndex>(member.id & ~kMemberMark);
  }
  CommandGroup& at(BlockIndex head) noexcept {
    return *reinterpret_cast<CommandGroup*>(pool_->bytes(head) + sizeof(RecordHead));
  }

  /// The group is complete.
  void begin(BlockIndex head) noexcept {
    const auto members = static_cast<std::uint16_t>(std::exchange(pool_->head(head).rows, 0));
    at(head) = {.open = members};
  }
  /// Notes that a member is next in its queue. All queues call it before any calls is_complete().
  void arrive(const RecordHead& member, Iteration iteration) noexcept {
    const BlockIndex head = head_of(member);
    CommandGroup& group = at(head);
    if (stamp(head, kArrivals) != low(iteration)) group.arrived = 0;
    stamp(head, kArrivals) = low(iteration);
    ++group.arrived;
  }
  /// True if all members that have not ended have arrived, or if one has begun.
  bool is_complete(const RecordHead& member, Iteration iteration) noexcept {
    const BlockIndex head = head_of(member);
    const CommandGroup& group = at(head);
    return group.active != 0 ||
           (stamp(head, kArrivals) == low(iteration) && group.arrived == group.open);
  }

  /// Proposes a number; agreed() is the largest one of this kind and iteration.
  void offer(const RecordHead& member, Offer kind, Iteration iteration,
             std::int64_t number) noexcept {
    const BlockIndex head = head_of(member);
    CommandGroup& group = at(head);
    std::int64_t& largest = pool_->head(head).amount;
    const bool is_first =
        static_cast<Offer>(group.offered) != kind || stamp(head, kOffers) != low(iteration);
    largest = is_first ? number : std::max(largest, number);
    group.offered = static_cast<std::uint8_t>(kind) & 3U;
    stamp(head, kOffers) = low(iteration);
  }
  /// Notes by how much a member was late, if their times are decided; `rows` of the head has it.
  void note_late(BlockIndex head, std::int64_t late) noexcept {
    std::uint32_t& most = pool_->head(head).rows;
    if (at(head).decided == 0 || late <= most) return;
    most = static_cast<std::uint32_t>(std::min<std::int64_t>(late, 0xFFFF));
  }
  std::int64_t late(BlockIndex head) const noexcept { return pool_->head(head).rows; }
  std::int64_t agreed(const RecordHead& member) const noexcept {
    return pool_->head(head_of(member)).amount;
  }

 private:
  // words of RecordHead::own for iterations (low 32 bits); a group record is in no queue
  static constexpr std::size_t kArrivals = 0;
  static constexpr std::size_t kOffers = 3;

  std::uint32_t& stamp(BlockIndex head, std::size_t which) noexcept {
    return pool_->head(head).own[which];
  }
  static std::uint32_t low(Iteration iteration) noexcept {
    return static_cast<std::uint32_t>(iteration);
  }

  BlockPool* pool_;
};

}  // namespace o80
