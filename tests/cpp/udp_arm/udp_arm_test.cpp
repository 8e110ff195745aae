#include "examples/udp_arm/udp_arm.hpp"

#include <gmock/gmock.h>

#include <stdexcept>

#include "count_allocations.hpp"
#include "lock_step.hpp"

namespace udp_arm {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

TEST(UdpArm, HasAnIterationForEachTickOfTheArm) {
  LockStep arm;
  arm.desired.fill(1.0);
  std::uint64_t tick = arm.iterate().link.tick;
  for (int i = 0; i < 50; ++i) {
    const Row row = arm.iterate();
    ASSERT_EQ(row.link.tick, ++tick);
    ASSERT_FALSE(row.missed);
    ASSERT_EQ(row.position, arm.fake.state().position);
  }
  EXPECT_NEAR(arm.iterate().position[5], 1.0, 1e-6);
}

TEST(UdpArm, KeepsTheReadingWhenAPacketIsLostAndCountsAMissedTick) {
  LockStep arm;
  arm.desired.fill(1.0);
  arm.iterate();
  const Row before = arm.iterate();
  arm.fake.play(LinkFaults("drop 1-4"));
  for (std::uint32_t i = 1; i <= 4; ++i) {
    const Row lost = arm.iterate_in_vain();
    EXPECT_TRUE(lost.missed);
    EXPECT_EQ(lost.link.missed, before.link.missed + i);
    EXPECT_EQ(lost.position, before.position);
    EXPECT_EQ(lost.halt, "") << "four are tolerated";
  }
  const Row after = arm.iterate();
  EXPECT_FALSE(after.missed);
  EXPECT_EQ(after.link.tick, before.link.tick + 5);
  EXPECT_EQ(after.halt, "");
}

TEST(UdpArm, TheArmGoesOnWhileStatesAreLost) {
  LockStep arm;
  arm.desired.fill(1.0);
  for (int i = 0; i < 1000 && arm.fake.mode() != Mode::moving; ++i) arm.iterate();
  arm.fake.play(LinkFaults("drop 1-3"));
  const double before = arm.fake.state().position[0];
  arm.desired.fill(2.0);
  for (int i = 0; i < 3; ++i) arm.iterate_in_vain();
  for (int i = 0; i < 1000 && arm.fake.state().position[0] < before + 0.5; ++i) arm.iterate();
  EXPECT_GT(arm.fake.state().position[0], before + 0.5);
  EXPECT_EQ(arm.fake.mode(), Mode::moving);
}

TEST(UdpArm, HaltsWhenMoreTicksInARowAreMissedThanAreTolerated) {
  LockStep arm({.tolerated = 2});
  arm.fake.play(LinkFaults("drop 1-4"));
  arm.iterate_in_vain();
  EXPECT_EQ(arm.iterate_in_vain().halt, "");
  EXPECT_THAT(arm.iterate_in_vain().halt, HasSubstr("sends nothing in time"));
  EXPECT_THAT(arm.driver.resume().text.data(), HasSubstr("sends nothing in time"));
  const std::string again = arm.iterate_in_vain().halt;
  EXPECT_EQ(arm.iterate().halt, again) << "until somebody resumes";
  EXPECT_EQ(arm.driver.resume().kind, o80::Served::Kind::done);
  EXPECT_EQ(arm.iterate().halt, "");
}

TEST(UdpArm, IsResumedAlthoughAsManyTicksAreMissedAsAreTolerated) {
  LockStep arm({.tolerated = 2});
  arm.fake.play(LinkFaults("drop 1-2"));
  arm.iterate_in_vain();
  arm.iterate_in_vain();
  EXPECT_EQ(arm.driver.resume().kind, o80::Served::Kind::done);
}

TEST(UdpArm, ALatePacketNeitherEndsAnIterationNorIsLost) {
  LockStep arm;
  const Row before = arm.iterate();
  arm.fake.play(LinkFaults("late 1"));
  EXPECT_TRUE(arm.iterate_in_vain().missed);
  const Row after = arm.iterate();
  EXPECT_FALSE(after.missed);
  EXPECT_EQ(after.link.tick, before.link.tick + 2) << "two iterations for two ticks";
  EXPECT_EQ(after.link.late, before.link.late + 1);
  EXPECT_EQ(after.link.missed, before.link.missed + 1);
}

TEST(UdpArm, APacketThatComesTwiceOrBehindItsSuccessorIsIgnored) {
  LockStep arm;
  const Row before = arm.iterate();
  arm.fake.play(LinkFaults("twice 1, swap 3"));
  arm.iterate();
  arm.iterate();
  EXPECT_TRUE(arm.iterate_in_vain().missed) << "it comes behind the next one";
  EXPECT_FALSE(arm.iterate().missed);
  const Row after = arm.iterate();
  EXPECT_EQ(after.link.repeated, before.link.repeated + 2);
  EXPECT_EQ(after.link.tick, before.link.tick + 5);
  EXPECT_EQ(after.link.late, before.link.late);
}

TEST(UdpArm, AfterADelayOfItsOwnProcessOnlyTheNewestPacketCounts) {
  LockStep arm;
  const Row before = arm.iterate();
  for (int i = 0; i < 7; ++i) arm.fake.tick();
  Row row = arm.hear();
  while (row.link.tick < before.link.tick + 7) row = arm.hear();  // the kernel may be slow
  EXPECT_TRUE(arm.miss().missed) << "nothing of the delay is left for an iteration of its own";
}

TEST(UdpArm, StaysInStepWhenTheArmLeavesOutATick) {
  LockStep arm;
  const Row before = arm.iterate();
  EXPECT_TRUE(arm.miss().missed) << "the arm did not tick";
  // its next packet comes a period later, with the number that was missed
  arm.fake.tick();
  Row row = arm.miss();
  for (int i = 0; i < 1000 && row.missed; ++i) row = arm.miss();  // the kernel may be slow
  EXPECT_FALSE(row.missed);
  EXPECT_EQ(row.link.tick, before.link.tick + 1);
  EXPECT_EQ(arm.iterate().link.tick, before.link.tick + 2);
}

TEST(UdpArm, HaltsWhenTheArmWasRestartedAndDoesNotMoveItUntilResumed) {
  LockStep arm({.tolerated = 100});
  arm.desired.fill(1.0);
  for (int i = 0; i < 50; ++i) arm.iterate();
  arm.fake.play(LinkFaults("restart 1-3"));
  for (int i = 0; i < 3; ++i) EXPECT_TRUE(arm.iterate_in_vain().missed);
  const Row back = arm.iterate();
  EXPECT_THAT(back.halt, HasSubstr("restarted"));
  EXPECT_EQ(back.link.restarts, 1U);
  EXPECT_FALSE(back.missed);
  // far from where it stands: nobody may follow that
  const double place = arm.fake.state().position[0];
  arm.desired.fill(-2.0);
  for (int i = 0; i < 20; ++i) {
    const Row row = arm.iterate();
    ASSERT_THAT(row.halt, HasSubstr("restarted"));
    ASSERT_EQ(row.position[0], place);
  }
  EXPECT_EQ(arm.driver.resume().kind, o80::Served::Kind::done);
  arm.desired = arm.fake.state().position;  // a fresh start
  EXPECT_EQ(arm.iterate().halt, "");
  arm.desired.fill(0.5);
  for (int i = 0; i < 1000 && arm.fake.state().position[0] > 0.6; ++i) arm.iterate();
  EXPECT_LT(arm.fake.state().position[0], 0.6);
}

TEST(UdpArm, HaltsWhenTheArmStoppedForWantOfCommands) {
  LockStep arm({.tolerated = 1000}, 20);
  arm.desired.fill(1.0);
  for (int i = 0; i < 1000 && arm.fake.mode() != Mode::moving; ++i) arm.iterate();
  arm.fake.play(LinkFaults("deaf 1-30"));
  Row row;
  for (int i = 0; i < 30; ++i) row = arm.iterate();
  EXPECT_EQ(arm.fake.mode(), Mode::timed_out);
  EXPECT_THAT(row.halt, HasSubstr("no command reached it"));
  EXPECT_THAT(arm.driver.resume().text.data(), HasSubstr("its own stop"));
  for (int i = 0; i < 1000 && arm.fake.mode() != Mode::ready; ++i) arm.iterate();
  arm.iterate();
  EXPECT_EQ(arm.driver.resume().kind, o80::Served::Kind::done);
  for (int i = 0; i < 1000 && arm.fake.mode() != Mode::moving; ++i) arm.iterate();
  EXPECT_EQ(arm.fake.mode(), Mode::moving);
}

TEST(UdpArm, GivesUpAfterALongSilence) {
  LockStep arm({.give_up = 0.1});
  arm.fake.play(LinkFaults("drop 1-100"));
  for (int i = 1; i <= 10; ++i) ASSERT_EQ(arm.iterate_in_vain().fault, "") << i;
  EXPECT_THAT(arm.iterate_in_vain().fault, HasSubstr("--give-up"));
}

TEST(UdpArm, AFailureOfTheArmIsAFault) {
  LockStep arm;
  arm.fake.play(LinkFaults("fail 1"));
  EXPECT_THAT(arm.iterate().fault, HasSubstr("failure of its hardware"));
}

TEST(UdpArm, SaysWhichFrequencyTheArmHas) {
  LockStep arm;
  arm.period = 1'000'000;
  EXPECT_THAT(arm.iterate().fault, HasSubstr("--frequency 100"));
}

TEST(UdpArm, ItsVerbsAllocateNothingWhateverTheLinkDoes) {
  LockStep arm({.tolerated = 2});
  arm.fake.play(LinkFaults("drop 5, late 8, twice 10, swap 12, drop 20-40, restart 50-60"));
  std::size_t all = 0;
  for (int i = 0; i < 100; ++i) {
    arm.fake.tick();
    const std::size_t before = allocations;
    arm.write();
    arm.driver.wait(0);
    all += allocations - before;
  }
  EXPECT_EQ(all, 0U);
}

TEST(UdpArm, IgnoresWhatIsNoPacketOfTheProtocol) {
  UdpSocket arm;
  arm.bind("127.0.0.1", 0);
  UdpArm driver({.port = arm.port()});
  sockaddr_in peer{};
  std::thread answer([&] {
    Command command;
    while (arm.receive(command, &peer) != UdpSocket::Received::packet) {
      arm.wait_until(now() + 10'000'000);
    }
    arm.send_to(std::array<char, 3>{}, peer);
    arm.send_to(std::array<char, sizeof(State)>{}, peer);
    arm.send_to(std::array<char, 2 * sizeof(State)>{}, peer);
    arm.send_to(State{.session = 7, .tick = 41}, peer);
  });
  driver.start();
  answer.join();
  arm.send_to(std::array<char, sizeof(State)>{}, peer);
  arm.send_to(State{.session = 7, .tick = 42, .position = {0.5}}, peer);
  driver.wait(now() + 60'000'000'000);
  driver.stop();
}

TEST(UdpArm, RefusesAnAddressThatIsNoneBeforeItSendsAnything) {
  for (const UdpArm::Config& config :
       {UdpArm::Config{.address = "localhost"}, UdpArm::Config{.port = 70000}}) {
    UdpArm driver(config);
    EXPECT_THAT([&] { driver.start(); }, ThrowsMessage<std::runtime_error>(HasSubstr("address")));
  }
}

TEST(LinkFaults, RefusesAScriptThatItDoesNotUnderstand) {
  for (const char* script : {"dorp 5", "drop", "drop 5-", "drop 5+6", "late x"}) {
    EXPECT_THAT([&] { LinkFaults{script}; },
                ThrowsMessage<std::invalid_argument>(HasSubstr("is not a fault")))
        << script;
  }
  const LinkFaults faults("drop 5-7, fail 9");
  EXPECT_FALSE(faults.has(LinkFaults::What::drop, 4));
  EXPECT_TRUE(faults.has(LinkFaults::What::drop, 7));
  EXPECT_TRUE(faults.has(LinkFaults::What::fail, 1000));
}

}  // namespace
}  // namespace udp_arm
