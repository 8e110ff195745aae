#include "memory/ring/history.hpp"

#include <gmock/gmock.h>

#include <atomic>
#include <cstring>
#include <limits>
#include <thread>

#include "memory/segments.hpp"

namespace o80 {
namespace {

using ::testing::Each;

constexpr std::size_t kWords = 32;
using Row = std::array<std::int64_t, kWords>;

Row row_of(Iteration k) {
  Row row;
  row.fill(k);
  return row;
}

const std::byte* bytes(const Row& row) { return reinterpret_cast<const std::byte*>(row.data()); }
std::byte* bytes(Row& row) { return reinterpret_cast<std::byte*>(row.data()); }

SegmentSpec spec_of(std::uint64_t rows) {
  SegmentSpec spec = small_spec();
  spec.row_bytes = sizeof(Row);
  spec.rows = rows;
  return spec;
}

class HistoryTest : public SegmentTest {
 protected:
  void publish(Iteration from, Iteration to) {
    for (Iteration k = from; k <= to; ++k) writer_.publish(k, bytes(row_of(k)));
  }

  OwnedSegment segment_ = running_segment(spec_of(10));
  HistoryWriter writer_{segment_.view()};
  AttachedSegment attached_ = attach("arm", Access::read_only);
  HistoryReader reader_{attached_.view()};
};

TEST_F(HistoryTest, IsEmptyBeforeItsFirstRow) {
  Row row;
  EXPECT_EQ(reader_.published(), -1);
  EXPECT_EQ(reader_.oldest(), 0);
  EXPECT_EQ(reader_.latest(bytes(row)), -1);
  EXPECT_FALSE(reader_.read(0, bytes(row)));
  EXPECT_EQ(reader_.read_range(0, 10, bytes(row)).count, 0U);
}

// rule O3
TEST_F(HistoryTest, KeepsExactlyTheRowsPromised) {
  for (Iteration k = 0; k < 35; ++k) {
    publish(k, k);
    EXPECT_EQ(reader_.published(), k);
    EXPECT_EQ(reader_.oldest(), std::max<Iteration>(0, k - 9));
    Row row;
    for (Iteration i = reader_.oldest(); i <= k; ++i) {
      ASSERT_TRUE(reader_.read(i, bytes(row)));
      EXPECT_THAT(row, Each(i));
    }
    EXPECT_FALSE(reader_.read(reader_.oldest() - 1, bytes(row)));
    EXPECT_FALSE(reader_.read(k + 1, bytes(row)));
    EXPECT_EQ(reader_.latest(bytes(row)), k);
    EXPECT_THAT(row, Each(k));
  }
}

TEST_F(HistoryTest, ReadsPartsOfRowsAtAnyPlace) {
  constexpr std::size_t kPacked = 48;
  using Packed = std::array<std::byte, kPacked>;
  constexpr std::array<HistoryReader::Part, 6> kParts = {
      {{0, 1, 3}, {5, 2, 0}, {14, 12, 4}, {32, 16, 16}, {252, 4, 32}, {8, 8, 40}}};
  std::vector<Row> rows(17);
  for (std::size_t k = 0; k < rows.size(); ++k) {
    for (std::size_t i = 0; i < kWords; ++i) {
      rows[k][i] = static_cast<std::int64_t>((k + 1) * (i + 1) * 0x9E3779B97F4A7C15U);
    }
    writer_.publish(static_cast<Iteration>(k), bytes(rows[k]));
  }
  std::vector<Packed> found(20);

  const auto range = reader_.read_parts(0, found.size(), kParts, kPacked, found[0].data());

  EXPECT_EQ(range.first, 7);
  ASSERT_EQ(range.count, 10U) << "across the seam of the ring";
  for (std::size_t i = 0; i < range.count; ++i) {
    for (const HistoryReader::Part& part : kParts) {
      const std::byte* of_row = bytes(rows[7 + i]) + part.begin;
      EXPECT_EQ(std::memcmp(found[i].data() + part.to, of_row, part.size), 0) << part.begin;
    }
  }
}

TEST_F(HistoryTest, GivesWhatThereIsOfARangeThatIsNot) {
  publish(0, 16);
  std::vector<Row> rows(11);
  const auto read = [&](Iteration first, std::size_t count) {
    const auto range = reader_.read_range(first, count, bytes(rows[0]));
    for (std::size_t i = 0; i < range.count; ++i)
      EXPECT_THAT(rows[i], Each(range.first + static_cast<Iteration>(i)));
    return std::pair(range.count == 0 ? -1 : range.first, range.count);
  };

  EXPECT_EQ(read(0, 10), std::pair(Iteration{7}, std::size_t{3}));
  EXPECT_EQ(read(-5, 15), std::pair(Iteration{7}, std::size_t{3}));
  EXPECT_EQ(read(15, std::numeric_limits<std::size_t>::max()),
            std::pair(Iteration{15}, std::size_t{2}));
  EXPECT_EQ(
      read(std::numeric_limits<Iteration>::min() + 1, std::numeric_limits<std::size_t>::max()),
      std::pair(Iteration{7}, std::size_t{10}));
  EXPECT_EQ(read(17, 5), std::pair(Iteration{-1}, std::size_t{0}));
  EXPECT_EQ(read(0, 7), std::pair(Iteration{-1}, std::size_t{0}));
  EXPECT_EQ(read(-5, 5), std::pair(Iteration{-1}, std::size_t{0}));
  EXPECT_EQ(read(9, 0), std::pair(Iteration{-1}, std::size_t{0}));
}

TEST_F(HistoryTest, OutlivesItsBackend) {
  publish(0, 12);
  segment_.end(BackendState::failed);
  {
    const OwnedSegment gone = std::move(segment_);
  }
  const OwnedSegment next = running_segment(spec_of(3));
  Row row;

  ASSERT_TRUE(reader_.read(5, bytes(row)));
  EXPECT_THAT(row, Each(5));
}

TEST_F(HistoryTest, RowsBeforeAGapAreNotRead) {
  publish(0, 14);
  writer_.skip_to(18);
  Row row;
  EXPECT_FALSE(reader_.is_damaged()) << "also if the writer is killed here";
  EXPECT_EQ(reader_.latest(bytes(row)), 14);
  publish(18, 20);

  EXPECT_EQ(reader_.oldest(), 18);
  for (Iteration k = 0; k < 18; ++k) EXPECT_FALSE(reader_.read(k, bytes(row))) << k;
  std::array<Row, 12> rows;
  const auto range = reader_.read_range(10, 12, bytes(rows[0]));
  EXPECT_EQ(range.first, 18);
  ASSERT_EQ(range.count, 3U);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(rows[i], row_of(18 + static_cast<Iteration>(i)));
  publish(21, 40);
  EXPECT_EQ(reader_.oldest(), 31) << "the gap is behind";
}

// rule O3
TEST_F(HistoryTest, IsNeverTornWhenReadersAreOvertaken) {
  constexpr Iteration kLast = 30'000;
  std::atomic<bool> torn{false};
  std::atomic<int> reading{0};
  const auto whole = [](const Row& row, Iteration k) { return row == row_of(k); };
  constexpr std::array<HistoryReader::Part, 2> ends = {{{0, 8, 0}, {sizeof(Row) - 8, 8, 8}}};
  const auto read_everything = [&] {
    std::vector<Row> rows(12);
    ++reading;
    while (reader_.published() < kLast) {
      const Iteration latest = reader_.latest(bytes(rows[0]));
      if (latest >= 0 && !whole(rows[0], latest)) torn = true;
      // the oldest is the first to be overwritten
      const Iteration oldest = reader_.oldest();
      if (reader_.read(oldest, bytes(rows[0])) && !whole(rows[0], oldest)) torn = true;
      const auto range = reader_.read_range(oldest, rows.size(), bytes(rows[0]));
      for (std::size_t i = 0; i < range.count; ++i)
        if (!whole(rows[i], range.first + static_cast<Iteration>(i))) torn = true;
      const auto some = reader_.read_parts(oldest, rows.size(), ends, 16, bytes(rows[0]));
      const std::int64_t* const packed = rows[0].data();
      for (std::size_t i = 0; i < 2 * some.count; ++i)
        if (packed[i] != some.first + static_cast<Iteration>(i / 2)) torn = true;
    }
  };
  std::vector<std::thread> readers;
  readers.reserve(3);
  for (int i = 0; i < 3; ++i) readers.emplace_back(read_everything);
  while (reading < 3) std::this_thread::yield();
  publish(0, kLast);
  for (std::thread& reader : readers) reader.join();

  EXPECT_FALSE(torn);
}

}  // namespace
}  // namespace o80
