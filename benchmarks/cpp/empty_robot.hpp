#pragma once

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <thread>

#include "o80/o80.hpp"
#include "robot/group/inline_robot.hpp"
#include "robot/loop/loop.hpp"
#include "sample.hpp"

namespace o80::bench {

struct NoConfig {
  bool unused = false;
};
O80_DESCRIBE(NoConfig, unused);

struct Sensors {
  std::array<double, 32> values;  // 256 bytes
};
O80_DESCRIBE(Sensors, values);

/// A driver that does nothing: what is left is o80.
struct TwoEmpty {
  using Config = NoConfig;
  using Actuators = std::array<double, 2>;
  explicit TwoEmpty(const Config& /*config*/) {}
  void describe(Schema& schema) const { schema.simulated(); }
  void start() {}
  void write(const Desired<TwoEmpty>& /*desired*/) {}
  void read(Reading<TwoEmpty>& /*reading*/) {}
  void stop() noexcept {}
};

/// The same with eight actuators and 256 bytes of sensor values, written anew in each reading.
struct EightWithSensors {
  using Config = NoConfig;
  using Actuators = std::array<double, 8>;
  using Extended = Sensors;
  explicit EightWithSensors(const Config& /*config*/) {}
  void describe(Schema& schema) const { schema.simulated(); }
  void start() {}
  void write(const Desired<EightWithSensors>& desired) { now_ = desired.states; }
  void read(Reading<EightWithSensors>& reading) {
    reading.observed = now_;
    reading.extended.values.fill(now_[0]);
  }
  void stop() noexcept {}

 private:
  Actuators now_{};
};

/// A bursting robot that runs in a thread of this process, as `o80 run` would in its own.
template <Driver D>
class Running {
 public:
  /// `processor`: where its thread stays; -1: anywhere.
  explicit Running(const std::string& name, int processor = -1)
      : loop_(std::make_unique<DriverInstance>(*robot_table<D>("empty"), OptionValues{}),
              options(name)) {
    loop_.start();
    thread_ = std::thread([this, processor] {
      if (processor >= 0) pin(processor);
      loop_.run();
    });
  }
  ~Running() {
    loop_.ask_to_stop();
    thread_.join();
  }

 private:
  static BackendOptions options(const std::string& name) {
    return {.segment = name, .bursting = true};
  }

  Loop loop_;
  std::thread thread_;
};

}  // namespace o80::bench
