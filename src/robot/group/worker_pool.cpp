#include "robot/group/worker_pool.hpp"

#include <pthread.h>

#include <algorithm>
#include <string>
#include <system_error>
#include <utility>

#include "base/signals_blocked.hpp"
#include "memory/os/futex.hpp"
#include "memory/segment/signal.hpp"
#include "o80/base/error.hpp"

namespace o80 {

namespace {

/// A program that steps copies comes back soon: after judging them, in Python. A thread that sleeps
/// meanwhile takes 30 us to wake up, and finds its caches cold. [ns]
constexpr std::int64_t kSpin = 300'000;

}  // namespace

WorkerPool::WorkerPool(std::size_t workers) : shares_(workers + 1) {
  const SignalsBlocked blocked;
  threads_.reserve(workers);
  try {
    while (threads_.size() < workers) {
      threads_.emplace_back([this, own = threads_.size() + 1] { work(own); });
    }
  } catch (const std::system_error& error) {
    stop();
    throw Error("only " + std::to_string(threads_.size()) + " of " + std::to_string(workers) +
                " threads besides the caller's can be started (" + error.what() +
                "): use fewer threads, or raise their limit (`ulimit -u`)");
  }
}

WorkerPool::~WorkerPool() {
  if (guard_.forked()) {
    // the threads exist in the parent only: neither join nor end their handles
    // NOLINTNEXTLINE(bugprone-unhandled-exception-at-new)
    static_cast<void>(new std::vector<std::thread>(std::move(threads_)));
    return;
  }
  stop();
}

void WorkerPool::stop() noexcept {
  stop_.store(true, std::memory_order_relaxed);
  round_.fetch_add(1, std::memory_order_release);  // sync round
  futex_wake(round_, kEverybody);
  for (std::thread& thread : threads_) thread.join();
}

void WorkerPool::begin(std::uint32_t count, Call call, const void* object) noexcept {
  call_ = call;
  object_ = object;
  count_.store(count, std::memory_order_relaxed);
  done_.store(0, std::memory_order_relaxed);
  const std::uint32_t round = round_.load(std::memory_order_relaxed) + 1;
  std::uint64_t first = 0;
  for (std::size_t i = 0; i < shares_.size(); ++i) {
    // rounded up: the only task of a call is the caller's
    const std::uint64_t end =
        (std::uint64_t{count} * (i + 1) + shares_.size() - 1) / shares_.size();
    shares_[i].first.store(static_cast<std::uint32_t>(first), std::memory_order_relaxed);
    shares_[i].left.store(std::uint64_t{round} << 32 | (end - first),
                          std::memory_order_release);  // sync left
    first = end;
  }
  round_.store(round, std::memory_order_release);  // sync round
  // one task is for the caller
  if (count > 1 && !threads_.empty()) {
    const auto most = std::min<std::size_t>(count - 1, threads_.size());
    futex_wake(round_, static_cast<int>(most));
  }
}

/// Takes a task of this round, of the own share if there is one; false if there is none. A worker
/// that comes late finds 0 tasks left, or another round, and so cannot take a task of a later call:
/// round and number of tasks of a share change in one store.
bool WorkerPool::take(std::uint32_t round, std::size_t own, std::uint32_t& i) noexcept {
  for (std::size_t k = 0; k < shares_.size(); ++k) {
    Share& share = shares_[(own + k) % shares_.size()];
    std::uint64_t left = share.left.load(std::memory_order_acquire);  // sync left
    while (left >> 32 == round && static_cast<std::uint32_t>(left) > 0) {
      const std::uint32_t first = share.first.load(std::memory_order_relaxed);
      if (!share.left.compare_exchange_weak(left, left - 1, std::memory_order_acq_rel,
                                            std::memory_order_acquire)) {
        continue;
      }
      i = first + static_cast<std::uint32_t>(left) - 1;
      return true;
    }
  }
  return false;
}

bool WorkerPool::finished() noexcept {
  const std::uint32_t done = done_.fetch_add(1, std::memory_order_seq_cst) + 1;  // sync done
  // after the last task the caller may have begun the next call: then nobody waits for this one
  return done == count_.load(std::memory_order_relaxed);
}

/// True if all tasks have returned; false after about 50 ms.
bool WorkerPool::wait_for_workers(std::uint32_t count) noexcept {
  const auto all = [&] { return done_.load(std::memory_order_seq_cst) == count; };  // sync done
  if (caller_spin_.spin(all)) return true;
  waiting_.store(true, std::memory_order_seq_cst);  // sync waiting
  const std::uint32_t done = done_.load(std::memory_order_seq_cst);
  if (done != count) futex_wait(done_, done, kSlice);
  waiting_.store(false, std::memory_order_relaxed);
  return all();
}

void WorkerPool::work(std::size_t own) noexcept {
  // set from inside: set by another thread, the name would create an entry below /proc that the
  // kernel has to remove when the thread ends
  pthread_setname_np(pthread_self(), "o80-group");
  Spinner spin = Spinner::lasting(kSpin);
  std::uint32_t round = 0;
  while (true) {
    const auto called = [&] {
      return round_.load(std::memory_order_acquire) != round;  // sync round
    };
    if (!spin.spin(called)) {
      while (!called()) futex_wait(round_, round, 60'000'000'000);
    }
    if (stop_.load(std::memory_order_relaxed)) return;
    round = round_.load(std::memory_order_acquire);  // sync round
    std::uint32_t i = 0;
    while (take(round, own, i)) {
      call_(object_, i);
      const bool last = finished();
      if (last && waiting_.load(std::memory_order_seq_cst)) futex_wake(done_, 1);  // sync waiting
    }
  }
}

}  // namespace o80
