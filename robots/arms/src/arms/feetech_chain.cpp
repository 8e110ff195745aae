#include "arms/feetech_chain.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

namespace o80::arms {
namespace {

constexpr double kMostTorque = 2.94;  // of an STS3215 with 12 V [Nm]

}  // namespace

void FeetechChain::set_up(std::size_t servo) {
  const int model = needed(servo, feetech::kModel);
  if (model != feetech::kSts3215) {
    throw std::runtime_error("is of model " + std::to_string(model) +
                             ", but an STS3215 (777) is needed");
  }
  const int firmware = needed(servo, feetech::kFirmware);
  if (servo > 0 && firmware != firmware_) {
    throw std::runtime_error(
        "has another firmware than the servos before it: install the same version on all");
  }
  firmware_ = firmware;
  if (needed(servo, feetech::kMode) != 0) {
    throw std::runtime_error("is not in position mode: `o80 arms calibrate` sets it");
  }
  coarse_[servo] = (needed(servo, feetech::kPhase) & 4) == 0;
  weak_[servo] = needed(servo, feetech::kWeak);
  ServoState& state = states_[servo];
  state.hottest = needed(servo, feetech::kHottest);
  state.least_voltage = 0.1 * needed(servo, feetech::kLeastVoltage);
  state.most_voltage = 0.1 * needed(servo, feetech::kMostVoltage);
}

Calibration FeetechChain::calibration_of(std::size_t servo) {
  return {.offset = needed(servo, feetech::kOffset),
          .smallest = needed(servo, feetech::kSmallest),
          .largest = needed(servo, feetech::kLargest)};
}

Setting FeetechChain::speed(std::size_t servo, double speed) const noexcept {
  return {feetech::kSpeed, std::max(1, static_cast<int>(speed) / (coarse_[servo] ? 50 : 1))};
}

Setting FeetechChain::acceleration(double acceleration) const noexcept {
  return {feetech::kAcceleration, static_cast<int>(acceleration / 100.0)};
}

Setting FeetechChain::strength(std::size_t /*servo*/, double share) const noexcept {
  return {feetech::kStrength, static_cast<int>(std::lround(share * 1000.0))};
}

void FeetechChain::ask(std::uint8_t variant) noexcept {
  // every tenth transfer also reads the torque
  if (asked_[0].first == feetech::kTorque.address && !failed_) transfers_ = 0;
  const bool with_torque = ++transfers_ >= kTorqueEvery;
  const std::uint8_t first = (with_torque ? feetech::kTorque : feetech::kPosition).address;
  const auto size =
      static_cast<std::uint8_t>(feetech::kPosition.address - first + kShortest + variant);
  asked_.fill({first, size});
  requests_.sync_read(first, size, std::span(ids_).first(count_));
}

void FeetechChain::take(std::size_t servo, const Answer& answer) noexcept {
  ServoState& state = states_[servo];
  state.position = number(servo, answer, feetech::kPosition);
  state.speed = number(servo, answer, feetech::kMoved);
  state.effort = number(servo, answer, feetech::kLoad) * 1e-3 * kMostTorque;
  state.voltage = 0.1 * number(servo, answer, feetech::kVoltage);
  state.temperature = number(servo, answer, feetech::kTemperature);
  state.status = answer.status;
}

}  // namespace o80::arms
