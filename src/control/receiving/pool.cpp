#include "control/receiving/pool.hpp"

#include <algorithm>
#include <cerrno>
#include <string>

#include "o80/base/error.hpp"

namespace o80 {

BlockPool::BlockPool(std::uint32_t blocks)
    : size_(blocks), available_(blocks), next_(blocks), ends_(blocks) {
  if (blocks == 0 || blocks == kNoBlock) {
    throw InvalidArgument("a pool must have 1 to " + std::to_string(kNoBlock - 1) +
                          " blocks, got " + std::to_string(blocks));
  }
  void* mapped = mmap(nullptr, std::size_t{blocks} * kBlockBytes, PROT_READ | PROT_WRITE,
                      MAP_PRIVATE | MAP_ANONYMOUS | MAP_POPULATE, -1, 0);
  if (mapped == MAP_FAILED) {
    throw Error("no memory for " + std::to_string(blocks) + " blocks of queued commands (" +
                std::strerror(errno) + "): start the backend with fewer or smaller lanes");
  }
  blocks_ = {static_cast<Block*>(mapped), Unmap{blocks}};

  // write all pages now, so that the loop has no page faults; link the blocks in their order
  std::memset(mapped, 0, std::size_t{blocks} * kBlockBytes);
  for (BlockIndex block = 0; block < blocks; ++block) next_[block] = block + 1;
  next_[blocks - 1] = kNoBlock;
}

/// Reads bytes that cross a block boundary or the end.
bool Cursor::read_across(void* out, std::size_t bytes) noexcept {
  auto* to = static_cast<std::byte*>(out);
  if (bytes > left_) {
    std::memset(to, 0, bytes);
    left_ = 0;
    return false;
  }
  left_ -= bytes;
  while (bytes > 0) {
    if (offset_ == kBlockBytes) {
      block_ = pool_->next(block_);
      offset_ = 0;
    }
    const std::size_t here = std::min<std::size_t>(bytes, kBlockBytes - offset_);
    std::memcpy(to, pool_->bytes(block_) + offset_, here);
    to += here;
    bytes -= here;
    offset_ += static_cast<std::uint32_t>(here);
  }
  return true;
}

}  // namespace o80
