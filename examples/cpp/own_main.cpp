// A driver with a main of its own: a thermometer, a robot without actuators.
// `example_own_main --help` lists its flags; `o80 echo thermometer` reads it.

#include <cmath>

#include "o80/o80.hpp"

class Thermometer {
 public:
  struct Config {
    double base = 20.0;
    double swing = 5.0;
  };
  struct Reading {
    double temperature;
    bool warm;
  };
  using Actuators = o80::NoActuators;
  using Extended = Reading;

  explicit Thermometer(const Config& config) : config_(config) {}
  void start() {}
  void write(const o80::Desired<Thermometer>&) {}
  void read(o80::Reading<Thermometer>& reading) {
    const double seconds = static_cast<double>(reading.time()) * 1e-9;
    reading.extended.temperature = config_.base + config_.swing * std::sin(seconds);
    reading.extended.warm = reading.extended.temperature > config_.base;
  }
  void stop() noexcept {}

 private:
  Config config_;
};

O80_DESCRIBE(Thermometer::Config, (base, "mean temperature [degC]"), (swing, "either way [K]"));
O80_DESCRIBE(Thermometer::Reading, (temperature, "[degC]"), (warm, "above the mean"));

int main(int argc, char** argv) { return o80::run<Thermometer>(argc, argv, "thermometer"); }
