#include "arms/dynamixel.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <vector>

#include "packet_rig.hpp"

namespace o80::arms::dynamixel {
namespace {

using testing::ElementsAre;
using testing::ElementsAreArray;

Bytes sent(const Requests& requests) { return {requests.bytes().begin(), requests.bytes().end()}; }

/// A packet with this body, which has no header inside.
Bytes packet(std::uint8_t id, const Bytes& body) {
  Bytes whole{0xFF, 0xFF, 0xFD, 0, id, static_cast<std::uint8_t>(body.size() + 2), 0};
  whole.insert(whole.end(), body.begin(), body.end());
  const std::uint16_t sum = crc(whole);
  whole.push_back(static_cast<std::uint8_t>(sum & 0xFF));
  whole.push_back(static_cast<std::uint8_t>(sum >> 8));
  return whole;
}

TEST(DynamixelRequests, HaveTheSumOfTheManualsPing) {
  EXPECT_EQ(crc(Bytes{0xFF, 0xFF, 0xFD, 0x00, 0x01, 0x03, 0x00, 0x01}), 0x4E19);
}

TEST(DynamixelRequests, AreThePacketsOfTheManual) {
  Requests requests;
  requests.read(1, 132, 4);
  EXPECT_THAT(sent(requests), ElementsAre(0xFF, 0xFF, 0xFD, 0x00, 0x01, 0x07, 0x00, 0x02, 0x84,
                                          0x00, 0x04, 0x00, 0x1D, 0x15));
  requests.clear();
  const std::array<Value, 2> goals{{{1, 150}, {2, 170}}};
  requests.sync_write(kGoal, goals);
  EXPECT_THAT(sent(requests),
              ElementsAre(0xFF, 0xFF, 0xFD, 0x00, 0xFE, 0x11, 0x00, 0x83, 0x74, 0x00, 0x04, 0x00,
                          0x01, 0x96, 0x00, 0x00, 0x00, 0x02, 0xAA, 0x00, 0x00, 0x00, 0x82, 0x87));
  requests.clear();
  const std::array<Block, 2> blocks{{{1, 144, 2}, {2, 146, 1}}};
  requests.bulk_read(blocks);
  EXPECT_THAT(sent(requests),
              ElementsAre(0xFF, 0xFF, 0xFD, 0x00, 0xFE, 0x0D, 0x00, 0x92, 0x01, 0x90, 0x00, 0x02,
                          0x00, 0x02, 0x92, 0x00, 0x01, 0x00, 0x1A, 0x05));
  requests.clear();
  requests.reboot(1);
  EXPECT_THAT(sent(requests),
              ElementsAre(0xFF, 0xFF, 0xFD, 0x00, 0x01, 0x03, 0x00, 0x08, 0x2F, 0x4E));
}

TEST(DynamixelRequests, HaveNoHeaderInsideAndAnswersLoseItsStuffing) {
  Requests requests;
  const std::array<Value, 2> goals{{{0xFD, static_cast<int>(0xFDFFFF12)}, {3, -3 << 16 | 0xFFFF}}};
  requests.sync_write(kGoal, goals);
  const Bytes body(requests.bytes().begin() + 8, requests.bytes().end() - 2);
  EXPECT_THAT(body, ElementsAre(116, 0, 4, 0,                        //
                                0xFD, 0x12, 0xFF, 0xFF, 0xFD, 0xFD,  //
                                3, 0xFF, 0xFF, 0xFD, 0xFD, 0xFF));
  Answers answers;
  const Bytes stuffed = packet(1, {0x55, 0, 0xFF, 0xFF, 0xFD, 0xFD, 7});
  EXPECT_THAT(heard(answers, stuffed, 3), ElementsAre(Heard{1, 0, {0xFF, 0xFF, 0xFD, 7}}));
}

TEST(DynamixelRequests, LeaveOutWhatDoesNotFit) {
  Requests requests;
  std::array<Value, 70> many{};
  std::size_t size = 0;
  while (requests.fits()) {
    size = requests.bytes().size();
    requests.sync_write(kGoal, many);
  }
  EXPECT_GT(size, 500U);
  EXPECT_EQ(requests.bytes().size(), size) << "half a packet would be garbage to the servos";
}

TEST(DynamixelAnswers, AreFoundInAnyPiecesAndBetweenGarbage) {
  const Bytes garbage{0x00, 0xFF, 0xFF, 0x12};
  const Bytes echo = packet(1, {2, 132, 0, 4, 0});
  const Bytes bytes = echo + packet(1, {0x55, 0, 1, 2}) + garbage + packet(2, {0x55, 0x80, 3}) +
                      Bytes{0xFF} + packet(3, {0x55, 0});
  for (std::size_t step = 1; step <= bytes.size(); ++step) {
    Answers answers;
    EXPECT_THAT(heard(answers, bytes, step),
                ElementsAre(Heard{1, 0, {1, 2}}, Heard{2, 0x80, {3}}, Heard{3, 0, {}}));
  }
}

TEST(DynamixelAnswers, AreNeverWrongWithOneBitFlippedAndThoseBehindAreFound) {
  const Bytes first = packet(1, {0x55, 0, 0x34, 0x0A, 0x00, 0x00, 52, 25});
  const Bytes good = packet(2, {0x55, 0, 0x00, 0x08, 0x00, 0x00, 52, 25});
  Bytes more;
  for (int i = 0; i < 20; ++i) more = more + good;
  for (std::size_t at = 0; at < first.size() * 8; ++at) {
    Bytes damaged = first;
    damaged[at / 8] ^= static_cast<std::uint8_t>(1U << at % 8);
    Answers answers;
    const std::vector<Heard> all = heard(answers, damaged + more, damaged.size());
    for (const Heard& each : all) ASSERT_EQ(each.id, 2) << "bit " << at;
    // a length that seems greater swallows what follows, but nothing for ever
    ASSERT_GE(all.size(), 2U) << "bit " << at;
    ASSERT_EQ(answers.damaged(), 1U) << "bit " << at;
  }
}

}  // namespace
}  // namespace o80::arms::dynamixel
