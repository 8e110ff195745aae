#include "pam/driver.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <string>

#include "pam/shown_model.hpp"

namespace o80::pam {
namespace {

/// Sets the given numbers; joints without one keep the preset's.
void take(const Joints& given, Joints& numbers) {
  for (std::size_t j = 0; j < kJoints; ++j) {
    if (given[j] != kOfPreset[j]) numbers[j] = given[j];
  }
}

PressureRanges ranges_of(const PamDriver::Config& config, const PressureRanges& of_preset) {
  const bool preset_in_bar = of_preset[0].idle != of_preset[0].minimum;
  const bool bars = config.activated_by == ActivatedBy::bar ||
                    (config.activated_by == ActivatedBy::of_preset && preset_in_bar);
  PressureRanges ranges{};
  for (std::size_t m = 0; m < kMuscles; ++m) {
    ranges[m] = {of_preset[m].minimum, of_preset[m].maximum};
  }
  if (config.ranges == Ranges::real) ranges = kRealRanges;
  if (config.ranges == Ranges::simulated) ranges = kSimulatedRanges;
  return bars ? in_bar(ranges, config.full_bar) : ranges;
}

Plant::Config plant_config(const PamDriver::Config& config) {
  Plant::Config plant = preset(config.preset);
  if (config.muscle == Law::linear) plant.muscle = MuscleModel::linear;
  if (config.muscle == Law::hill) plant.muscle = MuscleModel::hill;
  plant.ranges = ranges_of(config, plant.ranges);
  take(config.dead_time, plant.dead_time);
  take(config.lag, plant.lag);
  take(config.damping, plant.arm.damping);
  take(config.friction, plant.arm.friction);
  take(config.maximum_force, plant.maximum_force);
  take(config.stroke, plant.stroke);
  plant.period = config.period;
  plant.substeps = config.substeps;
  plant.start_posture = config.start_posture;
  plant.start_activation = config.start_activation;
  plant.start_noise = config.start_noise;
  if (config.start_pressures != Pressures{}) plant.start_pressures = config.start_pressures;
  return plant;
}

}  // namespace

PamDriver::PamDriver(const Config& config)
    : plant_(plant_config(config)),
      slots_(config.slots),
      period_(std::llround(config.period * 1e9)) {
  begin();
}

void PamDriver::describe(Schema& schema) const {
  schema.simulated();
  const std::int64_t requested = schema.asked_period();
  if (requested != 0 && requested != period_) {
    const double frequency = 1e9 / static_cast<double>(period_);
    std::array<char, 240> text{};
    std::snprintf(text.data(), text.size(),
                  "an iteration of the arm lasts %g s (%g Hz), but %g Hz was requested. Leave the "
                  "frequency out, set it to %g, or give the arm period=%g",
                  static_cast<double>(period_) * 1e-9, frequency,
                  1e9 / static_cast<double>(requested), frequency,
                  static_cast<double>(requested) * 1e-9);
    throw DriverError(text.data());
  }
  schema.period(period_);
  for (std::uint32_t m = 0; m < kMuscles; ++m) {
    const PressureRange& range = plant_.config().ranges[m];
    schema.actuator(m)
        .name((m % 2 == 0 ? "agonist_" : "antagonist_") + std::to_string(m / 2 + 1))
        .when_idle(WhenIdle::hold)
        .limits({.minimum = static_cast<double>(range.minimum),
                 .maximum = static_cast<double>(range.maximum)});
  }
  schema.shown.mjcf = shown_model(plant_.config());
  for (std::uint32_t j = 0; j < kJoints; ++j) {
    schema.sensor_moves_joint("joint_positions", j, kShownJoints[j]);
  }
}

/// At the start the observed pressures equal the desired ones exactly, without rounding.
void PamDriver::begin() noexcept {
  std::ranges::copy(plant_.state().commanded, now_.desired.begin());
  now_.observed = now_.desired;
  now_.clipped = 0;
}

void PamDriver::write(const Desired<PamDriver>& desired) {
  now_.desired = desired.states;
  Pressures requested{};
  for (std::size_t m = 0; m < kMuscles; ++m) requested[m] = rounded(desired[m]);
  now_.clipped = plant_.advance(requested);
  for (std::size_t m = 0; m < kMuscles; ++m) {
    now_.observed[m] = plant_.config().ranges[m].pressure(plant_.state().activation[m]);
  }
}

void PamDriver::read(Reading<PamDriver>& reading) noexcept {
  const RacketMotion racket = plant_.racket();
  reading.observed = now_.observed;
  reading.extended = {.joint_positions = plant_.q(),
                      .joint_velocities = plant_.dq(),
                      .bars = plant_.bars(),
                      .activations = plant_.state().activation,
                      .racket_position = racket.position,
                      .racket_rotation = racket.rotation,
                      .racket_velocity = racket.velocity,
                      .racket_angular_velocity = racket.angular_velocity,
                      .clipped = {}};
  for (std::size_t m = 0; m < kMuscles; ++m) {
    reading.extended.clipped[m] = (now_.clipped >> m & 1) != 0;
  }
  reading.go_on_from(now_.desired);
}

Served PamDriver::on(const Reset& reset) noexcept {
  plant_.reset(reset.seed);
  begin();
  return Served::start_afresh();
}

Served PamDriver::on(const Snapshot& snapshot) noexcept {
  if (snapshot.slot >= slots_.size()) return no_such_slot();
  State& slot = slots_[snapshot.slot];
  slot = now_;
  slot.plant = plant_.state();
  slot.filled = 1;
  return Served::done();
}

Served PamDriver::on(const Restore& restore) noexcept {
  if (restore.slot >= slots_.size()) return no_such_slot();
  const State& slot = slots_[restore.slot];
  if (slot.filled == 0) return Served::rejected("this slot has no snapshot: request it first");
  now_ = slot;
  plant_.restore(slot.plant);
  return Served::start_afresh();
}

std::span<const std::byte> PamDriver::snapshot_bytes(std::uint32_t slot) const noexcept {
  if (slot >= slots_.size() || slots_[slot].filled == 0) return {};
  return std::as_bytes(std::span(&slots_[slot], 1));
}

bool PamDriver::load_snapshot(std::uint32_t slot, std::span<const std::byte> bytes) noexcept {
  if (slot >= slots_.size() || bytes.size() != sizeof(State)) return false;
  slots_[slot] = unpack<State>(bytes.data());
  return true;
}

Served PamDriver::no_such_slot() const noexcept {
  std::array<char, 160> text{};
  std::snprintf(text.data(), text.size(),
                "there are %zu slots, counted from 0; start the robot with more (slots=...)",
                slots_.size());
  return Served::rejected(text.data());
}

}  // namespace o80::pam
