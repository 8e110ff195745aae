#pragma once

#include <cstdint>

#include "control/batch/record.hpp"

namespace o80 {

inline constexpr std::uint32_t kNobody = 0xFFFFFFFF;  // no lane

/// The burst that a bursting backend runs: its sender and the iterations left.
///
/// Realtime: yes.
class BurstGrant {
 public:
  /// Number of iterations for a burst that runs until every record of its batch has ended.
  static constexpr std::int64_t kUntilEnded = -1;

  bool runs() const noexcept { return left_ != 0; }
  /// The lane of the sender, or kNobody.
  std::uint32_t lane() const noexcept { return lane_; }
  std::uint64_t incarnation() const noexcept { return incarnation_; }
  CommandId batch() const noexcept { return batch_; }
  /// True for a burst without a sender, from begin_direct() to end().
  bool is_direct() const noexcept { return direct_; }
  bool runs_for(std::uint32_t lane) const noexcept { return runs() && lane_ == lane; }
  bool is_in_last_iteration() const noexcept { return left_ == 1; }
  /// True if this status is the end of the batch for which a kUntilEnded burst waits.
  bool ends_with(std::uint32_t lane, CommandId id) const noexcept {
    return left_ == kUntilEnded && lane == lane_ && id == batch_ + 1;
  }

  void begin(std::uint32_t lane, std::uint64_t incarnation, CommandId batch,
             std::int64_t iterations) noexcept {
    left_ = iterations;
    lane_ = lane;
    batch_ = batch;
    incarnation_ = incarnation;
  }
  void begin_direct(std::int64_t iterations) noexcept {
    begin(kNobody, 0, 0, iterations);
    direct_ = true;
  }
  /// Counts an iteration; true if it was the last one.
  bool count() noexcept {
    if (left_ <= 0) return false;
    --left_;
    return left_ == 0;
  }
  /// Makes the current iteration the last one.
  void shorten() noexcept { left_ = 1; }
  void end() noexcept {
    left_ = 0;
    lane_ = kNobody;
    direct_ = false;
  }

 private:
  std::int64_t left_ = 0;
  std::uint32_t lane_ = kNobody;
  CommandId batch_ = 0;
  std::uint64_t incarnation_ = 0;
  bool direct_ = false;
};

}  // namespace o80
