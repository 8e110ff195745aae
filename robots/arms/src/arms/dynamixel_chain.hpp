#pragma once

#include <span>

#include "arms/dynamixel.hpp"
#include "arms/servo_chain.hpp"

namespace o80::arms {

/// Dynamixel servos of the X series with LeRobot's settings of a Koch arm: positions over many
/// turns, and a current limit of the last servo.
class DynamixelChain : public ServoChain {
 public:
  /// A kind of servo.
  struct Model {
    int number;  // in its register
    const char* name;
    double torque;  // of a unit of its current, or load [Nm]
  };
  static constexpr Model kXl430{1060, "XL430-W250", 1.5e-3};
  static constexpr Model kXl330{1200, "XL330-M288", 3.5e-4};
  static constexpr Model kXl330Weak{1190, "XL330-M077", 1.5e-4};

  /// `stiff`: the servo with LeRobot's gains of an elbow.
  DynamixelChain(std::span<const Model> models, std::size_t stiff);

  void set_up(std::size_t servo) override;
  Calibration calibration_of(std::size_t servo) override;
  void queue_motion(Mask servos, double speed, double acceleration,
                    std::span<const double> strengths) noexcept override;
  void queue_recovery(Mask servos) noexcept override;
  bool recovery_restarts() const noexcept override { return true; }

  Setting goal(std::size_t servo, int position) const noexcept override;
  Setting speed(std::size_t servo, double speed) const noexcept override;
  Setting acceleration(double acceleration) const noexcept override;
  Setting strength(std::size_t servo, double share) const noexcept override;
  int strength_of_overloaded(std::size_t /*servo*/) const noexcept override { return 0; }

 private:
  void keep(std::size_t servo, const Setting& setting);
  int without_turns(std::size_t servo, int position) noexcept;
  void queue_watchdog(bool on) noexcept override;
  void ask(std::uint8_t variant) noexcept override;
  void take(std::size_t servo, const Answer& answer) noexcept override;

  dynamixel::Requests requests_;
  dynamixel::Answers answers_;
  std::array<Model, kMost> models_{};
  std::size_t stiff_;
  std::array<int, kMost> middles_{};   // of the calibrated ranges [steps]
  std::array<int, kMost> turns_{};     // surplus turns in a servo's count [steps]
  std::array<bool, kMost> placed_{};   // turns are known
  std::array<int, kMost> most_{};      // of the register of the strength limit
  std::array<int, kMost> failures_{};  // bits of dynamixel::Failure
  Mask unnamed_ = 0;                   // servos with an unread failure
  std::size_t whole_ = 0;              // the servo that also reports torque and failure
};

}  // namespace o80::arms
