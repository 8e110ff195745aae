// From a published row to a reader that has it, asleep and spinning, beside a bare futex.

#include <sys/mman.h>

#include "empty_robot.hpp"
#include "memory/os/futex.hpp"
#include "ping_pong.hpp"
#include "sample.hpp"

namespace o80::bench {
namespace {

constexpr std::int64_t kSleepy = 150'000;  // between rows: nobody spins for so long [ns]

struct TwoStates {
  using Actuators = std::array<double, 2>;
};

void spin_for(std::int64_t time) {
  const std::int64_t end = monotonic_now() + time;
  while (monotonic_now() < end) pause_processor();
}

/// A word and the time at which it changed, in memory that processes could share.
struct Futex {
  std::atomic<std::uint32_t> word;
  std::atomic<std::int64_t> changed_at;
};

Futex& shared_futex() {
  void* page =
      mmap(nullptr, sizeof(Futex), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  return *new (page) Futex;
}

/// Bare futex: the waker's clock before its store to the sleeper's clock after its wait.
double futex_wake_up(int count) {
  static Futex& futex = shared_futex();
  const std::uint32_t begin = futex.word;
  std::thread waker([begin, count] {
    pin(1);
    for (int i = 1; i <= count; ++i) {
      spin_for(kSleepy);
      futex.changed_at = monotonic_now();
      futex.word = begin + static_cast<std::uint32_t>(i);
      futex_wake(futex.word, 1);
    }
  });
  std::vector<double> taken;
  for (std::uint32_t seen = begin; taken.size() < static_cast<std::size_t>(count); ++seen) {
    while (futex.word == seen) futex_wait(futex.word, seen, 1'000'000'000);
    taken.push_back(static_cast<double>(monotonic_now() - futex.changed_at));
  }
  waker.join();
  return median(taken);
}

/// The stamp in a row, taken as it is published, to the reader's clock after its wait.
double row_wake_up(Backend<TwoStates>& backend, UntypedFrontend& frontend, int count) {
  const Iteration begin = frontend.published() + 1;
  std::thread writer([&backend, count] {
    pin(1);
    for (int i = 0; i < count; ++i) {
      spin_for(kSleepy);
      backend.step();
      backend.publish({});
    }
  });
  UntypedObservation row(frontend.description());
  std::vector<double> taken;
  for (Iteration k = begin; k < begin + count; ++k) {
    frontend.wait_for(k, row.bytes(), std::chrono::seconds(5));
    taken.push_back(static_cast<double>(monotonic_now() - row.time()));
  }
  writer.join();
  return median(taken);
}

/// A backend, and a frontend of the other thread's.
struct Side {
  explicit Side(const char* what) : backend({.segment = segment_name(what)}) {
    backend.publish({});
    frontend.emplace(segment_name(what));
  }
  void iterate() {
    backend.step();
    backend.publish({});
  }
  void wait_for(Iteration k) { frontend->wait_for(k, row, std::chrono::seconds(5)); }

  Backend<TwoStates> backend;
  std::optional<UntypedFrontend> frontend;
  alignas(8) std::byte row[256];
};

/// Two threads, each of which answers the other's row with one of its own: half of a round trip,
/// the whole of an iteration included [ns].
double row_hop(Side& here, Side& there, int count) {
  const Iteration begin = here.frontend->published() + 1;
  std::thread answerer([&, begin, count] {
    for (Iteration k = begin; k < begin + count; ++k) {
      here.wait_for(k);
      there.iterate();
    }
  });
  const double time = nanoseconds([&] {
    for (Iteration k = begin; k < begin + count; ++k) {
      here.iterate();
      there.wait_for(k);
    }
  });
  answerer.join();
  return time / count / 2;
}

void measure_spinning(int rounds) {
  Side here("here");
  Side there("there");
  PingPong line;
  row_hop(here, there, 1000);
  for (int round = 0; round < rounds; ++round) {
    line.rest(false);
    line.round_trip(1000);
    sample("cache_line_hop", "ns", line.round_trip(20'000) / 2);
    line.rest(true);
    sample("row_wake_up_spinning", "ns", row_hop(here, there, 20'000));
  }
}

void measure_sleeping(int rounds) {
  const std::string name = segment_name("wake");
  Backend<TwoStates> backend({.segment = name});
  backend.publish({});
  UntypedFrontend frontend(name);
  pin(0);
  row_wake_up(backend, frontend, 20);
  for (int round = 0; round < rounds; ++round) {
    sample("futex_wake_up", "us", futex_wake_up(100) * 1e-3);
    sample("row_wake_up_sleeping", "us", row_wake_up(backend, frontend, 100) * 1e-3);
  }
}

}  // namespace
}  // namespace o80::bench

int main(int argc, char** argv) {
  o80::bench::take_priority();
  o80::bench::measure_spinning(o80::bench::rounds_of(argc, argv));
  o80::bench::measure_sleeping(o80::bench::rounds_of(argc, argv));
}
