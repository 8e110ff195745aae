#pragma once

#include <string>
#include <vector>

#include "torture/board.hpp"

namespace torture {

struct Failure {
  Fault fault;
  std::string text;
};

/// Compares what senders were told and what stands in the segments with what drivers did.
std::vector<Failure> judge(const Round& round);

/// Commands that were compared.
std::uint64_t commands_of(const Round& round);

}  // namespace torture
