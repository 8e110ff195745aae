#include "arms/dynamixel_chain.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <stdexcept>
#include <string>

namespace o80::arms {
namespace {

constexpr double kSpeedUnit = 0.229 * 4096 / 60;             // [steps/s]
constexpr double kAccelerationUnit = 214.577 * 4096 / 3600;  // [steps/s^2]
constexpr int kTurn = 4096;                                  // [steps]
constexpr int kSlack = 200;       // tolerance outside of a range of a whole turn [steps]
constexpr int kWatchdogTime = 5;  // 0.1 s [20 ms]
constexpr int kShutdowns =
    dynamixel::heat_failure | dynamixel::shock_failure | dynamixel::overload_failure;

std::uint8_t alarms_of(int failures) {
  const auto alarm = [&](int failure, Alarm its) { return (failures & failure) != 0 ? its : 0; };
  return static_cast<std::uint8_t>(alarm(dynamixel::voltage_failure, voltage_alarm) |
                                   alarm(dynamixel::encoder_failure, encoder_alarm) |
                                   alarm(dynamixel::heat_failure, heat_alarm) |
                                   alarm(dynamixel::shock_failure, current_alarm) |
                                   alarm(dynamixel::overload_failure, overload_alarm));
}

}  // namespace

DynamixelChain::DynamixelChain(std::span<const Model> models, std::size_t stiff)
    : ServoChain(models.size(), requests_, answers_, dynamixel::kTorque, dynamixel::kGoal),
      stiff_(stiff) {
  std::ranges::copy(models, models_.begin());
}

void DynamixelChain::set_up(std::size_t servo) {
  const int model = needed(servo, dynamixel::kModel);
  if (model != models_[servo].number) {
    throw std::runtime_error("is of model " + std::to_string(model) + ", but an " +
                             models_[servo].name + " (" + std::to_string(models_[servo].number) +
                             ") is needed");
  }
  if (const int mode = needed(servo, dynamixel::kDriveMode); mode != 0) {
    throw std::runtime_error("has the drive mode " + std::to_string(mode) +
                             " in its register 10, which must be 0 for the calibration");
  }
  const bool grips = servo + 1 == count_;
  keep(servo, {dynamixel::kReturnDelay, 0});
  keep(servo, {dynamixel::kMode, grips ? 5 : 4});
  keep(servo, {dynamixel::kShutdown, needed(servo, dynamixel::kShutdown) | kShutdowns});
  most_[servo] = needed(servo, grips ? dynamixel::kMostCurrent : dynamixel::kMostPwm);
  ServoState& state = states_[servo];
  state.hottest = needed(servo, dynamixel::kHottest);
  state.least_voltage = 0.1 * needed(servo, dynamixel::kLeastVoltage);
  state.most_voltage = 0.1 * needed(servo, dynamixel::kMostVoltage);
}

/// Writes a setting if the servo has another value. Throws std::runtime_error if that fails.
void DynamixelChain::keep(std::size_t servo, const Setting& setting) {
  if (needed(servo, setting.where) == setting.value) return;
  const std::string where =
      "its register " + std::to_string(static_cast<int>(setting.where.address));
  if (states_[servo].torque) {
    throw std::runtime_error("has its torque on, so " + where +
                             " cannot be set: `o80 arms relax` first (the arm sinks), then start "
                             "it again");
  }
  queue(setting.where, Mask{1} << servo, setting.value);
  send_queued();
  if (needed(servo, setting.where) == setting.value) return;
  throw std::runtime_error("does not keep the value written to " + where);
}

Calibration DynamixelChain::calibration_of(std::size_t servo) {
  const Calibration found{.offset = needed(servo, dynamixel::kOffset),
                          .smallest = needed(servo, dynamixel::kSmallest),
                          .largest = needed(servo, dynamixel::kLargest)};
  middles_[servo] = static_cast<int>(found.middle());
  return found;
}

Setting DynamixelChain::goal(std::size_t servo, int position) const noexcept {
  return {dynamixel::kGoal, position + turns_[servo]};
}

/// Without power a servo loses its turns and its torque: takes the position nearest to
/// the middle of the range.
int DynamixelChain::without_turns(std::size_t servo, int position) noexcept {
  const bool is_off = std::abs(position - turns_[servo] - middles_[servo]) > kTurn / 2 + kSlack;
  if (!placed_[servo] || (is_off && !states_[servo].torque)) {
    placed_[servo] = true;
    turns_[servo] =
        kTurn * static_cast<int>(std::floor((position - middles_[servo] + kTurn / 2.0) / kTurn));
  }
  return position - turns_[servo];
}

Setting DynamixelChain::speed(std::size_t /*servo*/, double speed) const noexcept {
  return {dynamixel::kSpeed, static_cast<int>(std::lround(speed / kSpeedUnit))};
}

Setting DynamixelChain::acceleration(double acceleration) const noexcept {
  return {dynamixel::kAcceleration,
          static_cast<int>(std::lround(acceleration / kAccelerationUnit))};
}

Setting DynamixelChain::strength(std::size_t servo, double share) const noexcept {
  const Register where = servo + 1 == count_ ? dynamixel::kGoalCurrent : dynamixel::kPwm;
  return {where, static_cast<int>(std::lround(share * most_[servo]))};
}

void DynamixelChain::queue_motion(Mask servos, double speed, double acceleration,
                                  std::span<const double> strengths) noexcept {
  ServoChain::queue_motion(servos, speed, acceleration, strengths);
  const Mask stiff = servos & Mask{1} << stiff_;
  queue(dynamixel::kGainP, stiff, 1500);
  queue(dynamixel::kGainI, stiff, 0);
  queue(dynamixel::kGainD, stiff, 600);
}

void DynamixelChain::queue_recovery(Mask servos) noexcept {
  queue(dynamixel::kAnswers, servos, 1);
  for (; servos != 0; servos &= servos - 1) {
    requests_.reboot(ids_[static_cast<std::size_t>(std::countr_zero(servos))]);
  }
}

void DynamixelChain::queue_watchdog(bool on) noexcept {
  queue(dynamixel::kWatchdog, all(), 0);
  if (on) queue(dynamixel::kWatchdog, all(), kWatchdogTime);
}

/// Selects the servo that also reports torque and failure in a transfer: the next one, or one with
/// an unknown failure.
void DynamixelChain::ask(std::uint8_t variant) noexcept {
  whole_ =
      unnamed_ != 0 ? static_cast<std::size_t>(std::countr_zero(unnamed_)) : (whole_ + 1) % count_;
  unnamed_ = 0;
  std::array<dynamixel::Block, kMost> blocks{};
  for (std::size_t i = 0; i < count_; ++i) {
    const int begin = i == whole_ ? dynamixel::kTorque.address : dynamixel::kCurrent.address;
    const auto first = static_cast<std::uint8_t>(begin - variant);
    const auto size = static_cast<std::uint8_t>(dynamixel::kTemperature.address + 1 - first);
    asked_[i] = {first, size};
    blocks[i] = {ids_[i], first, size};
  }
  requests_.bulk_read(std::span(blocks).first(count_));
}

void DynamixelChain::take(std::size_t servo, const Answer& answer) noexcept {
  ServoState& state = states_[servo];
  state.position = without_turns(servo, number(servo, answer, dynamixel::kPosition));
  state.speed = kSpeedUnit * number(servo, answer, dynamixel::kVelocity);
  state.effort =
      models_[servo].torque * static_cast<std::int16_t>(number(servo, answer, dynamixel::kCurrent));
  state.voltage = 0.1 * number(servo, answer, dynamixel::kVoltage);
  state.temperature = number(servo, answer, dynamixel::kTemperature);
  const bool alert = (answer.status & dynamixel::kAlert) != 0;
  if (servo == whole_) failures_[servo] = number(servo, answer, dynamixel::kFailure);
  if (!alert) failures_[servo] = 0;
  if (alert && failures_[servo] == 0) unnamed_ |= Mask{1} << servo;
  state.status = alarms_of(failures_[servo]);
}

}  // namespace o80::arms
