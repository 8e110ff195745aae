// Frontends and backends of one process in threads, all at once: work for the thread sanitizer.
// Bounded by what is done, not by time.

#include <atomic>
#include <thread>

#include "o80/base/error.hpp"
#include "runtime/manual_backend.hpp"

namespace o80::test {
namespace {

class StressTest : public ManualBackendTest {};

TEST_F(StressTest, OneFrontendServesManyThreads) {
  BurstingBackend server;
  UntypedFrontend frontend("pair", {.timeout = kPatience});
  std::atomic<std::uint64_t> before{0};
  {
    std::vector<std::jthread> threads;
    for (std::uint32_t actuator = 0; actuator < 2; ++actuator)
      threads.emplace_back([&, actuator] {
        for (int i = 1; i <= 60; ++i) {
          send(frontend, actuator, i, {.pace = iterations(2)});
          frontend.burst(2, kPatience);
          ++before;
        }
      });
    threads.emplace_back([&] {
      Iteration position = 0;
      UntypedObservation row(frontend.description());
      while (position < 200) frontend.wait_for_next(position, row.bytes(), kPatience);
    });
    threads.emplace_back([&] {
      while (frontend.published() < 200) {
        static_cast<void>(frontend.history(16));
        std::this_thread::yield();
      }
    });
  }
  EXPECT_EQ(before, 120U);
  EXPECT_EQ(frontend.published(), 240);
}

TEST_F(StressTest, FrontendsComeGoBurstAndRequest) {
  BurstingBackend server;
  std::vector<std::jthread> threads;
  for (int i = 0; i < 4; ++i)
    threads.emplace_back([i] {
      for (int life = 0; life < 6; ++life) {
        UntypedFrontend frontend("pair", {.timeout = kPatience});
        for (int k = 0; k < 10; ++k) {
          if (k == i) add_request(frontend, Refuse{});
          add(frontend, static_cast<std::uint32_t>(i % 2), k, {.pace = iterations(3)});
          const Batch batch = frontend.pulse();
          frontend.burst(1 + k % 3, kPatience);
          ASSERT_EQ(batch.rejection(), "");
        }
      }
    });
}

TEST_F(StressTest, AFrontendIsClosedWhileItsThreadsWait) {
  BurstingBackend server;
  for (int round = 0; round < 10; ++round) {
    UntypedFrontend frontend("pair", {.timeout = kPatience});
    const Batch batch = send(frontend, 0, 1.0, {.pace = iterations(1'000'000)});
    std::atomic<int> waiting{0};
    std::vector<std::jthread> threads;
    threads.emplace_back([&] {
      ++waiting;
      EXPECT_THROW(frontend.wait_for(1'000'000'000, kPatience), Closed);
    });
    threads.emplace_back([&] {
      ++waiting;
      EXPECT_THROW(batch.wait(kPatience), Closed);
    });
    while (waiting < 2) std::this_thread::yield();
    frontend.close();
  }
}

TEST_F(StressTest, ABackendStopsWhileFrontendsBurstAndWait) {
  for (int round = 0; round < 10; ++round) {
    auto server = std::make_unique<BurstingBackend>();
    std::atomic<int> burst{0};
    std::atomic<int> attached{0};
    std::vector<std::jthread> threads;
    for (int i = 0; i < 2; ++i)
      threads.emplace_back([&] {
        UntypedFrontend frontend("pair", {.timeout = kPatience});
        ++attached;
        EXPECT_THROW(
            while (true) {
              frontend.burst(3, kPatience);
              ++burst;
            },
            BackendGone);
      });
    threads.emplace_back([&] {
      const UntypedFrontend frontend("pair", {.timeout = kPatience});
      ++attached;
      EXPECT_THROW(frontend.wait_for(1'000'000'000, kPatience), BackendGone);
    });
    while (attached < 3 || burst < 20) std::this_thread::yield();
    server->stop();
    server.reset();
  }
}

}  // namespace
}  // namespace o80::test
