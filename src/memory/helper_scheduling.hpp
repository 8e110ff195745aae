#pragma once

#include <pthread.h>
#include <sched.h>

#include <vector>

namespace o80 {

/// Processors and priority of the helper thread of a process.
///
/// The helper keeps off the loops' processors, where others remain. Beside real-time threads it
/// runs one priority above them, so that one that never sleeps cannot keep it from running: it
/// works for some 20 us every 20 ms. Without real-time threads it is an ordinary thread.
///
/// Writer:   the holder of fork_mutex().
/// Readers:  likewise.
/// Realtime: no.
class HelperScheduling {
 public:
  /// The processors that the calling thread may use.
  void start_from_caller() noexcept;
  void avoid(const std::vector<int>& processors) { avoided_ = processors; }
  /// Runs above this real-time priority, and above those named before; 0 is an ordinary thread.
  void run_above(int priority) noexcept;
  /// Returns 0, or why the priority was refused: the helper then runs at the next lower one that
  /// is granted.
  int apply(pthread_t helper) const noexcept;
  /// The same for a thread that ends at once: what a helper would be refused.
  int apply_to_trial() const;

 private:
  int apply_priority(pthread_t helper) const noexcept;
  void apply_processors(pthread_t helper) const noexcept;

  cpu_set_t allowed_{};
  std::vector<int> avoided_;
  int above_ = 0;
};

/// Of the calling thread; 0 if it is not a real-time thread.
int real_time_priority() noexcept;

}  // namespace o80
