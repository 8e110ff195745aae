#include "arms/feetech.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <vector>

#include "packet_rig.hpp"

namespace o80::arms::feetech {
namespace {

using testing::ElementsAre;

Bytes answer(std::uint8_t id, std::uint8_t status, const Bytes& data) {
  Bytes packet{0xFF, 0xFF, id, static_cast<std::uint8_t>(data.size() + 2), status};
  packet.insert(packet.end(), data.begin(), data.end());
  std::uint8_t sum = 0;
  for (std::size_t i = 2; i < packet.size(); ++i) sum = static_cast<std::uint8_t>(sum + packet[i]);
  packet.push_back(static_cast<std::uint8_t>(~sum));
  return packet;
}

TEST(FeetechRequests, AreThePacketsOfTheManual) {
  Requests requests;
  requests.read(1, 0x38, 2);
  EXPECT_THAT(Bytes(requests.bytes().begin(), requests.bytes().end()),
              ElementsAre(0xFF, 0xFF, 0x01, 0x04, 0x02, 0x38, 0x02, 0xBE));
  requests.clear();
  const std::array<Value, 2> goals{{{1, 0x0800}, {2, 0x0123}}};
  requests.sync_write(kGoal, goals);
  const std::array<std::uint8_t, 2> ids{1, 2};
  requests.sync_read(0x38, 8, ids);
  EXPECT_THAT(
      Bytes(requests.bytes().begin(), requests.bytes().end()),
      ElementsAre(0xFF, 0xFF, 0xFE, 0x0A, 0x83, 0x2A, 0x02, 1, 0x00, 0x08, 2, 0x23, 0x01, 0x19,  //
                  0xFF, 0xFF, 0xFE, 0x06, 0x82, 0x38, 0x08, 1, 2, 0x36));
}

TEST(FeetechRequests, LeaveOutWhatDoesNotFit) {
  Requests requests;
  std::array<Value, 100> many{};
  std::size_t size = 0;
  while (requests.fits()) {
    size = requests.bytes().size();
    requests.sync_write(kGoal, many);
  }
  EXPECT_GT(size, 500U);
  EXPECT_EQ(requests.bytes().size(), size) << "half a packet would be garbage to the servos";
}

TEST(FeetechAnswers, AreFoundInAnyPiecesAndBetweenGarbage) {
  const Bytes garbage{0x00, 0xFF, 0x12};
  const Bytes bytes = answer(1, 0, {1, 2}) + garbage + answer(2, 32, {0xFF, 0xFF, 3}) +
                      Bytes{0xFF} + answer(3, 0, {});
  for (std::size_t step = 1; step <= bytes.size(); ++step) {
    Answers answers;
    EXPECT_THAT(heard(answers, bytes, step),
                ElementsAre(Heard{1, 0, {1, 2}}, Heard{2, 32, {0xFF, 0xFF, 3}}, Heard{3, 0, {}}));
  }
}

TEST(FeetechAnswers, AreNeverWrongWithOneBitFlippedAndThoseBehindAreFound) {
  const Bytes first = answer(1, 0, {0x34, 0x0A, 0x00, 0x00, 52, 25});
  const Bytes good = answer(2, 0, {0x00, 0x08, 0x00, 0x00, 52, 25});
  const Bytes more = good + good + good + good + good + good + good + good;
  for (std::size_t at = 0; at < first.size() * 8; ++at) {
    Bytes damaged = first;
    damaged[at / 8] ^= static_cast<std::uint8_t>(1U << at % 8);
    Answers answers;
    const std::vector<Heard> all = heard(answers, damaged + more, damaged.size());
    ASSERT_FALSE(all.empty());
    // a length of one more ends with the 0xFF behind it, and the sum is right: it has another size
    for (const Heard& each : all)
      ASSERT_TRUE(each.id == 2 || each.data.size() != 6) << "bit " << at;
    // a length that seems greater swallows what follows, but nothing for ever
    ASSERT_GE(all.size(), 2U) << "bit " << at;
  }
}

TEST(FeetechNumbers, HaveASignOfTheirOwn) {
  for (const int value : {-2047, -1, 0, 1, 2047}) {
    EXPECT_EQ(signed_by_bit(with_sign_bit(value, 11), 11), value);
  }
  EXPECT_EQ(with_sign_bit(-12, 15), 0x800C);
}

}  // namespace
}  // namespace o80::arms::feetech
