#pragma once

#include <cstdint>
#include <string>
#include <utility>

#include "o80/runtime/observation.hpp"
#include "o80/runtime/robot_types.hpp"

namespace o80 {

/// Preview of a command, computed by UntypedFrontend::preview.
struct Preview {
  /// Number of iterations that the command takes.
  std::int64_t iterations() const { return static_cast<std::int64_t>(rows.count); }

  /// Number of iterations beyond the request, at most 65535.
  std::int64_t late = 0;
  std::string text;  // reason, as in Handle::text; empty if not late
  /// The desired states of all actuators in each of these iterations. `rows.first`: iteration in
  /// which the command would begin.
  Rows rows;
};

/// Preview in the robot's own types.
template <class R>
struct TypedPreview : Preview {
  explicit TypedPreview(Preview&& untyped) : Preview(std::move(untyped)) {}

  ActuatorsOf<R> desired(std::size_t i) const { return unpack<ActuatorsOf<R>>(rows.row(i).data()); }
};

}  // namespace o80
