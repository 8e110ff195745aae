#include <cstdio>
#include <stdexcept>

#include "o80/robot.hpp"

struct Reading {
  double weight;
};
O80_DESCRIBE(Reading, (weight, "[kg]"));

/// A pure sensor: it weighs as many kilogrammes as it has iterated.
struct Scale {
  struct Config {
    bool broken = false;
    double full = 1000.0;
  };
  using Actuators = o80::NoActuators;
  using Extended = Reading;

  explicit Scale(const Config& config) : config(config) {}
  void start() {
    std::puts("warming up");
    if (config.broken) throw std::runtime_error("it finds no zero");
  }
  void write(const o80::Desired<Scale>&) {}
  void read(o80::Reading<Scale>& reading) {
    reading.extended.weight = static_cast<double>(reading.iteration());
    if (reading.extended.weight >= config.full) reading.fault("it is full");
  }
  void stop() noexcept {}
  Config config;
};
O80_DESCRIBE(Scale::Config, broken, (full, "what is too much [kg]"));
O80_ROBOT(scale, Scale)
