#pragma once

#include "control/batch/record.hpp"

namespace o80::test {

/// How a command of a script ended; no status if it has not.
struct Outcome {
  Status status = Status::none;
  Iteration iteration = 0;
  bool operator==(const Outcome&) const = default;
};

}  // namespace o80::test
