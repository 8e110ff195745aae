#include "memory/segment/liveness.hpp"

#include <pthread.h>
#include <signal.h>

#include <algorithm>
#include <atomic>
#include <deque>
#include <mutex>
#include <string>
#include <system_error>
#include <thread>
#include <utility>

#include "memory/os/futex.hpp"
#include "memory/os/helper_scheduling.hpp"
#include "memory/segment/verb_word.hpp"
#include "o80/base/error.hpp"
#include "o80/base/time.hpp"

namespace o80 {

namespace {

constexpr std::int64_t kPeriod = 20'000'000;  // [ns]
constexpr std::uint32_t kRoundsPerNames = 5;  // rounds from one check of the names to the next

constexpr std::uint64_t pack(LaneLife life) noexcept {
  return life.incarnation << 2 | static_cast<std::uint64_t>(life.state);
}

constexpr LaneLife unpack(std::uint64_t word) noexcept {
  return {.state = static_cast<LaneState>(word & 3), .incarnation = word >> 2};
}

}  // namespace

/// Writer:   the holder of fork_mutex().
/// Readers:  the backend's thread.
/// Realtime: reading the atomic words.
struct LaneLiveness::Watched {
  explicit Watched(const OwnedSegment& segment)
      : descriptor(segment.commands_descriptor()),
        names(segment.names()),
        socket(segment.socket().descriptor()),
        view(segment.view()) {
    for (std::uint32_t i = 0; i < view.shape.lanes; ++i) lanes.emplace_back(0);
  }

  void ask() noexcept {
    bool changed = false;
    for (std::uint32_t i = 0; i < view.shape.lanes; ++i) {
      const std::uint64_t before = lanes[i].load(std::memory_order_relaxed);
      const std::uint64_t now = pack(ask_lane(i, unpack(before)));
      if (now == before) continue;
      lanes[i].store(now, std::memory_order_relaxed);
      changed = true;
    }
    if (changed) changes.fetch_add(1, std::memory_order_release);  // sync changes
    note_slow_verb(view, monotonic_now());
    if (rounds.load(std::memory_order_relaxed) % kRoundsPerNames == 0) check_names();
    rounds.fetch_add(1, std::memory_order_relaxed);
  }

  void check_names() noexcept {
    if (socket) NameSocket::drain(*socket);
    if (nameless.load(std::memory_order_relaxed) || !names.are_replaced()) return;
    // read after the names: a backend stores its end before it removes its files
    const auto state = static_cast<BackendState>(
        view.counters().state.load(std::memory_order_acquire));  // sync state
    if (state == BackendState::starting || state == BackendState::running)
      nameless.store(true, std::memory_order_relaxed);
  }

  std::uint64_t owner_of(std::uint32_t i) const noexcept {
    const std::uint64_t met =
        view.feedback(i).incarnation.load(std::memory_order_acquire);  // sync met
    const std::uint64_t written =
        view.lane(i).incarnation.load(std::memory_order_acquire);  // sync incarnation
    return possible_incarnation(written, met);
  }

  LaneLife ask_lane(std::uint32_t i, LaneLife last) noexcept {
    // an owner stores its incarnation after it has the lock: if the lock is free below, this owner
    // has ended
    const std::uint64_t before = owner_of(i);
    // no query for a lane that had no owner, or no new one since the last end
    if (last.state != LaneState::alive && before == last.incarnation) return last;
    queries.fetch_add(1, std::memory_order_relaxed);
    if (!is_byte_locked(descriptor, kFirstLaneByte + i)) {
      const bool in_order =
          view.lane(i).closed.load(std::memory_order_acquire) == before;  // sync closed
      return {in_order ? LaneState::closed : LaneState::died, before};
    }
    return {LaneState::alive, owner_of(i)};
  }

  int descriptor;
  FileNames names;
  std::shared_ptr<const std::atomic<int>> socket;  // null: an anonymous segment
  SegmentView view;
  std::deque<std::atomic<std::uint64_t>> lanes;
  std::atomic<std::uint32_t> changes{0};
  std::atomic<std::uint32_t> rounds{0};
  std::atomic<std::uint64_t> queries{0};
  std::atomic<bool> nameless{false};
};

/// The helper of a process; everything in it is guarded by fork_mutex().
class LivenessThread {
 public:
  static void add(LaneLiveness::Watched* watched) {
    const std::lock_guard lock(fork_mutex());
    Registry& all = registry();
    watched->ask();
    all.scheduling.run_above(real_time_priority());
    if (all.helper == nullptr) all.helper = new LivenessThread(all.scheduling);
    all.scheduling.apply(all.helper->thread_.native_handle());
    all.watched.push_back(watched);
  }

  static void remove(LaneLiveness::Watched* watched) noexcept {
    LivenessThread* idle = nullptr;
    {
      const std::lock_guard lock(fork_mutex());
      Registry& all = registry();
      if (std::erase(all.watched, watched) > 0 && all.watched.empty())
        idle = std::exchange(all.helper, nullptr);
    }
    delete idle;
  }

  static void avoid(const std::vector<int>& processors) {
    const std::lock_guard lock(fork_mutex());
    registry().scheduling.avoid(processors);
    reschedule();
  }

  static int run_above(int priority) {
    const std::lock_guard lock(fork_mutex());
    registry().scheduling.run_above(priority);
    return reschedule();
  }

 private:
  struct Registry {
    std::vector<LaneLiveness::Watched*> watched;
    HelperScheduling scheduling;
    LivenessThread* helper = nullptr;
    ForkGuard guard;
  };

  static Registry& registry() {
    static auto* all = new Registry;
    // threads do not survive a fork: leave the handle of the helper behind
    if (all->guard.forked()) *all = Registry{};
    return *all;
  }

  /// Returns 0, or the error number of a refused priority; without a helper, of a trial thread.
  static int reschedule() {
    const Registry& all = registry();
    if (all.helper == nullptr) return all.scheduling.apply_to_trial();
    return all.scheduling.apply(all.helper->thread_.native_handle());
  }

  explicit LivenessThread(HelperScheduling& scheduling) {
    scheduling.start_from_caller();
    // block all signals: they belong to the threads of the program
    sigset_t every, before;
    sigfillset(&every);
    pthread_sigmask(SIG_BLOCK, &every, &before);
    std::string refused;
    try {
      thread_ = std::thread([this] { run(); });
    } catch (const std::system_error& error) {
      refused = error.what();
    }
    pthread_sigmask(SIG_SETMASK, &before, nullptr);
    if (!refused.empty())
      throw Error("the helper thread that notices dead frontends cannot be started (" + refused +
                  "): raise the limit of threads (`ulimit -u`), or allow clone in the profile of "
                  "this container");
  }

  ~LivenessThread() {
    stop_.store(1, std::memory_order_seq_cst);
    futex_wake(stop_, kEverybody);
    thread_.join();
  }

  void run() noexcept {
    // set from inside: set by another thread, the name would create an entry below /proc that the
    // kernel has to remove when the thread ends
    pthread_setname_np(pthread_self(), "o80-liveness");
    while (stop_.load(std::memory_order_acquire) == 0) {
      {
        const std::lock_guard lock(fork_mutex());
        for (LaneLiveness::Watched* watched : registry().watched) watched->ask();
      }
      futex_wait(stop_, 0, kPeriod);
    }
  }

  std::atomic<std::uint32_t> stop_{0};
  std::thread thread_;
};

LaneLiveness::LaneLiveness(const OwnedSegment& segment)
    : watched_(std::make_unique<Watched>(segment)) {
  LivenessThread::add(watched_.get());
}

LaneLiveness::~LaneLiveness() { LivenessThread::remove(watched_.get()); }

std::uint32_t LaneLiveness::changes() const noexcept {
  return watched_->changes.load(std::memory_order_acquire);  // sync changes
}

std::uint32_t LaneLiveness::rounds() const noexcept {
  return watched_->rounds.load(std::memory_order_relaxed);
}

std::uint64_t LaneLiveness::queries() const noexcept {
  return watched_->queries.load(std::memory_order_relaxed);
}

LaneLife LaneLiveness::lane(std::uint32_t i) const noexcept {
  return unpack(watched_->lanes[i].load(std::memory_order_relaxed));
}

bool LaneLiveness::nameless() const noexcept {
  return watched_->nameless.load(std::memory_order_relaxed);
}

void LaneLiveness::refresh() noexcept {
  const std::lock_guard lock(fork_mutex());
  watched_->ask();
}

void LaneLiveness::avoid_processors(const std::vector<int>& processors) {
  LivenessThread::avoid(processors);
}

int LaneLiveness::run_above(int priority) { return LivenessThread::run_above(priority); }

}  // namespace o80
