#pragma once

#include <pthread.h>
#include <sched.h>

#include <vector>

namespace o80 {

/// Processors and priority of the helper thread of a process.
///
/// The helper does not run on the loops' processors if others remain. With real-time threads in the
/// process, it runs one priority above them (about 20 us every 20 ms), so that a real-time thread
/// that never sleeps cannot block it. Without real-time threads it is an ordinary thread.
///
/// Writer:   the holder of fork_mutex().
/// Readers:  the holder of fork_mutex().
/// Realtime: no.
class HelperScheduling {
 public:
  /// Uses the processors of the calling thread.
  void start_from_caller() noexcept;
  void avoid(const std::vector<int>& processors) { avoided_ = processors; }
  /// Runs above this real-time priority and above those of earlier calls; 0: an ordinary thread.
  void run_above(int priority) noexcept;
  /// Returns 0, or the error number with which the priority was refused: the helper then has the
  /// next lower priority that is granted.
  int apply(pthread_t helper) const noexcept;
  /// The same for a temporary thread, to find out in advance whether the priority is granted.
  int apply_to_trial() const;

 private:
  int apply_priority(pthread_t helper) const noexcept;
  void apply_processors(pthread_t helper) const noexcept;

  cpu_set_t allowed_{};
  std::vector<int> avoided_;
  int above_ = 0;
};

/// Real-time priority of the calling thread; 0 for an ordinary thread.
int real_time_priority() noexcept;

}  // namespace o80
