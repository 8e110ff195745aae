#include "torture/actor.hpp"

#include <fcntl.h>
#include <sys/prctl.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <fstream>
#include <string>
#include <string_view>

#include "base/crash_point.hpp"
#include "memory/segment/segment_layout.hpp"
#include "memory/segment/segment_name.hpp"

namespace torture {

Actor::Actor(Round& the_round, Slot& the_slot, std::string the_directory)
    : round(the_round),
      slot(the_slot),
      chance(the_slot.seed),
      directory(std::move(the_directory)),
      schedule_(open("/proc/thread-self/schedstat", O_RDONLY | O_CLOEXEC)) {}

void Actor::fail(Fault fault, const char* format, ...) {
  std::uint32_t none = 0;
  if (slot.fault.compare_exchange_strong(none, static_cast<std::uint32_t>(fault))) {
    va_list arguments;
    va_start(arguments, format);
    std::vsnprintf(slot.fault_text, sizeof slot.fault_text, format, arguments);
    va_end(arguments);
  }
  throw Broken{};
}

void Actor::pause(std::int64_t nanoseconds) {
  const timespec time{.tv_sec = nanoseconds / 1'000'000'000,
                      .tv_nsec = nanoseconds % 1'000'000'000};
  nanosleep(&time, nullptr);
}

// ------------------------------------------------------------------------------ calls that block

std::int64_t Actor::starved() const {
  char text[64] = "";
  if (pread(schedule_, text, sizeof text - 1, 0) <= 0) return 0;
  long long ran = 0;
  long long waited = 0;
  return std::sscanf(text, "%lld %lld", &ran, &waited) == 2 ? waited : 0;
}

std::int64_t stolen_time() {
  std::ifstream machine("/proc/stat");
  std::string word;
  std::int64_t ticks = 0;
  for (int column = 0; column <= 8 && machine >> word; ++column)
    if (column == 8) ticks = std::atoll(word.c_str());
  return ticks * (1'000'000'000 / sysconf(_SC_CLK_TCK));
}

Actor::Measured::Measured(Actor& actor, const char* what, o80::Timeout timeout)
    : actor_(actor),
      what_(what),
      timeout_(timeout ? timeout->count() : 0),
      began_(o80::monotonic_now()),
      stopped_(actor.stopped()),
      starved_(actor.starved()),
      stolen_(actor.round.stolen),
      exceptions_(std::uncaught_exceptions()) {
  actor.slot.call = what;
  actor.stopped_at_call_ = stopped_;
  actor.slot.call_ends = began_ + timeout_;
  actor.slot.calls.fetch_add(1, std::memory_order_relaxed);
}

Actor::Measured::~Measured() noexcept(false) {
  const std::int64_t took = o80::monotonic_now() - began_;
  actor_.slot.call_ends = 0;
  if (took <= timeout_ + kGrace) return;
  const std::int64_t stopped = actor_.stopped() - stopped_;
  const std::int64_t starved = actor_.starved() - starved_;
  const std::int64_t stolen = stolen_time() - stolen_;
  if (took - stopped - starved - stolen <= timeout_ + kGrace) return;
  try {
    actor_.fail(Fault::hang,
                "%s took %.1f ms with a timeout of %.1f ms (stopped for %.1f ms, without a "
                "processor for %.1f ms, the machine for %.1f ms)",
                what_, static_cast<double>(took) / 1e6, static_cast<double>(timeout_) / 1e6,
                static_cast<double>(stopped) / 1e6, static_cast<double>(starved) / 1e6,
                static_cast<double>(stolen) / 1e6);
  } catch (const Broken&) {
    // another error is on its way already: what was said stands
    if (std::uncaught_exceptions() == exceptions_) throw;
  }
}

std::optional<o80::UntypedFrontend> Actor::attach(std::uint32_t segment, o80::Access access) {
  const auto timeout = some_timeout();
  try {
    return timed("attach", timeout, [&] {
      return o80::UntypedFrontend(segment_name(segment), {.timeout = timeout, .access = access});
    });
  } catch (const o80::TimeoutError&) {
    // nobody is there yet
  } catch (const o80::BackendFailed& error) {
    const auto& lives = round.lives;
    if (std::none_of(lives.begin(), lives.end(),
                     [](const Generation& life) { return life.failed != 0; }))
      fail(Fault::false_death, "no backend has failed, says: %s", error.what());
    pause(kMillisecond);
  }
  return std::nullopt;
}

// ------------------------------------------------------------------------------ deaths

bool Actor::any_sender_doomed() const {
  return std::any_of(round.slots.begin(), round.slots.end(), [](const Slot& other) {
    return other.doomed_at != 0 && is_sender(other.role);
  });
}

Generation* Actor::life_of(std::uint64_t epoch) {
  const std::uint32_t count = round.generations;
  for (std::uint32_t i = count; i > 0; --i)
    if (round.lives[i - 1].epoch == epoch) return &round.lives[i - 1];
  return nullptr;
}

Generation& Actor::life_of(const o80::UntypedFrontend& frontend) {
  Generation* life = life_of(frontend.epoch());
  if (life == nullptr) fail(Fault::wrong_row, "attached to a backend that nobody started");
  return *life;
}

void Actor::judge_gone(Generation& life, const o80::BackendGone& error, std::int64_t call_began) {
  const std::int64_t now = o80::monotonic_now();
  const std::int64_t doomed = life.doomed_at;
  const bool ending = life.ending_at != 0;
  const bool killed = dynamic_cast<const o80::BackendKilled*>(&error) != nullptr;
  const bool superseded = dynamic_cast<const o80::BackendSuperseded*>(&error) != nullptr;
  if (killed && doomed == 0)
    fail(Fault::false_death, "generation %ld lives, and was said to be killed: %s",
         &life - round.lives.data(), error.what());
  if (superseded && doomed == 0 && !ending)
    fail(Fault::false_death, "generation %ld lives, and was said to be superseded: %s",
         &life - round.lives.data(), error.what());
  const bool failed = dynamic_cast<const o80::BackendFailed*>(&error) != nullptr;
  const bool says_why = std::string_view(error.what()).find("failed: ") != std::string_view::npos;
  if (!killed && !superseded && (failed != (life.failed != 0) || failed != says_why))
    fail(Fault::false_death, "generation %ld %s, but: %s", &life - round.lives.data(),
         life.failed != 0 ? "failed" : "did not fail", error.what());
  if (!killed && !superseded && !ending)
    fail(Fault::false_death, "generation %ld did not end: %s", &life - round.lives.data(),
         error.what());
  if (doomed == 0 || doomed < call_began || stopped() != stopped_at_call_) return;
  round.noticed.add(now - doomed);
}

void Actor::judge_timeout(Generation& life, std::int64_t call_began, std::int64_t stopped_before) {
  slot.timeouts.fetch_add(1, std::memory_order_relaxed);
  const std::int64_t dead = life.dead_at;
  if (dead == 0 || stopped() != stopped_before || a_successor_was_stopped()) return;
  if (call_began - dead > kGrace)
    fail(Fault::unnoticed_death, "generation %ld was dead for %.0f ms before a %s that timed out",
         &life - round.lives.data(), static_cast<double>(call_began - dead) / 1e6,
         slot.call.load());
}

/// Who is stopped while it takes over holds the lock of the dead and has not said that it is dead.
bool Actor::a_successor_was_stopped() const {
  return std::any_of(round.slots.begin(), round.slots.end(), [&](const Slot& other) {
    return other.segment == slot.segment &&
           (is_backend(other.role) || other.role == Role::usurper) && other.stopped != 0;
  });
}

bool is_refusal(const o80::Error& error) {
  return dynamic_cast<const o80::LaneFull*>(&error) != nullptr ||
         dynamic_cast<const o80::NoLane*>(&error) != nullptr ||
         std::string_view(error.what()).find("exclusive control") != std::string_view::npos;
}

std::uint64_t epoch_of(const std::string& segment) {
  o80::SegmentHeader header{};
  const int file = open(o80::segment_path(segment).c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0) return 0;
  const bool read = pread(file, &header, sizeof header, 0) == sizeof header;
  close(file);
  return read ? header.epoch : 0;
}

// ------------------------------------------------------------------------------ orphans

bool Actor::forked() const {
  const pid_t child = fork();
  if (child != 0) return false;
  o80::crash_plan().passages_left = 0;
  // an open file below /proc/PID makes the kernel spin where it takes down what is left of PID
  close(schedule_);
  return true;
}

}  // namespace torture
