#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <thread>
#include <vector>

#include "memory/os/fork.hpp"
#include "memory/os/spinner.hpp"

namespace o80 {

/// Threads that share the tasks of one call with the calling thread.
///
/// Between two calls the workers sleep on a futex (after a spin of at most 0.3 ms, because the
/// caller soon comes back). They block all signals, which belong to the threads of the program.
/// Each thread has a share of the tasks, the same one in every call of as many tasks, so that what
/// a task works on stays in the caches of one processor. A thread that is done takes tasks from the
/// shares of the others, so a slow task delays only its own thread.
///
/// Writer:   one thread at a time calls run().
/// Realtime: no; run() allocates nothing.
class WorkerPool {
 public:
  /// `workers`: threads besides the caller. Throws Error if so many cannot be started.
  explicit WorkerPool(std::size_t workers);
  WorkerPool& operator=(WorkerPool&&) = delete;
  /// In a forked child it leaves the threads of the parent alone.
  ~WorkerPool();

  std::size_t workers() const noexcept { return threads_.size(); }

  /// For owners that share the pool: true if the caller may call run() until release().
  bool try_claim() noexcept { return !claimed_.exchange(true, std::memory_order_acquire); }
  void release() noexcept { claimed_.store(false, std::memory_order_release); }

  /// Calls task(i) once for each i below `count`, in all threads; returns when all have returned.
  /// `poll` is called in the calling thread between its tasks, and about every 50 ms while
  /// it waits for the workers. Neither may throw. In a child that was forked inside one of them it
  /// returns at once, because the workers exist in the parent only.
  template <class Task, class Look>
  void run(std::uint32_t count, const Task& task, const Look& poll) noexcept {
    const auto call = [](const void* object, std::uint32_t i) {
      (*static_cast<const Task*>(object))(i);
    };
    begin(count, call, &task);
    std::uint32_t i = 0;
    while (!guard_.forked() && take(round_.load(std::memory_order_relaxed), 0, i)) {
      task(i);
      finished();
      poll();
    }
    while (!guard_.forked() && !wait_for_workers(count)) poll();
  }

 private:
  using Call = void (*)(const void* object, std::uint32_t i);

  void stop() noexcept;
  void begin(std::uint32_t count, Call call, const void* object) noexcept;
  bool take(std::uint32_t round, std::size_t own, std::uint32_t& i) noexcept;
  /// True if it was the last task of the call.
  bool finished() noexcept;
  bool wait_for_workers(std::uint32_t count) noexcept;
  void work(std::size_t own) noexcept;

  /// Tasks of one thread.
  struct alignas(64) Share {
    std::atomic<std::uint64_t> left{0};   // the round << 32 | tasks that nobody has taken
    std::atomic<std::uint32_t> first{0};  // task of the round
  };

  // written by the caller before the shares change; a worker reads call_ and object_ only after it
  // has taken a task, and the call cannot end before that task
  Call call_ = nullptr;
  const void* object_ = nullptr;
  std::atomic<std::uint32_t> count_{0};
  alignas(64) std::atomic<std::uint32_t> round_{0};  // futex of the workers; number of the call
  std::atomic<bool> stop_{false};
  std::atomic<bool> claimed_{false};
  std::vector<Share> shares_;                       // that of the caller, then those of the workers
  alignas(64) std::atomic<std::uint32_t> done_{0};  // futex of the caller; tasks that have returned
  std::atomic<bool> waiting_{false};                // the caller sleeps on done_
  Spinner caller_spin_;
  std::vector<std::thread> threads_;
  ForkGuard guard_;
};

}  // namespace o80
