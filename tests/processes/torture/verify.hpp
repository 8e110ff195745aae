#pragma once

#include "torture/actor.hpp"

namespace torture {

/// Judges rows by what they say of themselves and by the driver's journal.
class Verifier {
 public:
  Verifier(Actor& actor, const o80::UntypedFrontend& frontend);

  /// A row of iteration k, or of any if k < 0. Returns its sensors.
  Sensors verify(const std::byte* row, o80::Iteration k = -1);
  Sensors verify(const o80::UntypedObservation& row, o80::Iteration k = -1) {
    return verify(row.bytes(), k);
  }

 private:
  Actor& actor_;
  Generation& life_;
  o80::RowLayout layout_;
};

}  // namespace torture
