#include "o80/robot/make_table.hpp"

#include "robot/driver/driver_instance.hpp"
#include "robot/fake_driver.hpp"
#include "robot/inline_simulation.hpp"
#include "robot/loop/loop.hpp"

namespace o80::test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

class MakeTableTest : public FakeDriverTest {};

/// A driver that describes nothing but itself.
struct Sensor {
  struct Config {};
  struct Values {
    double temperature = 0;
  };
  using Actuators = NoActuators;
  using Extended = Values;
  explicit Sensor(const Config&) {}
  void start() {}
  void write(const Desired<Sensor>& desired) { iteration = desired.iteration(); }
  void read(Reading<Sensor>& reading) {
    reading.extended.temperature = static_cast<double>(iteration);
  }
  void stop() noexcept {}
  std::int64_t iteration = 0;
};
O80_DESCRIBE(Sensor::Config);
O80_DESCRIBE(Sensor::Values, temperature);

/// A driver whose layout is known only when it is described.
struct Model {
  struct Config {
    int joints = 3;
  };
  using Actuators = RunTimeActuators;
  explicit Model(const Config& config) : joints(config.joints) {}
  void describe(Schema& schema) const {
    const auto type = schema.add_type(
        "State", {scalar_field("position", Kind::float64), scalar_field("gain", Kind::float32)});
    schema.add_actuators("joint", type, static_cast<std::uint32_t>(joints));
    count = {schema.add_sensor(scalar_field("count", Kind::int64))};
  }
  void start() {}
  void write(const Desired<Model>& desired) { last = desired.at(Place<double>{16}); }
  void read(Reading<Model>& reading) {
    reading.observe(Place<double>{16}, last);
    reading.extend(count, reading.iteration());
  }
  void stop() noexcept {}
  int joints;
  mutable Place<std::int64_t> count;
  double last = 0.5;
};
O80_DESCRIBE(Model::Config, joints);

/// A driver of hardware that ticks at a fixed rate.
struct TickingSensor : Sensor {
  static constexpr std::int64_t kPeriod = 2'500'000;  // [ns]
  using Sensor::Sensor;
  void describe(Schema& schema) const { schema.period(kPeriod); }
  void write(const Desired<TickingSensor>& desired) { iteration = desired.iteration(); }
  void read(Reading<TickingSensor>& reading) { reading.extended.temperature = 20; }
};

static_assert(Driver<TickingSensor> && Driver<FakeDriver> && Driver<Sensor> && Driver<Model>);

TEST_F(MakeTableTest, ListsTheOptionsOfTheConfig) {
  const std::vector<Option> options = options_of(table());
  ASSERT_EQ(options.size(), 3U);
  EXPECT_THAT(options[0].kind, HasSubstr("never, construct"));
  EXPECT_EQ(options[1].name, "gain");
  EXPECT_EQ(options[1].unit, "1/s");
}

TEST_F(MakeTableTest, DescribesTheDriverAcrossTheTable) {
  DriverInstance robot(table(), {});
  const Schema schema = robot.describe();
  EXPECT_EQ(schema.head.robot.view(), "fake");
  EXPECT_EQ(schema.actuators[1].name.view(), "right");
  EXPECT_EQ(schema.requests[0].name.view(), "poke");
}

TEST_F(MakeTableTest, ARobotWithAPeriodOfItsOwnRunsAtItOrIsNotStarted) {
  const auto period_of = [](std::int64_t requested) {
    return InlineSimulation("ticking", *robot_table<TickingSensor>("ticking"), {}, requested)
        .frontend.period();
  };
  EXPECT_EQ(period_of(0), TickingSensor::kPeriod);
  EXPECT_EQ(period_of(TickingSensor::kPeriod), TickingSensor::kPeriod);
  EXPECT_EQ(period_of(TickingSensor::kPeriod + 20), TickingSensor::kPeriod);  // rounded
  EXPECT_THAT(message_of<InvalidArgument>([&] { period_of(1'000'000); }),
              AllOf(HasSubstr("robot 'ticking' runs at 400 Hz (2.5 ms), not at 1000 Hz (1 ms)"),
                    HasSubstr("leave the frequency out")));
  EXPECT_THAT(message_of<InvalidArgument>([&] { period_of(-1); }), HasSubstr("must be positive"));
}

TEST_F(MakeTableTest, ARobotOfAnyPeriodRunsAtOneKilohertzUnlessAskedOtherwise) {
  InlineSimulation sensor("sensor", *robot_table<Sensor>("sensor"), {}, 0);
  EXPECT_EQ(sensor.frontend.period(), 1'000'000);
}

TEST_F(MakeTableTest, NothingThatADriverThrowsCrossesTheTable) {
  EXPECT_THAT(message_of<DriverError>([] { DriverInstance(table(), {{"fails", "construct"}}); }),
              AllOf(HasSubstr("'fake'"), HasSubstr("no cable")));
  EXPECT_THAT(
      message_of<DriverError>([] { DriverInstance(table(), {{"fails", "describe"}}).describe(); }),
      HasSubstr("no plan"));
  DriverInstance robot(table(), {{"fails", "start"}});
  EXPECT_FALSE(robot.start());
  EXPECT_STREQ(robot.fault(), "no power");
}

TEST_F(MakeTableTest, ADriverIsStoppedOnceAndOnlyIfAStartWasTried) {
  {
    const DriverInstance robot(table(), {});
  }
  EXPECT_EQ(FakeDriver::calls.stopped, 0);
  EXPECT_EQ(FakeDriver::calls.destroyed, 1);
  {
    DriverInstance robot(table(), {});
    robot.start();
    robot.stop();
    robot.stop();
  }
  EXPECT_EQ(FakeDriver::calls.stopped, 1);
}

TEST_F(MakeTableTest, ATableOfAnotherVersionIsRefusedWithTheCure) {
  RobotTable other = table();
  other.row_sizes += 8;
  EXPECT_THAT(message_of<DriverError>([&] { check_table(other, "arm.so"); }),
              AllOf(HasSubstr("'arm.so'"), HasSubstr("build it again")));
}

TEST_F(MakeTableTest, APureSensorIsADriverToo) {
  Loop loop(std::make_unique<DriverInstance>(*robot_table<Sensor>("sensor"), OptionValues{}),
            {.segment = "sensor", .bursting = true});
  loop.start();
  UntypedFrontend frontend("sensor");
  frontend.start_burst(4);
  EXPECT_EQ(loop.run_granted(kAll), Step::standing);
  EXPECT_EQ(unpack<double>(frontend.latest().extended()), 4.0);
}

TEST_F(MakeTableTest, ADriverMayKnowItsLayoutAtRunTimeOnly) {
  Loop loop(
      std::make_unique<DriverInstance>(*robot_table<Model>("model"), OptionValues{{"joints", "2"}}),
      {.segment = "model", .bursting = true});
  loop.start();
  UntypedFrontend frontend("model");
  ASSERT_EQ(frontend.schema().actuators.size(), 2U);
  EXPECT_EQ(unpack<double>(frontend.latest().desired() + 16), 0.5);
  struct State {
    double position = 2.5;
    float gain = 0;
    float padding = 0;
  };
  const State target;
  frontend.add_command(1, std::as_bytes(std::span(&target, 1)));
  frontend.start_burst(2);
  EXPECT_EQ(loop.run_granted(kAll), Step::standing);
  const UntypedObservation row = frontend.latest();
  EXPECT_EQ(unpack<double>(row.observed() + 16), 2.5);
  EXPECT_EQ(unpack<std::int64_t>(row.extended()), 2);
}

}  // namespace
}  // namespace o80::test
