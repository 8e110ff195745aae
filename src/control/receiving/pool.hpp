#pragma once

#include <sys/mman.h>

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <vector>

#include "control/batch/record.hpp"
#include "control/motion/visit_block.hpp"

namespace o80 {

/// A linked list of blocks in the pool, for example a batch.
struct BlockChain {
  BlockIndex first = kNoBlock;
  BlockIndex last = kNoBlock;
  std::uint32_t blocks = 0;
};

/// Move-only: the private blocks of the backend for queued commands.
///
/// Realtime: everything but construction; append() fails only if the pool is empty.
class BlockPool {
 public:
  explicit BlockPool(std::uint32_t blocks);

  std::uint32_t size() const noexcept { return size_; }
  std::uint32_t available() const noexcept { return available_; }

  /// Copies one block to the end of a chain; false if the pool is empty.
  bool append(BlockChain& chain, const void* block) noexcept {
    std::byte* const to = spare();
    if (to == nullptr) return false;
    std::memcpy(to, block, kBlockBytes);
    append_spare(chain);
    return true;
  }
  /// The block that append_spare() appends, to be filled in place; null if the pool is empty.
  std::byte* spare() noexcept { return free_ == kNoBlock ? nullptr : bytes(free_); }
  /// Call it only if spare() is not null.
  void append_spare(BlockChain& chain) noexcept {
    const BlockIndex taken = free_;
    free_ = next_[taken];
    --available_;
    next_[taken] = kNoBlock;
    (chain.first == kNoBlock ? chain.first : next_[chain.last]) = taken;
    chain.last = taken;
    ++chain.blocks;
    ends_[chain.first] = {taken, chain.blocks};
  }
  /// Frees the chain from `first` to `last`.
  void release(BlockIndex first, BlockIndex last, std::uint32_t blocks) noexcept {
    next_[last] = free_;
    free_ = first;
    available_ += blocks;
  }
  void release(const BlockChain& chain) noexcept {
    if (chain.blocks > 0) release(chain.first, chain.last, chain.blocks);
  }

  BlockIndex next(BlockIndex block) const noexcept {
    O80_VISIT_BLOCK(block);
    return next_[block];
  }
  /// The chain that begins with this block.
  BlockChain chain(BlockIndex first) const noexcept {
    return {first, ends_[first].last, ends_[first].blocks};
  }
  std::byte* bytes(BlockIndex block) noexcept {
    O80_VISIT_BLOCK(block);
    return blocks_[block].bytes.data();
  }
  const std::byte* bytes(BlockIndex block) const noexcept {
    O80_VISIT_BLOCK(block);
    return blocks_[block].bytes.data();
  }
  /// The batch record in the first block of a chain.
  BatchRecord& batch(BlockIndex block) noexcept {
    return *reinterpret_cast<BatchRecord*>(bytes(block));
  }
  RecordHead& head(BlockIndex block) noexcept {
    return *reinterpret_cast<RecordHead*>(bytes(block));
  }
  const RecordHead& head(BlockIndex block) const noexcept {
    return *reinterpret_cast<const RecordHead*>(bytes(block));
  }

 private:
  struct End {
    BlockIndex last;
    std::uint32_t blocks;
  };

  struct Unmap {
    std::size_t blocks;
    void operator()(Block* mapped) const noexcept { munmap(mapped, blocks * kBlockBytes); }
  };

  std::uint32_t size_;
  std::uint32_t available_;
  std::unique_ptr<Block[], Unmap> blocks_;
  BlockIndex free_ = 0;
  std::vector<BlockIndex> next_;
  std::vector<End> ends_;  // for each block: the end of the chain that begins there
};

/// Reads the bytes of a record along its chain of blocks, never past its end.
class Cursor {
 public:
  Cursor() = default;
  Cursor(const BlockPool& pool, BlockIndex block, std::uint32_t offset,
         std::uint64_t bytes) noexcept
      : pool_(&pool), block_(block), offset_(offset), left_(bytes) {}

  std::uint64_t left() const noexcept { return left_; }
  BlockIndex block() const noexcept { return block_; }
  std::uint32_t offset() const noexcept { return offset_; }
  /// Copies the next bytes. False, with zeros, if the record ends before.
  bool read(void* out, std::size_t bytes) noexcept {
    if (bytes > left_ || bytes > kBlockBytes - offset_) return read_across(out, bytes);
    if (bytes == 0) return true;  // `out` may be null
    std::memcpy(out, pool_->bytes(block_) + offset_, bytes);
    offset_ += static_cast<std::uint32_t>(bytes);
    left_ -= bytes;
    return true;
  }

 private:
  bool read_across(void* out, std::size_t bytes) noexcept;

  const BlockPool* pool_ = nullptr;
  BlockIndex block_ = kNoBlock;
  std::uint32_t offset_ = 0;
  std::uint64_t left_ = 0;
};

}  // namespace o80
