#include "robot/group/inline_group.hpp"

#include <malloc.h>
#include <sys/resource.h>

#include <atomic>
#include <filesystem>
#include <thread>

#include "memory/child_process.hpp"
#include "o80/memory/segment_list.hpp"
#include "robot/fake_simulator.hpp"

namespace o80::test {
namespace {

class InlineGroupTest : public ManualBackendTest {
 protected:
  static InlineGroup::Options group_of(std::size_t copies, std::size_t threads = 2,
                                       const InlineGroup* sharing = nullptr) {
    return {.copies = copies,
            .threads = threads,
            .sharing = sharing,
            .backend = InlineGroup::default_options()};
  }
};

std::vector<std::byte> dawdle(std::size_t copies) {
  return std::vector<std::byte>(copies * sizeof(Dawdle));
}

std::size_t open_files() {
  const std::filesystem::directory_iterator files("/proc/self/fd");
  return static_cast<std::size_t>(std::distance(begin(files), end(files)));
}

TEST_F(InlineGroupTest, SendsNoBatchForTargetsOfEachIterationUnlessAJournalNeedsIt) {
  for (const std::int64_t journal : {0, 1 << 20}) {
    InlineGroup::Options options = group_of(1);
    options.backend.journal = journal;
    InlineGroup group(fake(), {}, options);
    const auto batches = [&, frontend = group.attach(0)] {
      return frontend->link()->segment.view().bell().tickets.load();
    };
    GroupBurst burst(group, 2, 2, 6);
    burst.plan.command.pace = iterations(1);
    const std::uint64_t before = batches();
    burst.run();
    EXPECT_EQ(batches() - before, journal == 0 ? 0 : 1);
    burst.plan.command.pace = iterations(3);
    burst.run();
    EXPECT_EQ(batches() - before, journal == 0 ? 1 : 2);
  }
}

TEST_F(InlineGroupTest, IsFollowedByAnotherGroupCopyByCopyInTheSameCall) {
  InlineGroup leader(fake(), {}, group_of(9, 3));
  InlineGroup follower(fake(), {}, group_of(9, 2, &leader));
  InlineGroup first(fake(), {}, group_of(9, 1));
  InlineGroup second(fake(), {}, group_of(9, 1));
  GroupBurst leading(leader, 2, 1, 4), following(follower, 2, 4, 4);
  GroupBurst one(first, 2, 1, 4), other(second, 2, 4, 4);
  for (GroupBurst* each : {&leading, &following, &one, &other})
    each->plan.command.pace = iterations(1);

  // observed states of `leader` => targets of `follower`
  const RowLayout layout = leader.description().layout;
  std::vector<InlineGroup::Feed> feeds;
  for (std::uint32_t i = 0; i < 2; ++i) feeds.push_back({layout.observed + 8 * i, 32 * i, 8, 8});
  const InlineGroup::Following then{&follower, &following.plan, feeds};
  leading.plan.then = &then;
  leader.check(leading.plan);
  for (int turn = 0; turn < 50; ++turn) {
    for (std::size_t i = 0; i < one.targets.size(); ++i) {
      leading.targets[i] = one.targets[i] = static_cast<double>((turn * 7 + i * 3) % 20);
    }
    leading.run();
    one.run();
    for (std::size_t copy = 0; copy < 9; ++copy) {
      for (std::size_t step = 0; step < 4; ++step) {
        const std::byte* row = one.of(copy).data() + step * layout.size;
        for (std::size_t i = 0; i < 2; ++i) {
          other.target(copy, i, step) = unpack<double>(row + layout.observed + 8 * i);
        }
      }
    }
    other.run();
    ASSERT_TRUE(leading.rows == one.rows && following.rows == other.rows) << turn;
  }
}

TEST_F(InlineGroupTest, RunsOnlyTheChosenCopies) {
  InlineGroup group(fake(), {}, group_of(4));
  GroupBurst burst(group, 2, 1, 4);
  const std::vector<std::uint32_t> chosen{3, 1};
  group.burst(burst.plan, chosen, kPatience);
  EXPECT_EQ(burst.last_iteration(1), 4);
  EXPECT_EQ(burst.last_iteration(3), 4);
  EXPECT_EQ(group.attach(0)->published(), 0);
  EXPECT_EQ(group.attach(2)->published(), 0);
  for (const std::vector<std::uint32_t>& wrong :
       {std::vector<std::uint32_t>{1, 1}, std::vector<std::uint32_t>{4}}) {
    EXPECT_THROW(group.burst(burst.plan, wrong, kPatience), InvalidArgument);
  }
  burst.run();
  EXPECT_EQ(burst.last_iteration(0), 4);
  EXPECT_EQ(burst.last_iteration(1), 8);
}

// rule G7
TEST_F(InlineGroupTest, NamesTheCopyThatFailsAndRunsTheOthers) {
  InlineGroup group(fake(), {}, group_of(5));
  GroupBurst burst(group, 2, 1, 4);
  burst.target(3, 0) = 200;
  try {
    burst.run();
    FAIL() << "no copy failed";
  } catch (const CopyFailed& failed) {
    EXPECT_THAT(failed.what(), HasSubstr("copy 3 of 'fake' failed"));
    EXPECT_THAT(failed.what(), HasSubstr("left is too far"));
    ASSERT_EQ(failed.failures().size(), 1U);
    EXPECT_EQ(failed.failures()[0].copy, 3U);
    EXPECT_THROW(std::rethrow_exception(failed.failures()[0].error), DriverError);
  }
  for (const std::size_t copy : {0U, 1U, 2U, 4U}) EXPECT_EQ(burst.last_iteration(copy), 4);

  // the others go on without it
  burst.all = {0, 1, 2, 4};
  burst.run();
  EXPECT_EQ(burst.last_iteration(4), 8);
  burst.all = {3};
  EXPECT_THAT(message_of<CopyFailed>([&] { burst.run(); }), HasSubstr("copy 3"));
}

TEST_F(InlineGroupTest, NamesEveryCopyThatFailsButNoLongList) {
  InlineGroup group(fake(), {}, group_of(9));
  GroupBurst burst(group, 2, 1, 4);
  for (const std::size_t copy : {1U, 2U, 4U, 7U, 8U}) burst.target(copy, 0) = 200;
  EXPECT_THAT(message_of<CopyFailed>([&] { burst.run(); }),
              HasSubstr("So did copy 2, copy 4 and 2 more"));
}

/// The error with which requests end that never end by themselves: two threads serve two of them,
/// the others never get their turn. Afterwards each copy goes on from the row that it has reached.
template <class Expected>
void expect_end_between_iterations(InlineGroup& group, Timeout timeout,
                                   const KeepWaiting& keep_waiting) {
  const std::vector<std::uint32_t> all{0, 1, 2, 3};
  EXPECT_THROW(group.request(3, all, dawdle(4), timeout, keep_waiting), Expected);
  std::vector<Iteration> reached;
  for (std::size_t copy = 0; copy < 4; ++copy) reached.push_back(group.attach(copy)->published());
  EXPECT_GT(std::ranges::max(reached), 0);
  EXPECT_EQ(std::ranges::min(reached), 0);
  GroupBurst burst(group, 2, 1, 4);
  burst.run();
  for (std::size_t copy = 0; copy < 4; ++copy) {
    EXPECT_EQ(burst.last_iteration(copy), reached[copy] + 4) << copy;
  }
}

TEST_F(InlineGroupTest, EndsBetweenTwoIterationsWhenItsCallerSaysSoOrThrowsOrHasNoMoreTime) {
  InlineGroup group(fake(), {}, group_of(4));
  expect_end_between_iterations<Cancelled>(group, kPatience, [] { return false; });
  InlineGroup other(fake(), {}, group_of(4));
  expect_end_between_iterations<std::out_of_range>(
      other, kPatience, []() -> bool { throw std::out_of_range("as Ctrl-C in Python"); });
  InlineGroup late(fake(), {}, group_of(4));
  expect_end_between_iterations<TimeoutError>(late, std::chrono::milliseconds(60), {});
}

/// What a burst says within a request of a group of two.
std::string said_within_a_request(InlineGroup& group, GroupBurst& burst) {
  const std::vector<std::uint32_t> all{0, 1};
  std::string said;
  const auto nested = [&] {
    said = message_of<Error>([&] { burst.run(); });
    return false;
  };
  EXPECT_THROW(group.request(3, all, dawdle(2), kPatience, nested), Cancelled);
  return said;
}

TEST_F(InlineGroupTest, LeavesTheOthersTheirCallWhenOneThreadUsesIt) {
  InlineGroup group(fake(), {}, group_of(2));
  GroupBurst burst(group, 2, 1, 4);
  EXPECT_THAT(said_within_a_request(group, burst), HasSubstr("call it from one thread at a time"));
  burst.run();
}

TEST_F(InlineGroupTest, SharesItsThreadsInTurn) {
  InlineGroup leader(fake(), {}, group_of(2));
  InlineGroup follower(fake(), {}, group_of(3, 2, &leader));
  GroupBurst burst(follower, 2, 1, 4);
  EXPECT_EQ(follower.threads(), 2U);
  EXPECT_THAT(said_within_a_request(leader, burst),
              HasSubstr("shares them with: call one after the other"));
  leader.close();
  burst.run();
  EXPECT_EQ(burst.last_iteration(2), 4);
}

TEST_F(InlineGroupTest, ServesRequestsWithAPayloadForEachCopy) {
  InlineGroup group(fake(), {}, group_of(3));
  const std::vector<std::uint32_t> chosen{2, 0};
  std::vector<std::byte> payloads(2 * sizeof(Dawdle));
  pack(Dawdle{.until = 7}, payloads.data());
  pack(Dawdle{.until = 5}, payloads.data() + sizeof(Dawdle));
  group.request(3, chosen, payloads, kPatience);
  EXPECT_EQ(group.attach(0)->published(), 5);
  EXPECT_EQ(group.attach(1)->published(), 0);
  EXPECT_EQ(group.attach(2)->published(), 7);

  std::vector<std::byte> slot(sizeof(Restore));
  const std::vector<std::uint32_t> one{1};
  EXPECT_THAT(message_of<CopyFailed>([&] { group.request(2, one, slot, kPatience); }),
              HasSubstr("copy 1 of 'fake' failed: request 'restore' was not completed: nothing "
                        "was saved there"));
}

TEST_F(InlineGroupTest, RefusesMemoryOfAnotherSizeAndMoreRowsThanTheHistoryHas) {
  InlineGroup group(fake(), {}, group_of(2));
  GroupBurst burst(group, 2, 1, 3);
  InlineGroup::BurstPlan wrong = burst.plan;
  wrong.rows = wrong.rows.first(8);
  EXPECT_THAT(message_of<InvalidArgument>([&] { group.check(wrong); }), HasSubstr("the rows"));
  wrong = burst.plan;
  wrong.targets = wrong.targets.first(8);
  EXPECT_THAT(message_of<InvalidArgument>([&] { group.check(wrong); }), HasSubstr("the targets"));
  EXPECT_THAT(message_of<InvalidArgument>([&] { GroupBurst(group, 2, 1, 65); }),
              HasSubstr("start the group with history=65"));
}

TEST_F(InlineGroupTest, TakesAtMostOneMebibyteACopyAndNoFile) {
  constexpr std::size_t kCopies = 16;
  const std::size_t files = open_files();
  const std::size_t before = mallinfo2().uordblks;
  InlineGroup group(fake(), {}, group_of(kCopies));
  GroupBurst burst(group, 2, 1, 32);
  for (int i = 0; i < 200; ++i) burst.run();
  const std::size_t heap = mallinfo2().uordblks - before;
  const auto link = group.attach(0)->link();
  const std::size_t segment =
      link->segment.header().file_bytes + link->segment.view().offsets.commands_bytes;
  EXPECT_LE(segment + heap / kCopies, std::size_t{1} << 20)
      << "segment " << segment << ", heap " << heap / kCopies;
  EXPECT_EQ(directory_.files(), 0U);
  EXPECT_LE(open_files() - files, 6 * kCopies + 3);
}

TEST_F(InlineGroupTest, RaisesTheSoftLimitOfOpenFilesOrNamesTheHardOne) {
  // limits of a process of its own, because a hard limit cannot be raised again
  ChildProcess child([](const ChildProcess::Ready&) {
    const rlimit low{.rlim_cur = 100, .rlim_max = 400};
    setrlimit(RLIMIT_NOFILE, &low);
    {
      const InlineGroup fits(fake(), {}, group_of(20));
    }
    rlimit now{};
    getrlimit(RLIMIT_NOFILE, &now);
    const std::string said =
        message_of<Error>([] { const InlineGroup larger(fake(), {}, group_of(100)); });
    const bool named = said.find(
                           "100 copies of 'fake' need 900 open files, but the limit of "
                           "this process is 400") != std::string::npos;
    _exit(now.rlim_cur > 100 && named ? 0 : 1);
  });
  EXPECT_EQ(child.wait(), 0);
}

TEST_F(InlineGroupTest, BelongsToTheParentOfAForkedChild) {
#ifdef O80_TEST_SANITIZED
  GTEST_SKIP() << "a sanitizer's own locks may be held by a thread that a forked child lacks";
#endif
  auto group = std::make_unique<InlineGroup>(fake(), OptionValues{}, group_of(3));
  GroupBurst burst(*group, 2, 1, 3);
  burst.run();
  const std::vector<std::uint32_t> all{0, 1, 2};
  ChildProcess child([&](const ChildProcess::Ready&) {
    int refused = 0;
    refused += message_of<UsedAfterFork>([&] { burst.run(); }).empty() ? 0 : 1;
    refused += message_of<UsedAfterFork>([&] { group->attach(0); }).empty() ? 0 : 1;
    refused +=
        message_of<UsedAfterFork>([&] { group->request(3, all, dawdle(3)); }).empty() ? 0 : 1;
    group.reset();
    // a group of its own works
    InlineGroup own(fake(), {}, group_of(2));
    GroupBurst other(own, 2, 1, 3);
    other.run();
    _exit(refused * 10 + static_cast<int>(other.last_iteration(1)));
  });
  EXPECT_EQ(child.wait(), 33);
  burst.run();
  EXPECT_EQ(burst.last_iteration(2), 6);
}

TEST_F(InlineGroupTest, PublishesACopyUnderANameOnRequest) {
  InlineGroup group(fake(), {}, group_of(3));
  GroupBurst burst(group, 2, 1, 3);
  group.publish_as(1, "shown");
  UntypedFrontend watcher("shown", {.access = Access::read_only});
  UntypedFrontend other("shown");
  burst.target(1, 0) = 0.5;
  burst.run();
  EXPECT_EQ(watcher.published(), 3);
  EXPECT_EQ(desired(watcher.latest()), 0.5);
  const Batch theirs = send(other, 1, 0.25, {.pace = iterations(4)});
  burst.plan.actuators = {0};
  burst.plan.targets = burst.plan.targets.first(3 * sizeof(double));
  burst.run();
  burst.run();
  EXPECT_EQ(theirs.handle(0).status, Status::completed);
  EXPECT_THAT(message_of<InvalidArgument>([&] { group.publish_as(3, "none"); }),
              HasSubstr("has copies 0 to 2"));
  group.close();
  EXPECT_EQ(directory_.files(), 0U);
  EXPECT_EQ(watcher.life(), Life::stopped);
}

TEST_F(InlineGroupTest, IsClosedWithAllItsCopies) {
  InlineGroup group(fake(), {}, group_of(2));
  const auto watcher = group.attach(1);
  GroupBurst burst(group, 2, 1, 3);
  group.close();
  group.close();
  EXPECT_THROW(burst.run(), Closed);
  EXPECT_EQ(watcher->life(), Life::stopped);
  EXPECT_THROW(watcher->burst(1, kPatience), BackendStopped);
}

/// A robot with which the calling thread of a group has nothing to do but wait for its worker.
class Gated {
 public:
  struct Gate {
    std::thread::id caller;
    std::atomic<bool> worker_has_begun{false};
    std::atomic<bool> open{true};
  };
  static Gate gate;
  using Config = FakeSimulator::Config;
  using Actuators = std::array<double, 1>;

  explicit Gated(const Config& /*config*/) {}
  void describe(Schema& schema) const { schema.actuator(0).name("gate"); }
  void start() {}
  void write(const Desired<Gated>& /*desired*/) {
    const bool calls = std::this_thread::get_id() == gate.caller;
    if (!calls) gate.worker_has_begun = true;
    while (!gate.open && !(calls && gate.worker_has_begun)) std::this_thread::yield();
  }
  void read(Reading<Gated>& reading) { reading.observed = {0}; }
  void stop() noexcept {}
};
Gated::Gate Gated::gate;

/// Calls `close` in a signal handler of the thread that has called `burst`, while it waits for its
/// worker.
template <class RunBurst, class Close>
void expect_close_during(RunBurst&& burst, Close&& close) {
  Gated::gate.caller = std::this_thread::get_id();
  Gated::gate.worker_has_begun = false;
  Gated::gate.open = false;
  bool closed = false;
  const KeepWaiting handler = [&] {
    EXPECT_TRUE(Gated::gate.worker_has_begun);
    Gated::gate.open = true;
    close();
    closed = true;
    return true;
  };
  try {
    burst(handler);
  } catch (const Error&) {  // its copies may have been done before the close
  }
  EXPECT_TRUE(closed);
}

TEST_F(InlineGroupTest, IsClosedInASignalHandlerOfItsCallWhichDoesNotWaitForItself) {
  const RobotTable& robot = *robot_table<Gated>("gated");
  InlineGroup leader(robot, {}, group_of(2));
  InlineGroup follower(robot, {}, group_of(2, 2, &leader));
  GroupBurst leading(leader, 1, 1, 1), following(follower, 1, 1, 1);
  const InlineGroup::Following then{&follower, &following.plan, {}};
  leading.plan.then = &then;

  const auto lead = [&](const KeepWaiting& handler) {
    leader.burst(leading.plan, leading.all, kPatience, handler);
  };
  expect_close_during(lead, [&] { follower.close(); });
  EXPECT_THROW(following.run(), Closed);
  leading.plan.then = nullptr;
  EXPECT_NO_THROW(leading.run());
  expect_close_during(lead, [&] { leader.close(); });
  EXPECT_THROW(leading.run(), Closed);
}

TEST_F(InlineGroupTest, LetsAnotherThreadUseAFrontendOfACopyMeanwhile) {
  InlineGroup::Options options = group_of(3);
  options.backend.history = 100'000;  // its thread may pause between its burst and its row
  InlineGroup group(fake(), {}, options);
  GroupBurst burst(group, 2, 1, 3);
  const auto other = group.attach(1);
  std::atomic<bool> done{false};
  std::int64_t bursts = 0;
  std::thread thread([&] {
    while (!done) {
      other->burst(1, kPatience);
      ++bursts;
    }
  });
  for (int i = 0; i < 300; ++i) burst.run();
  done = true;
  thread.join();
  EXPECT_EQ(other->published(), 900 + bursts);
  EXPECT_EQ(burst.last_iteration(0), 900);
}

}  // namespace
}  // namespace o80::test
