#include "control/receiving/pool.hpp"

#include <gtest/gtest.h>

#include <random>

#include "o80/base/error.hpp"

namespace o80 {
namespace {

Block filled(std::uint8_t first) {
  Block block;
  for (std::size_t i = 0; i < kBlockBytes; ++i) {
    block.bytes[i] = static_cast<std::byte>(first + i);
  }
  return block;
}

TEST(BlockPool, HandsOutNoMoreThanItHasAndTakesAllBack) {
  BlockPool pool(3);
  BlockChain chain;
  const Block block = filled(0);
  for (int i = 0; i < 3; ++i) EXPECT_TRUE(pool.append(chain, &block));
  EXPECT_FALSE(pool.append(chain, &block));
  EXPECT_EQ(chain.blocks, 3U);
  EXPECT_EQ(pool.available(), 0U);
  pool.release(chain);
  EXPECT_EQ(pool.available(), 3U);
  BlockChain again;
  for (int i = 0; i < 3; ++i) EXPECT_TRUE(pool.append(again, &block));
}

TEST(BlockPool, ReleasingAnEmptyChainDoesNothing) {
  BlockPool pool(1);
  pool.release(BlockChain{});
  EXPECT_EQ(pool.available(), 1U);
}

TEST(BlockPool, AnEmptyPoolIsRefused) { EXPECT_THROW(BlockPool(0), InvalidArgument); }

TEST(Cursor, ReadsAlongTheChainAndNeverPastItsEnd) {
  BlockPool pool(8);
  BlockChain other;
  BlockChain chain;
  std::vector<std::byte> expected;
  for (std::uint8_t i = 0; i < 3; ++i) {
    const Block block = filled(static_cast<std::uint8_t>(70 * i));
    pool.append(chain, &block);
    pool.append(other, &block);  // so that the blocks are no neighbours
    expected.insert(expected.end(), block.bytes.begin(), block.bytes.end());
  }
  std::mt19937_64 random(1);
  std::uniform_int_distribution<std::size_t> any(0, 70);
  for (int round = 0; round < 1000; ++round) {
    Cursor cursor(pool, chain.first, 48, 140);
    std::size_t at = 48;
    while (cursor.left() > 0) {
      const std::size_t bytes = any(random);
      std::vector<std::byte> read(bytes, std::byte{0xEE});
      const bool whole = cursor.read(read.data(), bytes);
      EXPECT_EQ(whole, at + bytes <= 48 + 140);
      for (std::size_t i = 0; i < bytes; ++i) {
        ASSERT_EQ(read[i], whole ? expected[at + i] : std::byte{0});
      }
      at += bytes;
    }
    EXPECT_EQ(cursor.left(), 0U);
    std::uint64_t past = 1;
    EXPECT_FALSE(cursor.read(&past, sizeof past));
    EXPECT_EQ(past, 0U);
  }
}

}  // namespace
}  // namespace o80
