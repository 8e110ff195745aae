#pragma once

#include <atomic>
#include <cstdint>
#include <optional>
#include <string>
#include <thread>

#include "memory/halt_word.hpp"
#include "o80/describe/layout.hpp"

namespace o80 {

/// Makes the report lines about late iterations, at a limited rate.
class OverrunReport {
 public:
  /// The newest row, now [ns] => a line if there are new late iterations.
  std::optional<std::string> look(const RowHead& row, std::int64_t now);

 private:
  RowHead last_{};            // that was reported about
  std::int64_t said_at_ = 0;  // [ns], 0: nothing was said yet
};

/// Reads the rows of a loop in this process, from a thread of its own, and says on the standard
/// error when iterations are late and when the backend halts or resumes.
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
