#include "arms/feetech_chain.hpp"

#include <gmock/gmock.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <vector>

#include "count_allocations.hpp"
#include "packet_rig.hpp"

namespace o80::arms {

std::size_t allocations_of_this_thread() { return allocations; }

namespace {

using testing::ElementsAre;
using testing::IsEmpty;

constexpr std::int64_t kLong = 60'000'000'000;  // [ns]
constexpr std::array<int, 2> kGoals{2048, 100};

/// A chain of two servos, and the other end of its line in the same thread: each write(2) of the
/// chain is one packet there.
class Line : public testing::Test {
 protected:
  Line() {
    std::array<int, 2> ends{};
    EXPECT_EQ(socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK, 0, ends.data()), 0);
    chain.open(SerialPort(ends[0]));
    end = ends[1];
  }
  ~Line() override { ::close(end); }

  /// What the chain sent, in one system call.
  Bytes sent() const {
    Bytes bytes(512);
    const ssize_t size = recv(end, bytes.data(), bytes.size(), 0);
    bytes.resize(size > 0 ? static_cast<std::size_t>(size) : 0);
    return bytes;
  }
  /// How many bytes of each servo the last question asks for.
  static std::uint8_t asked(const Bytes& question) { return question[question.size() - 4]; }

  void send(const Bytes& bytes) const {
    EXPECT_EQ(::send(end, bytes.data(), bytes.size(), 0), static_cast<ssize_t>(bytes.size()));
  }
  static Bytes answer(std::uint8_t id, int position, std::uint8_t size, std::uint8_t status = 0) {
    Bytes packet{0xFF, 0xFF, id, static_cast<std::uint8_t>(size + 2), status};
    const std::size_t position_at = packet.size() + (size >= 24 ? 16 : 0);
    packet.resize(packet.size() + size);
    packet[position_at] = static_cast<std::uint8_t>(position & 0xFF);
    packet[position_at + 1] = static_cast<std::uint8_t>(position >> 8);
    std::uint8_t sum = 0;
    for (std::size_t i = 2; i < packet.size(); ++i)
      sum = static_cast<std::uint8_t>(sum + packet[i]);
    packet.push_back(static_cast<std::uint8_t>(~sum));
    return packet;
  }
  /// A question, its answers with this position, and what the chain makes of them.
  FeetechChain::Transfer transfer(int position) {
    const std::uint8_t size = ask();
    send(answer(1, position, size));
    send(answer(2, position, size));
    return chain.collect(now() + kLong);
  }
  /// One to which only servo 2 answers in time; returns how many bytes it asked for.
  std::uint8_t fail() {
    const std::uint8_t size = ask();
    send(answer(2, 1500, size));
    EXPECT_EQ(chain.collect(now()).answered, 2U);
    return size;
  }
  /// Asks as soon as the chain does.
  std::uint8_t ask() {
    for (chain.request(0, {}); !chain.is_asking(); chain.request(0, {})) {
      EXPECT_FALSE(chain.collect(now() + kLong).asked);
    }
    return asked(sent());
  }

  FeetechChain chain{2};
  int end = -1;
};

TEST_F(Line, GoalsQueuedWritesAndTheQuestionLeaveInOneSystemCall) {
  chain.queue_torque(chain.all(), true);
  chain.request(chain.all(), kGoals);
  const Bytes bytes = sent();
  EXPECT_THAT(Bytes(bytes.begin(), bytes.begin() + 12),
              ElementsAre(0xFF, 0xFF, 0xFE, 8, 0x83, 40, 1, 1, 1, 2, 1, 0x48));
  EXPECT_EQ(bytes[12 + 5], 42);
  EXPECT_EQ(bytes.size(), 12U + 14U + 10U);
  EXPECT_THAT(sent(), IsEmpty());
}

TEST_F(Line, ReadingsAreThoseOfTheAnswers) {
  chain.request(0, {});
  const std::uint8_t size = asked(sent());
  send(answer(2, 0x8005, size, heat_alarm));
  send(answer(1, 1234, size));
  const FeetechChain::Transfer done = chain.collect(now() + kLong);
  EXPECT_EQ(done.answered, chain.all());
  EXPECT_EQ(chain[0].position, 1234);
  EXPECT_EQ(chain[1].position, -5);
  EXPECT_EQ(chain[1].status, heat_alarm);
}

TEST_F(Line, TheTorqueSwitchIsReadInEveryTenthTransfer) {
  int known = 0;
  for (int i = 0; i < 30; ++i) known += transfer(1000).torque_known == chain.all() ? 1 : 0;
  EXPECT_EQ(known, 3);
}

TEST_F(Line, AnAnswerThatComesLateIsNeverTakenForANewOneWheneverItComes) {
  for (int failures = 1; failures < 8; ++failures) {
    transfer(1000);
    const std::uint8_t old = fail();
    for (int i = 1; i < failures; ++i) fail();
    const std::uint8_t size = ask();
    send(answer(1, 1000, old));
    send(answer(1, 2000, size));
    send(answer(2, 2000, size));
    const FeetechChain::Transfer done = chain.collect(now() + kLong);
    EXPECT_EQ(done.answered, chain.all());
    EXPECT_EQ(done.late, 1U);
    EXPECT_EQ(chain[0].position, 2000) << "after " << failures << " failures";
  }
}

TEST_F(Line, WhatArrivesBeforeAQuestionIsDropped) {
  transfer(1500);
  send(answer(1, 1000, 8));  // once more, and as long as the next one
  const std::uint8_t size = ask();
  ASSERT_EQ(size, 8);
  send(answer(2, 2000, size));
  const FeetechChain::Transfer done = chain.collect(now());
  EXPECT_EQ(done.answered, 2U);
  EXPECT_EQ(done.late, 0U);
}

TEST_F(Line, WhereNobodyAnswersItAsksRarely) {
  const auto asks = [&] {
    chain.request(0, {});
    const bool asking = chain.is_asking();
    sent();
    chain.collect(now());
    return asking;
  };
  EXPECT_TRUE(asks());
  EXPECT_TRUE(asks());
  EXPECT_TRUE(asks());
  const std::int64_t last = chain.asked_at();
  while (!asks()) {
  }
  EXPECT_GE(chain.asked_at() - last, 100'000'000) << "answers that are late keep their length";
}

TEST_F(Line, NothingIsSentWhileTheLineIsNotSilentAfterAFailure) {
  fail();
  send({0xFF});
  chain.queue_torque(chain.all(), true);
  chain.request(chain.all(), kGoals);
  EXPECT_FALSE(chain.is_asking());
  EXPECT_THAT(sent(), IsEmpty()) << "it would collide with a servo that still answers";
  while (!chain.is_asking()) {
    chain.collect(now() + kLong);
    chain.request(chain.all(), kGoals);
  }
  EXPECT_EQ(sent()[5], 40) << "what was queued is kept";
}

TEST_F(Line, AnAnswerCountsOnceAndOnlyOfAServoOfTheChain) {
  chain.request(0, {});
  const std::uint8_t size = asked(sent());
  send(answer(1, 1000, size));
  send(answer(1, 1500, size));
  send(answer(7, 1500, size));
  send(answer(2, 1000, size));
  const FeetechChain::Transfer done = chain.collect(now() + kLong);
  EXPECT_EQ(done.late, 2U);
  EXPECT_EQ(chain[0].position, 1000);
}

TEST_F(Line, ADamagedAnswerIsCountedAndTheOthersAreTaken) {
  chain.request(0, {});
  const std::uint8_t size = asked(sent());
  Bytes damaged = answer(1, 1000, size);
  damaged[6] ^= 1;
  send(damaged);
  send(answer(2, 1000, size));
  const FeetechChain::Transfer done = chain.collect(now());
  EXPECT_EQ(done.answered, 2U);
  EXPECT_EQ(done.damaged, 1U);
}

TEST_F(Line, AnAdapterThatIsUnpluggedIsSeenAtOnce) {
  chain.request(0, {});
  ::close(std::exchange(end, -1));
  EXPECT_EQ(chain.collect(now() + kLong).answered, 0U);
  EXPECT_FALSE(chain.port().is_open());
  chain.request(0, {});
  EXPECT_FALSE(chain.is_asking());
}

TEST_F(Line, NothingAllocates) {
  transfer(1000);
  const Bytes first = answer(1, 1000, 8);
  const std::size_t before = allocations;
  for (int i = 0; i < 100; ++i) {
    chain.queue(feetech::kStrength, chain.all(), 300);
    chain.request(chain.all(), kGoals);
    ::send(end, first.data(), first.size(), 0);
    chain.collect(now());
  }
  EXPECT_EQ(allocations, before);
}

}  // namespace
}  // namespace o80::arms
