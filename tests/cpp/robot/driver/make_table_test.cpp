#include "o80/robot/make_table.hpp"

#include "robot/driver/driver_instance.hpp"
#include "robot/fake_driver.hpp"
#include "robot/inline_simulation.hpp"

namespace o80::test {
namespace {

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
  InlineSimulation sensor("sensor", *robot_table<Sensor>("sensor"), {}, 0);
  EXPECT_EQ(unpack<double>(sensor.burst(4).extended()), 4.0);
}

TEST_F(MakeTableTest, ADriverMayKnowItsLayoutAtRunTimeOnly) {
  InlineSimulation model("model", *robot_table<Model>("model"), {{"joints", "2"}}, 0);
  UntypedFrontend& frontend = model.frontend;
  ASSERT_EQ(frontend.schema().actuators.size(), 2U);
  EXPECT_EQ(unpack<double>(frontend.latest().desired() + 16), 0.5);
  const std::array target{2.5, 0.0};  // position and gain
  frontend.add_command(1, std::as_bytes(std::span(target)));
  const UntypedObservation row = model.burst(2);
  EXPECT_EQ(unpack<double>(row.observed() + 16), 2.5);
  EXPECT_EQ(unpack<std::int64_t>(row.extended()), 2);
}

}  // namespace
}  // namespace o80::test
