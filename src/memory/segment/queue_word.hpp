#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <optional>

#include "memory/segment/segment_layout.hpp"
#include "o80/base/time.hpp"

namespace o80 {

/// The lane for which batches of other lanes wait: its burst runs, or its batches take most of what
/// an iteration may do.
struct QueueHolder {
  std::uint32_t lane = 0;
  bool bursts = false;
  Iteration since = 0;  // since when batches have been waiting, or the burst has been running

  bool operator==(const QueueHolder&) const = default;
};

/// Finds the lane that takes most of the work while batches wait, and shows it in the segment.
///
/// Writer:   the backend's thread.
/// Realtime: yes; a store in the iterations in which the holder changes.
class QueueWord {
 public:
  explicit QueueWord(const SegmentView& view) noexcept : word_(&view.counters().queue) {}

  /// Counts the work of a lane's batches. By majority vote `lane_` is then the lane that did more
  /// than half of the work, if there is one.
  void spent(std::uint32_t lane, std::uint32_t work) noexcept {
    if (lane == lane_) {
      weight_ = std::min(weight_ + work, kMaxWeight);
    } else if (work > weight_) {
      weight_ = std::min(work - weight_, kMaxWeight);
      lane_ = lane;
    } else {
      weight_ -= work;
    }
  }
  /// Batches wait after this iteration.
  void waits(Iteration now) noexcept {
    if (weight_ > 0) show(lane_, false, now);  // else as before
  }
  /// The burst of a lane runs.
  void bursts(std::uint32_t lane, Iteration now) noexcept { show(lane, true, now); }
  void is_empty() noexcept {
    weight_ = 0;
    show_word(0);
  }

 private:
  static constexpr std::uint32_t kMaxWeight = 1U << 14;  // some iterations of work
  static constexpr std::uint64_t kBursts = 0x8000;
  static constexpr std::uint64_t kLane = 0x7fff;
  friend std::optional<QueueHolder> queue_holder(const SegmentView& view) noexcept;

  /// bits 0..14: lane + 1; 15: whether its burst runs; 16..63: since which iteration
  void show(std::uint32_t lane, bool is_burst, Iteration now) noexcept {
    const bool went_on = shown_ != 0 && ((shown_ & kBursts) != 0) == is_burst &&
                         (!is_burst || (shown_ & kLane) == lane + 1);
    const std::uint64_t since = went_on ? shown_ >> 16 : static_cast<std::uint64_t>(now);
    show_word(since << 16 | (is_burst ? kBursts : 0) | (lane + 1));
  }
  void show_word(std::uint64_t word) noexcept {
    if (word == shown_) return;
    shown_ = word;
    word_->store(word, std::memory_order_relaxed);
  }

  std::atomic<std::uint64_t>* word_;
  std::uint64_t shown_ = 0;
  std::uint32_t lane_ = 0;
  std::uint32_t weight_ = 0;
};

inline std::optional<QueueHolder> queue_holder(const SegmentView& view) noexcept {
  const std::uint64_t word = view.counters().queue.load(std::memory_order_relaxed);
  if ((word & QueueWord::kLane) == 0) return {};
  return QueueHolder{static_cast<std::uint32_t>(word & QueueWord::kLane) - 1,
                     (word & QueueWord::kBursts) != 0, static_cast<Iteration>(word >> 16)};
}

}  // namespace o80
