#pragma once

#include <span>

#include "torture/board.hpp"

namespace torture {

/// A crash point, and how many passages of it a process may make before it is killed there.
struct Label {
  const char* name;
  std::uint32_t passages;
};

/// The crash points that actors of a role pass; bursting backends pass those of backends too.
std::span<const Label> labels_of(Role role);

}  // namespace torture
