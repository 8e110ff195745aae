#pragma once

#include <array>
#include <memory>

#include "arms/dynamixel_chain.hpp"
#include "arms/servo_arm.hpp"

namespace o80::arms {

/// The arm Koch v1.1: Dynamixel servos.
class Koch : public ServoArm {
 public:
  explicit Koch(const Config& config) : ServoArm(config, kKind) {}

 private:
  static std::unique_ptr<ServoChain> chain(bool leader) {
    using Chain = DynamixelChain;
    constexpr auto kWeak = Chain::kXl330Weak;
    constexpr auto kXl330 = Chain::kXl330;
    constexpr std::array<Chain::Model, kServos> kLeader{kWeak, kWeak, kWeak, kWeak, kWeak, kWeak};
    constexpr std::array<Chain::Model, kServos> kFollower{Chain::kXl430, Chain::kXl430, kXl330,
                                                          kXl330,        kXl330,        kXl330};
    return std::make_unique<Chain>(leader ? kLeader : kFollower, 2);
  }
  static constexpr ArmKind kKind{
      .chain = chain, .names = {"koch"}, .farthest = {3.1416, 3.1416, 3.1416, 3.1416, 3.1416}};
};

}  // namespace o80::arms
