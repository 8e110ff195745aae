#include "arms/so101.hpp"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <poll.h>
#include <stdlib.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

namespace o80::arms {
extern std::size_t allocations_of_this_thread();  // feetech_chain_test.cpp counts them
}

namespace o80::arms {
namespace {

/// Servos that are where they are told to be, at the other end of a pseudo-terminal.
class PerfectServos {
 public:
  PerfectServos() : line_(posix_openpt(O_RDWR | O_NOCTTY)) {
    grantpt(line_);
    unlockpt(line_);
    for (Registers& each : registers_) {
      put(each, feetech::kModel, feetech::kSts3215);
      put(each, feetech::kLargest, 4095);
      put(each, feetech::kHottest, 70);
      put(each, feetech::kMostVoltage, 80);
      put(each, feetech::kPhase, 12);
      put(each, feetech::kPosition, 2000);
      each[62] = 52;
    }
    thread_ = std::thread([this] { serve(); });
  }
  PerfectServos(const PerfectServos&) = delete;
  ~PerfectServos() {
    over_ = true;
    thread_.join();
    ::close(line_);
  }
  std::string port() const { return ptsname(line_); }
  std::atomic<bool> silent = false;

 private:
  using Registers = std::array<std::uint8_t, 128>;
  static void put(Registers& registers, Register where, int value) {
    registers[where.address] = static_cast<std::uint8_t>(value);
    if (where.size == 2) registers[where.address + 1] = static_cast<std::uint8_t>(value >> 8);
  }

  void serve() {
    std::vector<std::uint8_t> bytes;
    while (!over_) {
      pollfd wanted{line_, POLLIN, 0};
      std::array<std::uint8_t, 512> part{};
      if (poll(&wanted, 1, 10) <= 0) continue;
      const ssize_t count = ::read(line_, part.data(), part.size());
      if (count <= 0) continue;  // nobody has opened it
      bytes.insert(bytes.end(), part.begin(), part.begin() + count);
      while (bytes.size() >= 4 && bytes.size() >= bytes[3] + 4U) {
        obey({bytes.begin() + 2, bytes.begin() + bytes[3] + 3});
        bytes.erase(bytes.begin(), bytes.begin() + bytes[3] + 4);
      }
    }
  }
  void obey(const std::vector<std::uint8_t>& body) {
    const std::size_t size = body.size() > 4 ? body[4] : 0;
    if (silent) return;
    if (body[2] == 2) send(body[0], {at(body[0]) + body[3], size});
    for (std::size_t i = 5; body[2] == 0x82 && i < body.size(); ++i) {
      send(body[i], {at(body[i]) + body[3], size});
    }
    for (std::size_t i = 5; body[2] == 0x83 && i < body.size(); i += size + 1) {
      std::copy_n(body.begin() + static_cast<std::ptrdiff_t>(i) + 1, size, at(body[i]) + body[3]);
      if (body[3] == 42) std::copy_n(at(body[i]) + 42, 2, at(body[i]) + 56);
    }
  }
  std::uint8_t* at(std::uint8_t id) { return registers_.at(id - 1U).data(); }
  void send(std::uint8_t id, std::span<const std::uint8_t> data) {
    std::vector<std::uint8_t> packet{0xFF, 0xFF, id, static_cast<std::uint8_t>(data.size() + 2), 0};
    packet.insert(packet.end(), data.begin(), data.end());
    std::uint8_t sum = 0;
    for (std::size_t i = 2; i < packet.size(); ++i)
      sum = static_cast<std::uint8_t>(sum + packet[i]);
    packet.push_back(static_cast<std::uint8_t>(~sum));
    EXPECT_EQ(::write(line_, packet.data(), packet.size()), static_cast<ssize_t>(packet.size()));
  }

  std::array<Registers, kServos> registers_{};
  int line_;
  std::atomic<bool> over_ = false;
  std::thread thread_;
};

/// The driver, iteration by iteration.
class DriverOfSo101 : public testing::Test {
 protected:
  static std::string calibration() {
    std::string path = testing::TempDir() + "so101_" + std::to_string(getpid()) + ".json";
    std::ofstream json(path);
    for (std::size_t i = 0; i < kServos; ++i) {
      json << (i == 0 ? "{" : ",") << '"' << kJointNames[i] << "\": {\"id\": " << i + 1
           << R"(, "drive_mode": 0, "homing_offset": 0, "range_min": 0, "range_max": 4095})";
    }
    json << "}";
    return path;
  }
  ~DriverOfSo101() override { std::filesystem::remove(file); }

  void iterate() {
    std::array<std::byte, sizeof(ArmState)> states{};
    pack(desired, states.data());
    const std::uint64_t active = 0;
    driver.write(Desired<So101>({states.data(), &active, ++iteration, 0, 6'666'667}));
    read();
  }
  void read() {
    ReadingView view{};
    view.observed = observed.data();
    view.extended = extended.data();
    view.interrupted = &interrupted;
    Reading<So101> reading(view);
    driver.read(reading);
    row = reading.observed;
    sensors = reading.extended;
    halt = view.halt_text;
    is_halted = view.halted != 0;
  }

  PerfectServos servos;
  std::string file = calibration();
  So101 driver{{.port = servos.port(), .calibration = file, .answer_timeout = 0.3}};
  ArmState desired{};
  ArmState row{};
  ArmSensors sensors{};
  FaultText halt{};
  bool is_halted = false;
  std::uint64_t interrupted = 0;
  std::array<std::byte, 1024> observed{};
  std::array<std::byte, 1024> extended{};
  std::int64_t iteration = 0;
};

TEST_F(DriverOfSo101, AllocatesNothingInTheLoopNotEvenWhenItHaltsAndResumes) {
  driver.start();
  read();
  desired = row;
  const std::size_t before = allocations_of_this_thread();
  for (int i = 0; i < 100; ++i) {
    desired.joints[2] += 0.005;
    iterate();
  }
  servos.silent = true;
  while (!is_halted) iterate();
  EXPECT_EQ(driver.resume().kind, Served::Kind::rejected);
  servos.silent = false;
  while (!sensors.link.fresh) iterate();
  EXPECT_EQ(driver.resume().kind, Served::Kind::done);
  is_halted = false;
  for (int i = 0; i < 100; ++i) iterate();
  static_cast<void>(driver.on(Relax{}));
  iterate();
  static_cast<void>(driver.on(Hold{}));
  iterate();
  EXPECT_EQ(allocations_of_this_thread(), before);
  EXPECT_TRUE(sensors.link.fresh);
  EXPECT_FALSE(is_halted);
  EXPECT_NEAR(row.joints[2], desired.joints[2], 0.01);
  driver.stop();
}

}  // namespace
}  // namespace o80::arms
