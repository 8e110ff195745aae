// What 64 readers cost the writer: readers in a process of their own, on the other processor.

#include <signal.h>
#include <sys/wait.h>

#include "empty_robot.hpp"
#include "sample.hpp"

namespace o80::bench {
namespace {

constexpr int kReaders = 64;
constexpr int kBurst = 100'000;
constexpr std::int64_t kPeriod = 1'000'000;  // of a reader, and of the paced writer [ns]

void nap(std::int64_t time) {
  const timespec pause{.tv_sec = 0, .tv_nsec = time};
  nanosleep(&pause, nullptr);
}

/// Reads the newest row a thousand times a second.
void read_now_and_then(const std::string& segment) {
  const UntypedFrontend frontend(segment);
  UntypedObservation row(frontend.description());
  while (true) {
    frontend.latest(row.bytes());
    nap(kPeriod);
  }
}

/// Waits for every row.
void read_each(const std::string& segment) {
  const UntypedFrontend frontend(segment);
  UntypedObservation row(frontend.description());
  Iteration position = frontend.published();
  while (true) frontend.wait_for_next(position, row.bytes(), std::nullopt);
}

/// A process of readers that goes on and stands still when it is told.
class Readers {
 public:
  Readers(const std::string& segment, void (*read)(const std::string&)) : pid_(fork()) {
    if (pid_ != 0) return;
    take_priority();
    pin(0);
    std::vector<std::thread> readers;
    for (int i = 0; i < kReaders; ++i) {
      readers.emplace_back([&] {
        try {
          read(segment);
        } catch (const Error&) {  // the backend has gone: so does the reader
        }
      });
    }
    for (std::thread& reader : readers) reader.join();
    _exit(0);
  }
  ~Readers() {
    kill(pid_, SIGKILL);
    waitpid(pid_, nullptr, 0);
  }
  void go_on() const {
    kill(pid_, SIGCONT);
    nap(20'000'000);
  }
  void stand_still() const {
    kill(pid_, SIGSTOP);
    nap(5'000'000);
  }

 private:
  pid_t pid_;
};

double per_iteration(UntypedFrontend& frontend) {
  return nanoseconds([&] { frontend.burst(kBurst, std::chrono::seconds(20)); }) / kBurst;
}

/// Median time of step and publish at a thousand iterations a second [ns].
double paced_iteration(Backend<EightWithSensors>& backend, int count) {
  std::vector<double> taken;
  for (int i = 0; i < count; ++i) {
    nap(kPeriod);
    taken.push_back(nanoseconds([&] {
      backend.step();
      backend.publish({}, {});
    }));
  }
  return median(taken);
}

void measure(int rounds) {
  const std::string bursting = segment_name("readers");
  const std::string paced = segment_name("waiters");
  // processes are made before there are threads, and wait for their backends
  const Readers readers(bursting, read_now_and_then);
  const Readers waiters(paced, read_each);
  take_priority();

  {
    const Running<EightWithSensors> robot(bursting, 1);
    UntypedFrontend frontend(bursting);
    nap(200'000'000);
    per_iteration(frontend);
    for (int round = 0; round < rounds; ++round) {
      readers.stand_still();
      sample("writer_alone", "ns", per_iteration(frontend));
      readers.go_on();
      sample("writer_with_64_readers", "ns", per_iteration(frontend));
    }
    readers.stand_still();
  }
  pin(1);
  Backend<EightWithSensors> backend({.segment = paced});
  backend.publish({}, {});
  nap(200'000'000);
  for (int round = 0; round < rounds; ++round) {
    sample("paced_writer_with_64_waiters", "us", paced_iteration(backend, 50) * 1e-3);
  }
}

}  // namespace
}  // namespace o80::bench

int main(int argc, char** argv) { o80::bench::measure(o80::bench::rounds_of(argc, argv)); }
