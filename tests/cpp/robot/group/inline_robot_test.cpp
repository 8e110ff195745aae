#include "robot/group/inline_robot.hpp"

#include "o80/runtime/typed_frontend.hpp"
#include "robot/driver/library.hpp"
#include "robot/fake_driver.hpp"

namespace o80::test {
namespace {

class InlineRobotTest : public FakeDriverTest {};

std::shared_ptr<InlineRobot> here(std::unique_ptr<DriverInstance> driver) {
  return std::make_shared<InlineRobot>(std::move(driver), BackendOptions{.segment = "here"});
}
std::unique_ptr<DriverInstance> two_joints() {
  static const RobotLibrary library = RobotLibrary::load(kTwoJoints);
  return std::make_unique<DriverInstance>(*library.table, OptionValues{{"gain", "30"}});
}

UntypedFrontend frontend_of(const std::shared_ptr<InlineRobot>& robot) {
  return {robot->backend(), robot};
}

/// Commands, bursts, a reset and a restore.
std::vector<std::byte> play(UntypedFrontend& frontend) {
  for (int i = 0; i < 10; ++i) {
    add(frontend, 0, 0.1 * i, {.pace = iterations(3), .profile = Profile::minimum_jerk});
    add(frontend, 1, -0.05 * i, {.pace = speed(3), .mode = Mode::overwrite});
    frontend.burst(1 + i % 5, kPatience);
    if (i == 4) add_request(frontend, Snapshot{.slot = 1});
    if (i == 6) add_request(frontend, Restore{.slot = 1});
    if (i == 8) add_request(frontend, Reset{});
  }
  add(frontend, 0, 0.0, {.pace = iterations(40)});
  frontend.pulse_and_wait(kPatience);
  return frontend.history(1'000'000).bytes;
}

// rule G6
TEST_F(InlineRobotTest, GivesTheSameRowsBitForBitAsABurstingProcess) {
  Program process({kRunProgram, kTwoJoints, "--bursting", "--gain", "30", "--segment", "process"});
  UntypedFrontend frontend("process", {.timeout = kPatience});
  const std::vector<std::byte> rows = play(frontend);
  process.signal(SIGTERM);
  EXPECT_EQ(process.end().code, 0);

  UntypedFrontend own = frontend_of(here(two_joints()));
  const std::vector<std::byte> again = play(own);
  ASSERT_GT(rows.size(), 0U);
  EXPECT_EQ(again, rows);
}

TEST_F(InlineRobotTest, LetsOthersWatchAndCommand) {
  UntypedFrontend owner = frontend_of(here(two_joints()));
  UntypedFrontend other("here");
  const Batch theirs = send(other, 1, 1.0);
  owner.burst(1, kAtOnce);
  EXPECT_EQ(theirs.handle(0).status, Status::completed);
  EXPECT_EQ(desired(other.latest(), 1), 1.0);
  EXPECT_EQ(other.published(), 1);
}

TEST_F(InlineRobotTest, LeavesTheRestOfABurstThatItsCallerCuts) {
  int requested = 0;
  const auto robot = std::make_shared<InlineRobot>(two_joints(), BackendOptions{.segment = "here"},
                                                   [&requested] { return ++requested < 2; });
  UntypedFrontend frontend = frontend_of(robot);
  EXPECT_THROW(frontend.burst(1'000'000'000'000, kPatience), Cancelled);
  const Iteration reached = frontend.published();
  EXPECT_GT(reached, 0);
  EXPECT_EQ(frontend.burst(1, kAtOnce).iteration(), reached + 1);
}

TEST_F(InlineRobotTest, LeavesTheHardwareToTheParentOfAForkedChild) {
  auto loop = started();
  const pid_t child = fork();
  if (child == 0) {
    loop.reset();
    _exit(FakeDriver::calls.stopped);
  }
  int status = -1;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_EQ(WEXITSTATUS(status), 0);
  EXPECT_EQ(UntypedFrontend("fake").life(), Life::running);
}

TEST_F(InlineRobotTest, WaitsForNothingOfItsOwn) {
  UntypedFrontend frontend = frontend_of(here(two_joints()));
  add(frontend, 0, 1.0, {.pace = iterations(100)});
  EXPECT_EQ(frontend.pulse_and_wait(kAtOnce).iteration(), 100);
  EXPECT_EQ(frontend.burst(5, kAtOnce).iteration(), 105);
  add_request(frontend, Reset{});
  const Batch reset = frontend.pulse();
  reset.wait(kAtOnce);
  EXPECT_EQ(frontend.latest().head().fresh, 1U);
}

TEST_F(InlineRobotTest, RaisesAFaultWhereItWasBurst) {
  UntypedFrontend frontend = frontend_of(here(driver({{"fails", "write"}})));
  EXPECT_THAT(message_of<DriverError>([&] { frontend.burst(10, kPatience); }),
              HasSubstr("wire cut"));
  EXPECT_EQ(FakeDriver::calls.stopped, 1);
  EXPECT_THROW(frontend.burst(1, kPatience), BackendFailed);
  EXPECT_EQ(frontend.published(), 2);
}

TEST_F(InlineRobotTest, NamesThatNobodyUsesDiffer) {
  EXPECT_NE(unused_segment_name("arm"), unused_segment_name("arm"));
  EXPECT_THAT(unused_segment_name("arm"), HasSubstr("arm-"));
}

/// Sums the rates of its desired states, as a feed-forward would use them.
struct Summing {
  struct Config {};
  struct Joint {
    double angle = 0;
    bool on = false;
  };
  using Actuators = std::array<Joint, 2>;
  using Extended = NoExtended;

  explicit Summing(const Config&) {}
  void describe(Schema& schema) const {
    schema.actuator(0).limits("angle", {.speed = 2.0, .acceleration = 15.0});
  }
  void start() {}
  void write(const Desired<Summing>& desired) {
    for (std::size_t i = 0; i < 2; ++i) {
      const double speed = desired.rate(desired[i].angle);
      sums_[i] += speed * desired.period();
      EXPECT_NEAR(sums_[i], desired[i].angle, 1e-12);
      if (desired.active(i)) {
        EXPECT_NEAR(desired.rate2(desired[i].angle), (speed - speeds_[i]) / desired.period(), 1e-6);
      }
      EXPECT_EQ(desired.rate(desired[i].on), 0.0);
      speeds_[i] = speed;
    }
    const Joint copy = desired[0];
    EXPECT_THROW(desired.rate(copy.angle), InvalidArgument);
    states_ = desired.states;
  }
  void read(Reading<Summing>& reading) { reading.observed = states_; }
  void stop() noexcept {}

  Actuators states_{};
  std::array<double, 2> sums_{};
  std::array<double, 2> speeds_{};
};
O80_DESCRIBE(Summing::Config);
O80_DESCRIBE(Summing::Joint, angle, on);

TEST_F(InlineRobotTest, GivesADriverTheRatesOfItsDesiredStates) {
  const RobotTable& summing = *robot_table<Summing>("summing");
  UntypedFrontend owner =
      frontend_of(here(std::make_unique<DriverInstance>(summing, OptionValues{})));
  Frontend<Summing> frontend("here");
  frontend.add_command(0, Summing::Joint{0.3, false});
  frontend.add_command(1, Summing::Joint{1.0, true}, {.pace = iterations(40)});
  frontend.pulse();
  owner.burst(60, kPatience);
  frontend.add_command(0, Summing::Joint{-0.1, false}, {.mode = Mode::overwrite});
  frontend.pulse();
  owner.burst(600, kPatience);
  EXPECT_EQ(frontend.latest().desired()[0].angle, -0.1);
}

}  // namespace
}  // namespace o80::test
