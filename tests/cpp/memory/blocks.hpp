#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "memory/os/atomic_words.hpp"
#include "memory/ring/lane_receiver.hpp"
#include "memory/ring/lane_sender.hpp"

namespace o80 {

inline constexpr std::size_t kTicketAt = 16;

/// A block as the tests send it: its sender's number, its length, its ticket, its place.
struct TestBlock {
  std::uint64_t number = 0;
  std::uint64_t count = 1;
  std::uint64_t ticket = 0;
  std::uint64_t index = 0;
  std::uint64_t filler[4] = {};
};
static_assert(sizeof(TestBlock) == kBlockSize && offsetof(TestBlock, ticket) == kTicketAt);

inline std::vector<TestBlock> batch_of(std::uint64_t number, std::size_t count) {
  std::vector<TestBlock> blocks(count);
  for (std::size_t i = 0; i < count; ++i) {
    blocks[i].number = number;
    blocks[i].count = count;
    blocks[i].index = i;
    for (std::uint64_t& word : blocks[i].filler) word = number;
  }
  return blocks;
}

inline std::uint64_t send(LaneSender& sender, std::uint64_t number, std::size_t count = 1) {
  const std::vector<TestBlock> batch = batch_of(number, count);
  return sender.send(std::as_bytes(std::span(batch)), kTicketAt);
}

inline bool take(LaneReceiver& lane, TestBlock& block) {
  return lane.take(reinterpret_cast<std::byte*>(&block));
}

/// Takes one whole batch; its number, or 0 if any block of it is not as it was sent.
inline std::uint64_t take_batch(LaneReceiver& lane, std::size_t* count = nullptr) {
  TestBlock first;
  if (!take(lane, first)) return 0;
  bool whole = first.index == 0;
  for (std::uint64_t i = 1; i < first.count; ++i) {
    TestBlock block;
    whole = take(lane, block) && block.number == first.number && block.index == i &&
            block.filler[3] == first.number && whole;
  }
  if (count != nullptr) *count = first.count;
  return whole ? first.number : 0;
}

}  // namespace o80
