// A batch drops what it itself overwrites or purges before it is taken: nobody sees a difference,
// but in the work of the iteration that takes it.
#include <gtest/gtest.h>

#include <cstdint>
#include <functional>
#include <random>
#include <vector>

#include "cases.hpp"
#include "control/rig.hpp"

namespace o80::test {
namespace {

constexpr std::uint32_t kActuators = 3;

Schema robot() {
  Schema schema = plain_robot(kActuators);
  schema.actuator(1).when_idle(WhenIdle::follow);
  schema.add_request("nothing", kNoType, "no payload");
  return schema;
}

/// Adds one record to a rig's batch.
using Record = std::function<void(Rig&)>;

Record any_record(std::mt19937& random) {
  const std::uint32_t actuator = random() % kActuators;
  const auto which = static_cast<std::uint16_t>(random() % 3 == 0 ? kEveryActuator : actuator);
  const double target = static_cast<double>(random() % 100);
  RecordHead head = random() % 4 == 0 ? smoothly(over(1 + random() % 9)) : over(1 + random() % 9);
  switch (random() % 12) {
    case 0:
      return [=](Rig& rig) { rig.batch.purge(which); };
    case 1:
      return [=](Rig& rig) { rig.batch.purge_own(which); };
    case 2:
      return [](Rig& rig) { rig.batch.request(0, {}); };
    case 3:
      return [](Rig& rig) { rig.batch.take_control(); };
    case 4:
    case 5:
    case 6:
      head = overwriting(head);
      [[fallthrough]];
    default:
      return [=](Rig& rig) { rig.add(actuator, head, {target}); };
  }
}

struct End {
  Status status;
  Reason reason;
  Iteration iteration;
  friend bool operator==(const End&, const End&) = default;
};

End end_of(const Rig& rig, CommandId id, std::uint32_t lane) {
  const StatusChange last = rig.witness.last(id, lane);
  return {last.status, last.reason, last.iteration};
}

TEST(BatchPlan, ABatchIsTakenAsIfItsRecordsWereTakenOneAfterTheOther) {
  for (std::uint32_t seed = 0; seed < cases(400U); ++seed) {
    std::mt19937 random(seed);  // NOLINT(bugprone-random-generator-seed)
    Rig whole(robot());
    Rig single(robot());
    whole.fresh_start = single.fresh_start = random() % 2 == 0;
    struct Pair {
      std::uint32_t lane;
      CommandId whole;
      CommandId single;
    };
    std::vector<Pair> records;
    for (int round = 0; round < 12; ++round) {
      const std::uint32_t lane = random() % 2;
      const std::uint32_t count = 1 + random() % 25;
      std::vector<CommandId> ids;
      for (std::uint32_t i = 0; i < count; ++i) {
        const Record record = any_record(random);
        record(whole);
        record(single);
        ids.push_back(record_id(single.pulse(lane), 0));
        if (whole.batch.requests() == kMaxRequests || whole.batch.orders() == kMaxOrders) {
          break;
        }
      }
      const BlockIndex first = whole.send(lane);
      const CommandId batch = whole.sent;
      while (!whole.check(lane, first, 1 + random() % 5)) {
      }
      whole.controller.take(lane, first, whole);
      for (std::size_t i = 0; i < ids.size(); ++i) {
        records.push_back({lane, record_id(batch, i), ids[i]});
      }
      ASSERT_EQ(whole.next, single.next);
      for (std::uint32_t i = random() % 12; i > 0; --i) {
        const double observed = static_cast<double>(random() % 50);
        for (Rig* rig : {&whole, &single}) {
          rig->observe(8, observed);
          rig->step();
        }
        for (std::uint32_t actuator = 0; actuator < kActuators; ++actuator) {
          ASSERT_EQ(whole.desired(actuator), single.desired(actuator)) << seed;
          ASSERT_EQ(whole.active(actuator), single.active(actuator)) << seed;
        }
      }
    }
    for (int i = 0; i < 4000 && (whole.controller.active() || whole.controller.pending()); ++i) {
      whole.step();
      single.step();
    }
    for (std::size_t i = 0; i < records.size(); ++i) {
      ASSERT_EQ(end_of(whole, records[i].whole, records[i].lane),
                end_of(single, records[i].single, records[i].lane))
          << "record " << i << " of seed " << seed;
    }
    ASSERT_TRUE(whole.all_blocks_back());
  }
}

TEST(BatchPlan, TakingThousandsOfOverwritesAndPurgesCostsNoMoreThanTheirActuators) {
  Rig rig(robot(), 1U << 15);
  for (int i = 0; i < 5000; ++i) {
    rig.add(i % kActuators, overwriting(over(9)), {1.0});
    rig.batch.purge(i % 2 == 0 ? kEveryActuator : static_cast<std::uint16_t>(i % kActuators));
    rig.batch.purge_own(kEveryActuator);
  }
  const BlockIndex batch = rig.send();
  while (!rig.check(0, batch, 1000)) {
  }
  EXPECT_LT(rig.controller.effort(batch).work, 100U);
  rig.controller.take(0, batch, rig);
  rig.witness.keep = false;
  while (rig.controller.pending()) rig.step();
  EXPECT_TRUE(rig.all_blocks_back());
}

TEST(BatchPlan, RejectsTheRequestsAndControlOrdersBeyondTheMost) {
  Rig rig(robot());
  for (std::uint32_t i = 0; i < kMaxRequests + 2; ++i) rig.batch.request(0, {});
  for (std::uint32_t i = 0; i < kMaxOrders + 2; ++i) rig.batch.release_control();
  const CommandId batch = rig.pulse();
  rig.step();
  EXPECT_EQ(rig.requests.size(), kMaxRequests);
  EXPECT_EQ(rig.controls.size(), kMaxOrders);
  EXPECT_EQ(rig.witness.status(record_id(batch, kMaxRequests - 1)), Status::completed);
  EXPECT_EQ(rig.witness.last(record_id(batch, kMaxRequests)).reason, Reason::invalid);
  EXPECT_TRUE(rig.all_blocks_back());
}

TEST(BatchPlan, KnowsWhatIsExpress) {
  Rig rig(robot());
  const auto effort = [&] {
    const BlockIndex batch = rig.send();
    rig.check(0, batch, 1000);
    const Effort found = rig.controller.effort(batch);
    rig.controller.take(0, batch, rig);
    return found;
  };
  rig.batch.purge(1);
  rig.batch.take_control();
  EXPECT_TRUE(effort().express);
  rig.batch.purge(1);
  rig.batch.release_control();
  EXPECT_TRUE(effort().releases);
  rig.batch.purge(1);
  rig.add(0, over(1), {1.0});
  EXPECT_FALSE(effort().express);
  rig.batch.request(0, {});
  EXPECT_FALSE(effort().express);
  EXPECT_EQ(rig.requests.size(), 1U);
  rig.batch.purge(kActuators);  // there is none
  EXPECT_FALSE(effort().express);
  rig.batch.mark("it is taken in its turn");
  const Effort mark = effort();
  EXPECT_FALSE(mark.express);
  EXPECT_TRUE(mark.free);
  EXPECT_FALSE(mark.moves);
  rig.batch.mark("with a command");
  rig.add(0, over(1), {1.0});
  EXPECT_FALSE(effort().free);
  rig.batch.resume(1);
  EXPECT_TRUE(effort().free);
  rig.batch.resume(1);
  rig.batch.purge(1);
  EXPECT_FALSE(effort().free) << "nothing else passes with it";
}

TEST(BatchPlan, AMarkIsCompletedAtOnceWhateverItsLength) {
  Rig rig(robot());
  rig.add(0, over(3), {1.0});
  const CommandId moving = rig.pulse();
  for (const std::size_t length :
       {std::size_t{1}, std::size_t{16}, std::size_t{17}, std::size_t{kMaxMarkBytes}}) {
    rig.batch.mark(std::string(length, 'x'));
    const CommandId batch = rig.pulse();
    rig.step();
    EXPECT_EQ(rig.witness.status(record_id(batch, 0)), Status::completed) << length;
  }
  EXPECT_THROW(rig.batch.mark(""), InvalidArgument);
  EXPECT_THROW(rig.batch.mark(std::string(kMaxMarkBytes + 1, 'x')), InvalidArgument);
  rig.run(4);
  EXPECT_EQ(rig.witness.status(record_id(moving, 0)), Status::completed);
  EXPECT_TRUE(rig.all_blocks_back());
}

/// Takes a batch as if it had this ticket.
CommandId pulse_with(Rig& rig, std::uint64_t ticket, std::uint32_t lane = 0) {
  const BlockIndex first = rig.send(lane);
  reinterpret_cast<BatchRecord*>(rig.pool.bytes(first))->ticket = ticket;
  const CommandId batch = rig.sent;
  rig.controller.take(lane, first, rig);
  return record_id(batch, 0);
}

TEST(PurgeTickets, EndWhatIsTakenLaterWithALowerOne) {
  Rig rig(robot());
  rig.add(0, over(9), {1.0});
  const CommandId running = pulse_with(rig, 20);
  rig.batch.purge(0);
  pulse_with(rig, 10);
  EXPECT_FALSE(rig.controller.active()) << "all that is queued, as ever";
  rig.add(0, over(9), {1.0});
  const CommandId older = pulse_with(rig, 9, 1);
  rig.add(0, over(9), {2.0});
  const CommandId newer = pulse_with(rig, 11, 1);
  rig.add(0, overwriting(over(9)), {3.0});
  const CommandId overwriter = pulse_with(rig, 8);
  rig.add(2, over(9), {4.0});
  const CommandId other = pulse_with(rig, 7);
  rig.run(10);
  EXPECT_EQ(rig.witness.status(running), Status::purged);
  EXPECT_EQ(rig.witness.status(older, 1), Status::purged);
  EXPECT_EQ(rig.witness.status(newer, 1), Status::completed) << "no older one overwrites it";
  EXPECT_EQ(rig.witness.status(overwriter), Status::purged);
  EXPECT_EQ(rig.witness.status(other), Status::completed);
  EXPECT_TRUE(rig.all_blocks_back());
}

TEST(PurgeTickets, OfALanesOwnPurgeEndOnlyWhatThatLaneSent) {
  Rig rig(robot());
  rig.batch.purge_own(kEveryActuator);
  pulse_with(rig, 10, 1);
  rig.add(0, over(3), {1.0});
  const CommandId own = pulse_with(rig, 9, 1);
  rig.add(0, over(3), {1.0});
  const CommandId others = pulse_with(rig, 9, 2);
  rig.run(4);
  EXPECT_EQ(rig.witness.status(own, 1), Status::purged);
  EXPECT_EQ(rig.witness.status(others, 2), Status::completed);
}

TEST(PurgeTickets, AreForgottenWhenTicketsBeginAnew) {
  Rig rig(robot());
  rig.batch.purge(kEveryActuator);
  pulse_with(rig, 1000);
  rig.controller.forget_tickets();
  rig.add(0, over(3), {1.0});
  const CommandId command = pulse_with(rig, 1);
  rig.run(4);
  EXPECT_EQ(rig.witness.status(command), Status::completed);
}

}  // namespace
}  // namespace o80::test
