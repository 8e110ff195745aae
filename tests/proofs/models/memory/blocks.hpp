#pragma once

/// Batches as the models of lanes send them.

#include "kernel.hpp"

namespace model {

/// Where a batch bears its ticket.
inline constexpr std::size_t kTicketAt = 8;

/// What stands in a block: its batch, its place; the ticket is drawn by `send`.
struct Block {
  std::uint64_t number = 0;
  std::uint64_t ticket = 0;
  std::uint64_t place = 0;
  std::uint64_t count = 0;
  std::uint64_t filler[4] = {};
};

inline bool send(o80::LaneSender& lane, std::uint64_t number, std::uint64_t count) {
  if (lane.free_blocks() < count) return false;
  Block batch[4];
  for (std::uint64_t i = 0; i < count; ++i)
    batch[i] = {.number = number, .place = i, .count = count};
  lane.send({reinterpret_cast<const std::byte*>(batch), count * sizeof(Block)}, kTicketAt);
  return true;
}

/// Takes the next batch whole; its number.
inline std::uint64_t take(o80::LaneReceiver& lane) {
  Block block;
  auto* bytes = reinterpret_cast<std::byte*>(&block);
  check(lane.take(bytes), "a batch without a block");
  const Block first = block;
  check(first.place == 0 && first.number != 0, "a batch begins in its middle");
  for (std::uint64_t i = 1; i < first.count; ++i) {
    check(lane.take(bytes), "a batch was not committed whole");
    check(block.number == first.number && block.place == i, "a block is of another batch");
  }
  return first.number;
}

}  // namespace model
