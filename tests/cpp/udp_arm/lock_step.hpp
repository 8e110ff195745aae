#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string>
#include <thread>

#include "examples/udp_arm/fake_arm.hpp"
#include "examples/udp_arm/udp_arm.hpp"

namespace udp_arm {

inline constexpr std::int64_t kPeriod = 10'000'000;  // [ns]

/// What a reading said.
struct Row {
  std::array<double, kJoints> position{};
  UdpArm::Link link;
  bool missed = false;
  std::string halt, fault;
};

/// The driver and the fake arm in one thread, with no clock: each iteration has one tick of the
/// arm.
class LockStep {
 public:
  explicit LockStep(const UdpArm::Config& config = {}, std::uint64_t command_timeout = 1000)
      : fake({.period = kPeriod, .command_timeout = command_timeout}),
        driver(at_port(config, fake.port())) {
    std::atomic<bool> connected = false;
    std::thread ticks([&] {
      while (!connected) {
        fake.tick();
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
      }
    });
    driver.start();
    connected = true;
    ticks.join();
    read();
    iterate();  // what came meanwhile
  }

  /// An iteration in which a packet will come: waits for it however long it takes.
  Row iterate() {
    write();
    fake.tick();
    return hear();
  }
  /// An iteration in which none will come.
  Row iterate_in_vain() {
    write();
    fake.tick();
    return miss();
  }
  void write() {
    std::array<std::byte, kBlock> states{};
    o80::pack(desired, states.data());
    const std::uint64_t active = ~std::uint64_t{0};
    driver.write(o80::Desired<UdpArm>({states.data(), &active, ++iteration_, 0, period}));
  }
  Row hear() {
    driver.wait(now() + 60'000'000'000);
    return read();
  }
  Row miss() {
    driver.wait(0);
    return read();
  }

  FakeArm fake;
  UdpArm driver;
  std::array<double, kJoints> desired{};
  std::int64_t period = kPeriod;

 private:
  static constexpr std::size_t kBlock = 1024;  // more than a state or the sensors need

  static UdpArm::Config at_port(UdpArm::Config config, int port) {
    config.port = port;
    return config;
  }
  Row read() {
    o80::ReadingView view{};
    std::uint64_t interrupted = 0;
    view.observed = observed_.data();
    view.extended = extended_.data();
    view.interrupted = &interrupted;
    view.iteration = iteration_;
    o80::Reading<UdpArm> reading(view);
    driver.read(reading);
    reading.store();
    Row row;
    row.position = reading.observed;
    row.link = reading.extended;
    row.missed = view.missed != 0;
    if (view.halted != 0) row.halt = view.halt_text.text;
    if (reading.faulty()) row.fault = reading.fault_text().text;
    return row;
  }

  std::array<std::byte, kBlock> observed_{};
  std::array<std::byte, kBlock> extended_{};
  std::int64_t iteration_ = 0;
};

}  // namespace udp_arm
