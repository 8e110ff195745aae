#include <cstdio>
#include <stdexcept>

#include "o80/robot.hpp"

struct Reading {
  double weight;
};
O80_DESCRIBE(Reading, (weight, "[kg]"));

struct Calibrate {
  double offset;
  double factor = 2.0;
};
O80_DESCRIBE(Calibrate, (offset, "[kg]"), (factor, "of each kilogramme"));

/// A pure sensor: it weighs as many kilogrammes as it has iterated, if nobody calibrates it.
struct Scale {
  struct Config {
    bool broken = false;
    double full = 1000.0;
  };
  using Actuators = o80::NoActuators;
  using Extended = Reading;
  using Requests = o80::Requests<Calibrate>;

  explicit Scale(const Config& config) : config(config) {}
  void start() {
    std::puts("warming up");
    if (config.broken) throw std::runtime_error("it finds no zero");
  }
  void write(const o80::Desired<Scale>&) {}
  void read(o80::Reading<Scale>& reading) {
    reading.extended.weight =
        calibration.offset + calibration.factor * static_cast<double>(reading.iteration());
    if (reading.extended.weight >= config.full) reading.fault("it is full");
  }
  void on(const Calibrate& request) { calibration = request; }
  void stop() noexcept {}
  Config config;
  Calibrate calibration{0.0, 1.0};
};
O80_DESCRIBE(Scale::Config, broken, (full, "what is too much [kg]"));
O80_ROBOT(scale, Scale)
