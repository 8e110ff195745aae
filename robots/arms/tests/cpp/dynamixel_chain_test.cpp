#include "arms/dynamixel_chain.hpp"

#include <gmock/gmock.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <vector>

#include "packet_rig.hpp"

namespace o80::arms {

extern std::size_t allocations_of_this_thread();  // feetech_chain_test.cpp counts them

namespace {

using testing::IsEmpty;

/// A chain of two servos, and the other end of its line in the same thread: each write(2) of the
/// chain is one packet there.
class DynamixelLine : public testing::Test {
 protected:
  DynamixelLine() {
    std::array<int, 2> ends{};
    EXPECT_EQ(socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK, 0, ends.data()), 0);
    chain.open(SerialPort(ends[0]));
    end = ends[1];
  }
  ~DynamixelLine() override { ::close(end); }

  Bytes sent() const {
    Bytes bytes(1024);
    const ssize_t size = recv(end, bytes.data(), bytes.size(), 0);
    bytes.resize(size > 0 ? static_cast<std::size_t>(size) : 0);
    return bytes;
  }
  /// Registers that the last question asks of a servo.
  static std::span<const std::uint8_t> asked(const Bytes& question, std::size_t servo) {
    return std::span(question).last(2 + 10).subspan(5 * servo, 5);
  }
  /// An answer to such a question, of a servo that stands there.
  Bytes answer(std::span<const std::uint8_t> asked, int position, int failure = 0) const {
    Bytes registers(256);
    registers[dynamixel::kFailure.address] = static_cast<std::uint8_t>(failure);
    registers[dynamixel::kTorque.address] = torque ? 1 : 0;
    for (std::size_t i = 0; i < 4; ++i) {
      registers[dynamixel::kPosition.address + i] = static_cast<std::uint8_t>(position >> 8 * i);
    }
    const std::uint8_t alert = failure != 0 ? dynamixel::kAlert : 0;
    const auto size = static_cast<std::uint8_t>(asked[3] + 4);
    Bytes packet{0xFF, 0xFF, 0xFD, 0, asked[0], size, 0, 0x55, alert};
    packet.insert(packet.end(), registers.begin() + asked[1],
                  registers.begin() + asked[1] + asked[3]);
    const std::uint16_t sum = dynamixel::crc(packet);
    packet.push_back(static_cast<std::uint8_t>(sum & 0xFF));
    packet.push_back(static_cast<std::uint8_t>(sum >> 8));
    return packet;
  }
  void send(const Bytes& bytes) const {
    EXPECT_EQ(::send(end, bytes.data(), bytes.size(), 0), static_cast<ssize_t>(bytes.size()));
  }
  Bytes ask() {
    for (chain.request(0, {}); !chain.is_asking(); chain.request(0, {})) {
      EXPECT_FALSE(chain.collect(now() + kLong).asked);
    }
    return sent();
  }
  /// A whole transfer: where both servos stand, and the failure of the second.
  ServoChain::Transfer transfer(int position, int failure = 0) {
    const Bytes question = ask();
    send(answer(asked(question, 0), position));
    send(answer(asked(question, 1), position, failure));
    return chain.collect(now() + kLong);
  }

  static constexpr std::int64_t kLong = 60'000'000'000;  // [ns]
  static constexpr std::array<int, 2> kGoals{2048, -100};
  static constexpr std::array kModels{DynamixelChain::kXl430, DynamixelChain::kXl330};
  DynamixelChain chain{kModels, 0};
  bool torque = true;
  int end = -1;
};

TEST_F(DynamixelLine, GoalsAndTheQuestionLeaveInOneSystemCall) {
  chain.request(chain.all(), kGoals);
  const Bytes bytes = sent();
  EXPECT_EQ(bytes.size(), (10U + 4 + 2 * 5) + (10U + 2 * 5));
  EXPECT_EQ(bytes[7], 0x83);
  EXPECT_EQ(bytes[8], 116);
  EXPECT_EQ(bytes[24 + 7], 0x92);
  EXPECT_THAT(sent(), IsEmpty());
}

TEST_F(DynamixelLine, ReadingsHaveASignAndTellTheTorqueOfEachServoInTurn) {
  ServoChain::Mask known = 0;
  for (int i = 0; i < 2; ++i) {
    const ServoChain::Transfer done = transfer(-5);
    EXPECT_EQ(done.answered, chain.all());
    EXPECT_EQ(done.torque_known & known, 0U);
    known |= done.torque_known;
  }
  EXPECT_EQ(known, chain.all());
  EXPECT_EQ(chain[0].position, -5);
  EXPECT_TRUE(chain[0].torque && chain[1].torque);
}

TEST_F(DynamixelLine, TurnsThatAServoCountsAreInItsGoalOnlyAndNeverChangeWhileItHolds) {
  transfer(8187);  // the middle of its range is 0 here
  EXPECT_EQ(chain[0].position, -5);
  EXPECT_EQ(chain.goal(0, 7).value, 8192 + 7);
  const auto all_tell = [&](int position) { transfer(position), transfer(position); };
  all_tell(8192 - 2300);
  EXPECT_EQ(chain[0].position, -2300) << "it was pushed beyond its range";
  torque = false;  // as after a loss of power
  all_tell(8192 - 2200);
  EXPECT_EQ(chain[0].position, -2200);
  all_tell(8192 - 2300);
  EXPECT_EQ(chain[0].position, 4096 - 2300);
  EXPECT_EQ(chain.goal(0, 7).value, 4096 + 7);
}

TEST_F(DynamixelLine, AFailureIsNamedByTheNextAnswerAtTheLatest) {
  for (int i = 0; i < 2; ++i) {  // whichever servo is asked for more
    transfer(1000, dynamixel::overload_failure);
    transfer(1000, dynamixel::overload_failure);
    EXPECT_EQ(chain[1].status, overload_alarm);
    transfer(1000);
    EXPECT_EQ(chain[1].status, 0);
    transfer(1000);
    transfer(1000);
  }
}

TEST_F(DynamixelLine, ALateDamagedOrRepeatedAnswerNeverCounts) {
  for (int failures = 1; failures < 8; ++failures) {
    transfer(1000);
    const Bytes old = ask();
    chain.collect(now());
    for (int i = 1; i < failures; ++i) {
      send(answer(asked(ask(), 1), 1500));
      EXPECT_EQ(chain.collect(now()).answered, 2U);
    }
    const Bytes question = ask();
    Bytes damaged = answer(asked(question, 0), 1200);
    damaged[12] ^= 1;
    send(damaged);
    send(answer(asked(old, 0), 1000));
    send(answer(asked(question, 0), 2000));
    send(answer(asked(question, 0), 1300));
    send(answer(asked(question, 1), 2000));
    const ServoChain::Transfer done = chain.collect(now() + kLong);
    EXPECT_EQ(done.answered, chain.all());
    EXPECT_EQ(done.late, 2U);
    EXPECT_EQ(done.damaged, 1U);
    EXPECT_EQ(chain[0].position, 2000) << "after " << failures << " failures";
  }
}

TEST_F(DynamixelLine, AWatchedChainThatPausedEndsTheStopOfItsServosBeforeItsGoals) {
  chain.watch(true);
  chain.send_queued();
  sent();
  chain.request(chain.all(), kGoals);  // the first one: the pause before it has no end
  const Bytes bytes = sent();
  const std::size_t watchdogs = 2 * (10U + 4 + 2 * 2);
  ASSERT_EQ(bytes.size(), watchdogs + 24 + 20);
  EXPECT_EQ(bytes[8], 98);
  EXPECT_EQ(bytes[watchdogs + 8], 116);
}

TEST_F(DynamixelLine, ServosThatAreRestartedDoNotAnswerIntoTheQuestionBehind) {
  chain.queue_recovery(2);
  chain.request(0, {});
  const Bytes bytes = sent();
  EXPECT_THAT(Bytes(bytes.begin() + 7, bytes.begin() + 14),
              testing::ElementsAre(0x83, 68, 0, 1, 0, 2, 1));
  EXPECT_EQ(bytes[16 + 4], 2);
  EXPECT_EQ(bytes[16 + 7], 8);
  EXPECT_EQ(bytes[16 + 10 + 7], 0x92);
}

TEST_F(DynamixelLine, NothingAllocates) {
  const Bytes first = answer(asked(ask(), 0), 1000);
  chain.collect(now());
  const std::array<double, 2> strengths{1.0, 0.5};
  const std::size_t before = allocations_of_this_thread();
  for (int i = 0; i < 100; ++i) {
    chain.queue_motion(chain.all(), 300.0, 2000.0, strengths);
    chain.queue_recovery(chain.all());
    chain.request(chain.all(), kGoals);
    ::send(end, first.data(), first.size(), 0);
    chain.collect(now());
  }
  EXPECT_EQ(allocations_of_this_thread(), before);
}

}  // namespace
}  // namespace o80::arms
