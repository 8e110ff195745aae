#include "control/receiving/record_check.hpp"

#include <algorithm>
#include <cmath>

namespace o80 {
namespace {

bool sane_pace(const RecordHead& head) noexcept {
  switch (head.pace) {
    case Pace::fastest:
      return true;
    case Pace::speed:
      return std::isfinite(head.speed) && head.speed > 0.0;
    case Pace::until:
      return head.rows == 1 && head.amount <= kMaxIterations;
    case Pace::iterations:
      return head.amount >= 0 && head.amount <= kMaxIterations;
    default:
      return (head.pace == Pace::duration && head.rows > 1) ||
             (head.amount >= 0 && head.amount <= kLongestDuration);
  }
}

/// True if the profile fits the pace, and the other options too if that is `chunk`.
bool sane_profile(const RecordHead& head) noexcept {
  if (is_chunk(head)) {
    return head.kind == RecordKind::member &&
           (is_of_rows(head.profile) || head.profile == Profile::linear) &&
           head.mode == Mode::overwrite && head.start == Start::desired &&
           head.rows <= kMaxChunkRows;
  }
  if (is_of_rows(head.profile)) return head.pace == Pace::iterations || head.pace == Pace::duration;
  return head.profile != Profile::as_sent || (head.pace == Pace::direct && head.rows == 1);
}

}  // namespace

RecordCheck::RecordCheck(const Schema& schema, const Layouts& layouts) : targets_(schema, layouts) {
  for (const RequestRow& request : schema.requests) {
    requests_.push_back(request.type == kNoType ? nullptr : &*layouts[request.type]);
  }
  std::size_t size = 0;
  std::size_t words = 0;
  for (const auto& layout : layouts) {
    if (!layout) continue;
    size = std::max<std::size_t>(size, layout->size());
    words = std::max(words, layout->mask_words());
  }
  state_.resize((size + 7) / 8);
  mask_.resize(words);
}

RecordCheck::Verdict RecordCheck::begin(BlockPool& pool, BlockIndex block,
                                        Progress& progress) noexcept {
  const auto verdict = [](bool valid) { return valid ? Verdict::valid : Verdict::invalid; };
  const RecordHead& head = pool.head(block);
  progress = {Cursor(pool, block, sizeof(RecordHead), head.payload_bytes)};
  switch (head.kind) {
    case RecordKind::command:
    case RecordKind::member:
      return begin_command(head, progress);
    case RecordKind::group:
      return verdict(head.rows > 0 && head.rows <= targets_.actuators() &&
                     (is_chunk(head) ? head.payload_bytes == kChunkGroupBytes &&
                                           is_valid(chunk_of(pool, block))
                                     : head.payload_bytes == 0));
    case RecordKind::request:
      return verdict(is_request(head, progress.payload));
    case RecordKind::purge:
      return verdict(head.payload_bytes == 0 && head.only_own <= 1 &&
                     (head.actuator == kEveryActuator || head.actuator < targets_.actuators()));
    case RecordKind::take_control:
    case RecordKind::release_control:
    case RecordKind::close_plan:
      return verdict(head.payload_bytes == 0);
    case RecordKind::resume:
      return verdict(head.payload_bytes == 0 && head.accepts <= 1);
    case RecordKind::mark:
      return verdict(head.payload_bytes > 0 && head.payload_bytes <= kMaxMarkBytes);
    default:
      return Verdict::invalid;
  }
}

RecordCheck::Verdict RecordCheck::begin_command(const RecordHead& head,
                                                Progress& progress) noexcept {
  const bool of_chunk = is_chunk(head);
  const bool is_known = head.mode <= Mode::overwrite && head.pace <= Pace::chunk &&
                        head.profile <= Profile::smooth && head.start <= Start::observed &&
                        head.masked <= 1;
  if (head.actuator >= targets_.actuators() || head.rows == 0 || !is_known || !sane_pace(head) ||
      !sane_profile(head)) {
    return Verdict::invalid;
  }
  const StateLayout& layout = targets_.layout(head.actuator);
  const bool timed = head.pace == Pace::duration && head.rows > 1;
  const std::uint64_t mask_bytes = head.masked != 0 ? 8 * layout.mask_words() : 0;
  const std::uint64_t time_bytes = timed ? 8 * std::uint64_t{head.rows} : 0;
  const std::uint64_t row_bytes = std::uint64_t{head.rows} * layout.size();
  const std::uint64_t wanted = of_chunk
                                   ? ChunkPlaces(head.rows, layout, head.masked != 0).payload_bytes
                                   : mask_bytes + time_bytes + row_bytes;
  if (head.payload_bytes != wanted) return Verdict::invalid;

  // no bit of the mask is beyond the last number
  const std::uint64_t* mask = head.masked != 0 ? mask_.data() : nullptr;
  const std::size_t numbers = layout.numbers().size();
  if (mask != nullptr) {
    progress.payload.read(mask_.data(), mask_bytes);
    if (numbers % 64 != 0 && mask_[numbers / 64] >> (numbers % 64) != 0) return Verdict::invalid;
  }
  if (head.pace == Pace::fastest &&
      targets_.first_without_acceleration(head.actuator, mask) != StateLayout::kNoNumber) {
    return Verdict::invalid;
  }
  progress.times_left = timed ? head.rows : 0;
  progress.rows_left = head.rows;
  return Verdict::unfinished;
}

RecordCheck::Verdict RecordCheck::advance(BlockPool& pool, BlockIndex block, Progress& progress,
                                          std::uint32_t& budget) noexcept {
  const RecordHead& head = pool.head(block);
  const StateLayout& layout = targets_.layout(head.actuator);
  const std::uint64_t* mask = head.masked != 0 ? mask_.data() : nullptr;
  if (mask != nullptr) {
    Cursor(pool, block, sizeof(RecordHead), head.payload_bytes)
        .read(mask_.data(), 8 * layout.mask_words());
  }
  if (is_chunk(head)) return advance_chunk(pool, block, progress, budget, mask);
  // payload in the block of the head is free
  constexpr std::int64_t kWithHead = kBlockBytes - sizeof(RecordHead);
  auto bytes_left = static_cast<std::int64_t>(std::uint64_t{budget} * kBlockBytes) + kWithHead;

  // times must not decrease
  for (; progress.times_left > 0 && bytes_left > 0; --progress.times_left) {
    std::int64_t time = 0;
    progress.payload.read(&time, sizeof time);
    if (time < progress.time || time > kLongestDuration) return Verdict::invalid;
    progress.time = time;
    bytes_left -= sizeof time;
    progress.rows = progress.payload;
  }
  auto* state = reinterpret_cast<std::byte*>(state_.data());
  for (; progress.rows_left > 0 && bytes_left > 0; --progress.rows_left) {
    progress.payload.read(state, layout.size());
    // a target beyond the bounds would never be reached
    if (!targets_.admit(head.actuator, state, mask)) return Verdict::invalid;
    bytes_left -= layout.size();
  }
  budget = std::min(
      budget, static_cast<std::uint32_t>(std::max<std::int64_t>(bytes_left, 0) / kBlockBytes));
  return progress.rows_left > 0 ? Verdict::unfinished : Verdict::valid;
}

/// Walks to the rows, notes them, and joins the notes from the last one on.
RecordCheck::Verdict RecordCheck::advance_chunk(BlockPool& pool, BlockIndex block,
                                                Progress& progress, std::uint32_t& budget,
                                                const std::uint64_t* mask) noexcept {
  const RecordHead& head = pool.head(block);
  const StateLayout& layout = targets_.layout(head.actuator);
  ChunkRows rows(pool, block, layout);
  ChunkRows::Notes& notes = progress.notes;
  auto* state = reinterpret_cast<std::byte*>(state_.data());
  for (; !rows.is_walked(notes) && budget > 0; --budget) {
    if (!rows.walk(notes)) return Verdict::invalid;
    if (!rows.is_walked(notes)) continue;
    progress.payload =
        Cursor(pool, pool.next(notes.at), 0, std::uint64_t{head.rows} * layout.size());
  }
  const std::uint32_t ranges = rows.blocks_of_ranges();
  const std::uint32_t cost = layout.size() / static_cast<std::uint32_t>(kBlockBytes) + ranges;
  for (; rows.is_walked(notes) && progress.rows_left > 0 && budget > 0; --progress.rows_left) {
    const Cursor at = progress.payload;
    progress.payload.read(state, layout.size());
    if (!targets_.admit(head.actuator, state, mask)) return Verdict::invalid;
    rows.add(notes, at, state);
    budget -= std::min(budget, cost);
  }
  for (; progress.rows_left == 0 && notes.not_joined > 0 && budget > 0;) {
    rows.join(notes);
    budget -= std::min(budget, 2 * ranges);
  }
  return progress.rows_left > 0 || notes.not_joined > 0 ? Verdict::unfinished : Verdict::valid;
}

}  // namespace o80
