#pragma once

#include <utility>

#include "o80/runtime/observation.hpp"
#include "o80/runtime/robot_types.hpp"

namespace o80 {

/// One row of a history, in the robot's own types.
template <class R>
class Observation : public UntypedObservation {
 public:
  explicit Observation(UntypedObservation&& untyped) : UntypedObservation(std::move(untyped)) {}

  ActuatorsOf<R> desired() const { return unpack<ActuatorsOf<R>>(UntypedObservation::desired()); }
  ActuatorsOf<R> observed() const { return unpack<ActuatorsOf<R>>(UntypedObservation::observed()); }
  ExtendedOf<R> extended() const { return unpack<ExtendedOf<R>>(UntypedObservation::extended()); }
};

}  // namespace o80
