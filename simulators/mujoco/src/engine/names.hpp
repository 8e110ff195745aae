#pragma once

#include <mujoco/mujoco.h>

#include <optional>
#include <string>
#include <string_view>
#include <vector>

// Elements of a MuJoCo model by their names.

namespace o80::mujoco {

/// Without spaces around it.
std::string trimmed(std::string_view text);

/// The entries of a comma-separated list, without spaces around them.
std::vector<std::string> entries_of(std::string_view list);

/// Numbers separated by spaces; none if the text has anything else.
std::optional<std::vector<double>> numbers_of(std::string_view text);

/// The name of an element; `<fallback>_<id>` if the model gives none.
std::string name_of(const mjModel& model, mjtObj kind, int id, const char* fallback);

/// The id of a named element. Throws DriverError with the names of the model, or the nearest one;
/// `what` is the kind in words.
int find(const mjModel& model, mjtObj kind, const std::string& name, const char* what);

}  // namespace o80::mujoco
