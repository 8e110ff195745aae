#pragma once

// What every actor does: draw by chance, measure its calls, report what is wrong.

#include <cstdarg>
#include <cstdint>
#include <exception>
#include <optional>
#include <random>
#include <string>

#include "o80/base/error.hpp"
#include "o80/base/time.hpp"
#include "o80/runtime/frontend.hpp"
#include "torture/board.hpp"

namespace torture {

inline constexpr std::int64_t kMillisecond = 1'000'000;
inline constexpr std::int64_t kGrace = 200 * kMillisecond;  // beyond a timeout

class Chance {
 public:
  explicit Chance(std::uint64_t seed) : engine_(seed) {}
  std::uint64_t bits() { return engine_(); }
  /// From 0 to n - 1.
  std::uint64_t below(std::uint64_t n) { return engine_() % n; }
  std::int64_t between(std::int64_t low, std::int64_t high) {
    return low + static_cast<std::int64_t>(below(static_cast<std::uint64_t>(high - low + 1)));
  }
  bool percent(std::uint64_t p) { return below(100) < p; }

 private:
  std::mt19937_64 engine_;
};

/// A promise was broken; the process ends.
struct Broken {};
/// The process is the child of an actor, and is to live on without it.
struct Orphan {};

/// [ns] that the machine wanted a processor and its host gave it none, so far; the sum over all.
std::int64_t stolen_time();

class Actor {
 public:
  Actor(Round& the_round, Slot& the_slot, std::string directory);

  Phase phase() const { return static_cast<Phase>(round.phase.load()); }
  bool acting() const { return phase() == Phase::act; }
  std::uint32_t number() const { return static_cast<std::uint32_t>(&slot - round.slots.data()); }

  /// Says what was promised and not kept, and ends this process.
  [[noreturn, gnu::format(printf, 3, 4)]] void fail(Fault fault, const char* format, ...);

  /// Runs a call that may block, and judges how long it took.
  ///
  /// Counted is the time for which the process could run: neither what it was stopped for, nor what
  /// it waited for a processor (/proc/thread-self/schedstat), which is the machine's affair.
  template <class Call>
  auto timed(const char* what, o80::Timeout timeout, Call&& call) {
    const Measured measured(*this, what, timeout);
    return call();
  }
  std::chrono::nanoseconds some_timeout() {
    return std::chrono::milliseconds(chance.between(1, 250));
  }
  void pause(std::int64_t nanoseconds);

  /// A backend is gone, says an error: is that so, and was it noticed in time?
  void judge_gone(Generation& life, const o80::BackendGone& error, std::int64_t call_began);
  /// A wait timed out: has it overlooked a death?
  void judge_timeout(Generation& life, std::int64_t call_began, std::int64_t stopped_before);
  bool a_successor_was_stopped() const;
  /// The segment's robot, if it comes within some timeout.
  std::optional<o80::UntypedFrontend> attach(std::uint32_t segment,
                                             o80::Access access = o80::Access::read_write);
  /// Whether any that sends commands was killed.
  bool any_sender_doomed() const;
  Generation& life_of(const o80::UntypedFrontend& frontend);
  /// Null if no backend came so far as to note that epoch.
  Generation* life_of(std::uint64_t epoch);
  /// Time [ns] for which this process was stopped so far.
  std::int64_t stopped() const { return slot.stopped_for(o80::monotonic_now()); }

  /// Forks: the child throws Orphan after `misuse`, which tries what a child may not do.
  template <class Misuse>
  void leave_an_orphan(Misuse&& misuse) {
    slot.orphans.fetch_add(1);
    if (!forked()) return;
    misuse();
    throw Orphan{};
  }

  Round& round;
  Slot& slot;
  Chance chance;
  const std::string directory;

 private:
  class Measured {
   public:
    Measured(Actor& actor, const char* what, o80::Timeout timeout);
    Measured& operator=(Measured&&) = delete;
    ~Measured() noexcept(false);

   private:
    Actor& actor_;
    const char* what_;
    std::int64_t timeout_;
    std::int64_t began_;
    std::int64_t stopped_;
    std::int64_t starved_;
    std::int64_t stolen_;
    int exceptions_;
  };

  std::int64_t stopped_at_call_ = 0;

  bool forked() const;
  std::int64_t starved() const;

  int schedule_;
};

/// Whether the lanes were full, or somebody has control: nothing was sent, and that passes.
bool is_refusal(const o80::Error& error);

/// The name of a segment in the directory of a round.
inline std::string segment_name(std::uint32_t segment) { return "robot" + std::to_string(segment); }

/// Of the segment that bears the name, 0 if there is none.
std::uint64_t epoch_of(const std::string& segment);

void be_a_backend(Actor& actor, bool bursting);
void be_a_usurper(Actor& actor);
void be_a_commander(Actor& actor);
void be_a_burster(Actor& actor);
void be_a_group_burster(Actor& actor);
void be_a_halter(Actor& actor);
void be_a_reader(Actor& actor);
void be_an_auditor(Actor& actor, std::uint32_t segments);

}  // namespace torture
