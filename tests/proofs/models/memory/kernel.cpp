// What the product calls and a model replaces: clock, kernel, files.

#include "kernel.hpp"

#include "memory/os/futex.hpp"
#include "o80/base/error.hpp"

// Relacy counts allocations: all of the program, its libraries included, go the same way
[[gnu::used]] static void* (*const allocate)(std::size_t) = &::operator new;
[[gnu::used]] static void (*const release)(void*) = &::operator delete;

namespace model {

Word& word_at(const void* address) { return Segment::current()->word(address); }
std::uint64_t load_word(Word& word, rl::memory_order order, rl::debug_info_param info) {
  return word.load(order, info);
}
void store_word(Word& word, std::uint64_t value, rl::memory_order order,
                rl::debug_info_param info) {
  word.store(value, order, info);
}

void pass(const char* label) {
  Segment& segment = *Segment::current();
  if (!segment.dies_at(label)) return;
  segment.die();
  throw Death();
}

}  // namespace model

namespace o80 {

// ------------------------------------------------------------------------------ the clock

std::int64_t monotonic_now() noexcept { return 0; }
Deadline::Deadline(Timeout) noexcept : end_(std::numeric_limits<std::int64_t>::max()) {}
bool Deadline::over() const noexcept { return false; }
std::int64_t Deadline::left(std::int64_t cap) const noexcept { return cap; }

// ------------------------------------------------------------------------------ the kernel

/// FUTEX_WAIT: a full barrier, then the comparison and falling asleep are one step. A signal may
/// end it.
bool futex_wait(const std::atomic<std::uint32_t>& word, std::uint32_t expected,
                std::int64_t) noexcept {
  auto& futex = const_cast<rl::atomic<std::uint32_t>&>(word);
  rl::context& context = rl::ctx();
  context.sched();
  context.atomic_thread_fence_seq_cst();
  std::uint32_t now = 0;
  {
    const rl::preemption_disabler together(context);
    now = futex.load(rl::mo_acquire, RL_INFO);
  }
  if (now != expected) return false;
  return futex.wait(context, false, true, RL_INFO) == rl::unpark_reason_normal;
}

/// FUTEX_WAKE: a full barrier, then some of the sleepers, any of them.
void futex_wake(const rl::atomic<std::uint32_t>& word, int count) noexcept {
  auto& futex = const_cast<rl::atomic<std::uint32_t>&>(word);
  rl::context& context = rl::ctx();
  context.sched();
  context.atomic_thread_fence_seq_cst();
  futex.wake(context, static_cast<rl::thread_id_t>(std::min(count, 64)), RL_INFO);
}

/// FUTEX_WAKE_OP: both in one system call.
void futex_wake_both(const rl::atomic<std::uint32_t>& first, int count,
                     rl::atomic<std::uint32_t>& second) noexcept {
  futex_wake(first, count);
  futex_wake(second, kEverybody);
}

bool is_byte_locked(int, std::uint64_t) noexcept { return true; }

std::string why_locks_are_refused() { return {}; }

LockFile LockFile::open(const std::string&, int, mode_t) {
  LockFile file;
  file.descriptor_ = 1;
  return file;
}
LockFile::LockFile(LockFile&& other) noexcept
    : descriptor_(std::exchange(other.descriptor_, -1)), guard_(other.guard_) {}
LockFile& LockFile::operator=(LockFile&& other) noexcept {
  close();
  descriptor_ = std::exchange(other.descriptor_, -1);
  return *this;
}
LockFile::~LockFile() { close(); }
bool LockFile::try_lock(std::uint64_t byte) noexcept {
  std::uint32_t free = 0;
  if (!model::Segment::current()->lock(byte).compare_exchange_strong(free, 1, rl::mo_seq_cst,
                                                                     RL_INFO))
    return false;
  descriptor_ = static_cast<int>(byte);
  return true;
}
void LockFile::close() noexcept {
  if (descriptor_ >= static_cast<int>(kFirstLaneByte))
    model::Segment::current()
        ->lock(static_cast<std::uint64_t>(descriptor_))
        .store(0, rl::mo_seq_cst, RL_INFO);
  descriptor_ = -1;
}

void Mapping::make_writable(std::byte*, int, std::uint64_t, std::size_t) {}
Mapping::~Mapping() = default;

// objects of a dead process do as those of a forked one: nothing
std::uint64_t process_generation() noexcept { return model::Segment::current()->died() ? 1 : 0; }
ForkGuard::ForkGuard() noexcept : generation_(0) {}
void ForkGuard::check(std::string_view) const {}

// ------------------------------------------------------------------------------ the segment

// names of users and owners are for messages
std::string user_name(uid_t) { return {}; }
void store_text(rl::atomic<std::uint64_t>*, std::size_t, std::string_view) noexcept {}
void load_text(const rl::atomic<std::uint64_t>*, std::size_t, char*) noexcept {}
std::string load_text(const rl::atomic<std::uint64_t>*, std::size_t) { return {}; }

AttachedSegment AttachedSegment::attach(std::string_view, Access access, const Deadline&,
                                        const AttachOptions&) {
  AttachedSegment segment;
  segment.access_ = access;
  segment.view_ = model::Segment::current()->view;
  return segment;
}
AttachedSegment::AttachedSegment(AttachedSegment&& other) noexcept
    : access_(other.access_), view_(other.view_) {}
bool AttachedSegment::has_ended() const noexcept {
  const auto state =
      static_cast<BackendState>(view_.counters().state.load(rl::mo_acquire, RL_INFO));
  return state != BackendState::starting && state != BackendState::running;
}
bool AttachedSegment::gone() const noexcept { return has_ended(); }
void AttachedSegment::throw_if_gone() const {
  if (has_ended()) throw BackendStopped("ended");
}
void AttachedSegment::check_process() const {}
LockFile AttachedSegment::open_commands_again() const { return LockFile::open("", 0); }

}  // namespace o80
