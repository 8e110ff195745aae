#include "memory/segment/segment_layout.hpp"

#include <bit>

namespace o80 {

namespace {
constexpr std::uint64_t kLargestSegment = 1ULL << 46;
constexpr std::uint64_t kLargestProvenance = 1ULL << 24;
}  // namespace

bool SegmentOffsets::compute(const SegmentShape& shape, SegmentOffsets& offsets) noexcept {
  const std::uint64_t page = shape.page_bytes;
  if (page < 4096 || page > (1U << 20) || !std::has_single_bit(page)) return false;
  if (shape.schema_bytes > (1ULL << 32)) return false;
  if (shape.provenance_bytes > kLargestProvenance) return false;
  if (shape.row_bytes == 0 || shape.row_bytes % 8 != 0 || shape.row_bytes > (1ULL << 32))
    return false;
  if (shape.slots < 2 || shape.slots > kLargestSegment / shape.row_bytes) return false;
  if (shape.lanes > kMaxLanes) return false;
  if (!std::has_single_bit(shape.lane_blocks) || shape.lane_blocks > (1U << 24)) return false;
  if (shape.journal_bytes != 0 &&
      (!std::has_single_bit(shape.journal_bytes) || shape.journal_bytes < kMinJournal ||
       shape.journal_bytes > (1ULL << 40)))
    return false;

  const auto pages = [page](std::uint64_t bytes) { return (bytes + page - 1) / page * page; };
  const std::uint64_t blocks = shape.lane_blocks;
  offsets.schema = pages(sizeof(SegmentHeader));
  offsets.provenance = offsets.schema + pages(shape.schema_bytes);
  offsets.counters = offsets.provenance + pages(shape.provenance_bytes);
  offsets.history = offsets.counters + pages(sizeof(Counters));
  offsets.journal = offsets.history + pages(shape.slots * shape.row_bytes);
  offsets.file_bytes = offsets.journal + pages(shape.journal_bytes);

  offsets.wakes = pages(sizeof(CommandsHeader));
  offsets.bell = offsets.wakes + pages(sizeof(Wakes));
  offsets.lanes = offsets.bell + pages(sizeof(Bell));
  offsets.transport = pages(sizeof(LaneSenderPage));
  offsets.lane_stride = offsets.transport + pages(blocks * kBlockSize);
  offsets.feedback = offsets.lanes + shape.lanes * offsets.lane_stride;
  offsets.statuses = pages(sizeof(LaneFeedback));
  offsets.feedback_stride = offsets.statuses + pages(2 * blocks * sizeof(StatusSlot));
  offsets.commands_bytes = offsets.feedback + shape.lanes * offsets.feedback_stride;
  return true;
}

}  // namespace o80
