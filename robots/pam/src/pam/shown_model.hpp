#pragma once

#include <string>

#include "pam/plant.hpp"

namespace o80::pam {

/// The names of the joints in the model, from the base on.
inline constexpr const char* kShownJoints[] = {"joint_1", "joint_2", "joint_3", "joint_4"};

/// Model for `o80 view`: the arm with its racket, in MJCF, with the lengths of `Arm`. Custom
/// elements hold the numbers of the muscles, for commanding programs.
std::string shown_model(const Plant::Config& config);

}  // namespace o80::pam
