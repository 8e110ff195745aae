#pragma once

#include <mujoco/mujoco.h>

#include <optional>
#include <string>
#include <string_view>
#include <vector>

// Finds elements of a MuJoCo model by name.

namespace o80::mujoco {

/// Removes surrounding spaces.
std::string trimmed(std::string_view text);

/// Splits a comma-separated list, without surrounding spaces.
std::vector<std::string> entries_of(std::string_view list);

/// Parses numbers separated by spaces; none for other texts.
std::optional<std::vector<double>> numbers_of(std::string_view text);

/// Name of an element; `<fallback>_<id>` if unnamed.
std::string name_of(const mjModel& model, mjtObj kind, int id, const char* fallback);

/// Finds the id of a named element. Throws DriverError with the model's names, or the nearest one;
/// `what`: the kind in words.
int find(const mjModel& model, mjtObj kind, const std::string& name, const char* what);

}  // namespace o80::mujoco
