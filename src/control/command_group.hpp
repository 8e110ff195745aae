#pragma once

#include <algorithm>
#include <cstdint>

#include "control/pool.hpp"
#include "control/record.hpp"

namespace o80 {

/// Marks the id of a member of a group; the bits below hold the block of the group's head. Ids of
/// records never grow that far.
inline constexpr CommandId kMemberMark = CommandId{1} << 63;

/// A checked command that is part of one for several actuators.
inline bool is_member(const RecordHead& head) noexcept { return (head.id & kMemberMark) != 0; }

/// What the backend keeps of a command of several actuators, behind its head. Each member lies in
/// the queue of its actuator like any command.
struct CommandGroup {
  Iteration last_end = 0;     // of its members
  std::uint16_t open = 0;     // members that have not ended
  std::uint16_t arrived = 0;  // of them, first in their queues in the iteration of the stamp
  Status end = Status::none;  // the first one that is not completed
  Reason reason = Reason::none;
  std::uint8_t detail = 0;
  std::uint8_t active : 1 = 0;   // reported as active
  std::uint8_t offered : 1 = 0;  // the stamp of offers is valid
};
static_assert(sizeof(CommandGroup) == kBlockBytes - sizeof(RecordHead));

/// Finds groups, and lets their members begin together.
///
/// Realtime: yes.
class CommandGroups {
 public:
  explicit CommandGroups(BlockPool& pool) : pool_(&pool) {}

  /// Members whose own numbers of iterations differ from row to row.
  static bool agrees_on_rows(const RecordHead& head) noexcept {
    return head.pace == Pace::speed || head.pace == Pace::fastest;
  }
  static BlockIndex head_of(const RecordHead& member) noexcept {
    return static_cast<BlockIndex>(member.id & ~kMemberMark);
  }
  CommandGroup& at(BlockIndex head) noexcept {
    return *reinterpret_cast<CommandGroup*>(pool_->bytes(head) + sizeof(RecordHead));
  }

  /// Notes that a member is the next one of its queue. All queues call it before any asks
  /// `is_complete`.
  void arrive(const RecordHead& member, Iteration iteration) noexcept {
    const BlockIndex head = head_of(member);
    CommandGroup& group = at(head);
    if (stamp(head, kArrivals) != low(iteration)) group.arrived = 0;
    stamp(head, kArrivals) = low(iteration);
    ++group.arrived;
  }
  /// Whether all members that have not ended have arrived, or some have already begun.
  bool is_complete(const RecordHead& member, Iteration iteration) noexcept {
    const BlockIndex head = head_of(member);
    const CommandGroup& group = at(head);
    return group.active != 0 ||
           (stamp(head, kArrivals) == low(iteration) && group.arrived == group.open);
  }

  /// Offers a number; the largest one offered in an iteration holds for all members.
  void offer(const RecordHead& member, Iteration iteration, std::int64_t number) noexcept {
    const BlockIndex head = head_of(member);
    CommandGroup& group = at(head);
    std::int64_t& largest = pool_->head(head).amount;
    const bool is_first = group.offered == 0 || stamp(head, kOffers) != low(iteration);
    largest = is_first ? number : std::max(largest, number);
    group.offered = 1;
    stamp(head, kOffers) = low(iteration);
  }
  std::int64_t agreed(const RecordHead& member) const noexcept {
    return pool_->head(head_of(member)).amount;
  }

 private:
  // words of RecordHead::own that the head of a group does not need, because it is in no queue
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
