#pragma once

#include <atomic>
#include <cstdint>
#include <optional>
#include <string>
#include <thread>

#include "memory/segment/halt_word.hpp"
#include "o80/describe/layout.hpp"
#include "runtime/frontend/loop_state.hpp"

namespace o80 {

/// Makes the report lines about late iterations, at a limited rate.
class OverrunReport {
 public:
  explicit OverrunReport(std::int64_t period) : period_(period) {}
  /// The newest row, now [ns] => a line if there are new late iterations.
  std::optional<std::string> poll(const RowHead& row, std::int64_t now);

 private:
  std::int64_t period_;
  std::optional<RowHead> first_;  // first row of the next report
  std::int64_t said_at_ = 0;      // time of the last report [ns]; 0: none yet
};

/// Makes the report lines about a loop that hangs, at a limited rate.
class HangReport {
 public:
  /// The loop, now [ns] => a line if the loop has begun or ceased to hang.
  std::optional<std::string> poll(const LoopState& loop, std::int64_t now);

 private:
  bool hangs_ = false;        // and that was reported
  std::int64_t said_at_ = 0;  // time of the last report [ns]
};

/// Reads the rows of a loop in this process, in a thread of its own, and reports on the standard
/// error late iterations, a loop that hangs, halts and resumes, and the first starved plan.
class LoopReport {
 public:
  explicit LoopReport(std::string segment);
  LoopReport& operator=(LoopReport&&) = delete;
  ~LoopReport();

 private:
  void run() noexcept;

  std::string segment_;
  std::atomic<std::uint32_t> stop_{0};
  std::thread thread_;
};

}  // namespace o80
