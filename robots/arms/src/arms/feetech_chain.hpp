#pragma once

#include "arms/feetech.hpp"
#include "arms/servo_chain.hpp"

namespace o80::arms {

/// STS3215 servos.
class FeetechChain : public ServoChain {
 public:
  explicit FeetechChain(std::size_t count)
      : ServoChain(count, requests_, answers_, feetech::kTorque, feetech::kGoal) {}

  void set_up(std::size_t servo) override;
  Calibration calibration_of(std::size_t servo) override;
  void queue_recovery(Mask servos) noexcept override { queue_torque(servos, false); }

  Setting speed(std::size_t servo, double speed) const noexcept override;
  Setting acceleration(double acceleration) const noexcept override;
  Setting strength(std::size_t servo, double share) const noexcept override;
  int strength_of_overloaded(std::size_t servo) const noexcept override { return weak_[servo]; }

 private:
  static constexpr int kTorqueEvery = 10;       // transfers
  static constexpr std::uint8_t kShortest = 8;  // position to temperature [bytes]

  void ask(std::uint8_t variant) noexcept override;
  void take(std::size_t servo, const Answer& answer) noexcept override;

  feetech::Requests requests_;
  feetech::Answers answers_;
  std::array<bool, kMost> coarse_{};  // speeds are in 50 steps/s
  std::array<int, kMost> weak_{};     // strength after an overload [%]
  int firmware_ = -1;                 // of the previous servos
  int transfers_ = 0;                 // transfers since the last request of torque
};

}  // namespace o80::arms
