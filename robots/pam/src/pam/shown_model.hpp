#pragma once

#include <string>

namespace o80::pam {

/// The names of the joints in the model, from the base on.
inline constexpr const char* kShownJoints[] = {"joint_1", "joint_2", "joint_3", "joint_4"};

/// What `o80 view` draws: the arm with its racket, in MJCF, with the lengths of `Arm`.
std::string shown_model();

}  // namespace o80::pam
