#pragma once

#include <string>

#include "pam/plant.hpp"

namespace o80::pam {

/// The names of the joints in the model, from the base on.
inline constexpr const char* kShownJoints[] = {"joint_1", "joint_2", "joint_3", "joint_4"};

/// What `o80 view` draws: the arm with its racket, in MJCF, with the lengths of `Arm`. Its custom
/// elements hold the numbers of the muscles, for those who command the arm.
std::string shown_model(const Plant::Config& config);

}  // namespace o80::pam
