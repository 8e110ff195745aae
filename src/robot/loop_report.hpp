#pragma once

#include <atomic>
#include <cstdint>
#include <optional>
#include <string>
#include <thread>

#include "memory/halt_word.hpp"
#include "o80/describe/layout.hpp"
#include "runtime/loop_state.hpp"

namespace o80 {

/// Makes the report lines about late iterations, at a limited rate.
class OverrunReport {
 public:
  explicit OverrunReport(std::int64_t period) : period_(period) {}
  /// The newest row, now [ns] => a line if there are new late iterations.
  std::optional<std::string> look(const RowHead& row, std::int64_t now);

 private:
  std::int64_t period_;
  std::optional<RowHead> first_;  // of those that the next line is about
  std::int64_t said_at_ = 0;      // [ns], 0: nothing was said yet
};

/// Decides what a robot's process says about a loop that hangs, at a limited rate.
class HangReport {
 public:
  /// The loop, now [ns] => a line, if there is something to say.
  std::optional<std::string> look(const LoopState& loop, std::int64_t now);

 private:
  bool hangs_ = false;        // and that was said
  std::int64_t said_at_ = 0;  // [ns]
};

/// Reads the rows of a loop in this process, from a thread of its own, and says on the standard
/// error when iterations are late, when the loop hangs, and when the backend halts or resumes.
class LoopReport {
 public:
  explicit LoopReport(std::string segment);
  LoopReport(const LoopReport&) = delete;
  LoopReport& operator=(const LoopReport&) = delete;
  ~LoopReport();

 private:
  void run() noexcept;

  std::string segment_;
  std::atomic<std::uint32_t> stop_{0};
  std::thread thread_;
};

}  // namespace o80
