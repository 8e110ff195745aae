#include "o80/o80.hpp"

struct Reading {
  double weight;
};
O80_DESCRIBE(Reading, (weight, "[kg]"));

/// A pure sensor: it weighs as many kilogrammes as it has iterated.
struct Scale {
  struct Config {};
  using Actuators = o80::NoActuators;
  using Extended = Reading;

  explicit Scale(const Config&) {}
  void start() {}
  void write(const o80::Desired<Scale>&) {}
  void read(o80::Reading<Scale>& reading) {
    reading.extended.weight = static_cast<double>(reading.iteration());
  }
  void stop() noexcept {}
};
O80_DESCRIBE(Scale::Config);
O80_ROBOT(scale, Scale)
