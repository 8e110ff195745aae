#pragma once

#include <memory>

#include "arms/feetech_chain.hpp"
#include "arms/servo_arm.hpp"

namespace o80::arms {

/// The arm SO-101 (or SO-100): Feetech servos.
class So101 : public ServoArm {
 public:
  explicit So101(const Config& config) : ServoArm(config, kKind) {}

 private:
  static constexpr ArmKind kKind{
      .chain = [](bool /*leader*/) -> std::unique_ptr<ServoChain> {
        return std::make_unique<FeetechChain>(kServos);
      },
      .names = {"so", "so101", "so100"},
      .farthest = {1.9198, 1.7453, 1.69, 1.658, 2.7438}};  // of the published model
};

}  // namespace o80::arms
