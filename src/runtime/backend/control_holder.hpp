#pragma once

#include <cstdint>

#include "runtime/backend/burst_grant.hpp"

namespace o80 {

/// The lane and owner with exclusive control, if any.
///
/// Realtime: yes.
class ControlHolder {
 public:
  bool is_nobody() const noexcept { return lane_ == kNobody; }
  /// The lane with control, or kNobody.
  std::uint32_t lane() const noexcept { return lane_; }
  std::uint64_t incarnation() const noexcept { return incarnation_; }
  bool is(std::uint32_t lane, std::uint64_t incarnation) const noexcept {
    return lane_ == lane && incarnation_ == incarnation;
  }

  void take(std::uint32_t lane, std::uint64_t incarnation) noexcept {
    lane_ = lane;
    incarnation_ = incarnation;
  }
  void release() noexcept { lane_ = kNobody; }

 private:
  std::uint32_t lane_ = kNobody;
  std::uint64_t incarnation_ = 0;
};

}  // namespace o80
