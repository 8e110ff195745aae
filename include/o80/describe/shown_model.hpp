#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "o80/describe/rows.hpp"

namespace o80 {

/// Part of the model moved by a value of a row.
enum class Shown : std::uint8_t {
  joint,    // one number: position of a hinge or a slide
  position  // three numbers: position of a body with a free joint
};

/// Part of a row that holds a value: the states (desired and observed alike), or the extended
/// values.
enum class ShownFrom : std::uint8_t { states, extended };

/// One value of a row that moves a joint or a body of the model; its numbers are float64.
struct ShownRow {
  NameText name;             // of the joint or of the body
  std::uint32_t offset = 0;  // offset in the states or extended values [bytes]
  Shown what = Shown::joint;
  ShownFrom from = ShownFrom::states;
  std::array<std::uint8_t, 2> reserved{};
  bool operator==(const ShownRow&) const = default;
};
static_assert(std::is_trivially_copyable_v<ShownRow> && std::is_standard_layout_v<ShownRow>);

/// Model (MJCF) with which viewers draw the robot, and the values that move the model. o80 does
/// not read the model, but stores its text, so that a recording can be shown on another computer.
struct ShownModel {
  static constexpr std::size_t kLargest = 1U << 20;  // longest text [bytes]

  std::string mjcf;  // empty: the robot is not drawn
  std::string file;  // path of the model; meshes and textures are searched beside it
  std::vector<ShownRow> values;

  void joint(std::string_view name, std::uint32_t offset, ShownFrom from = ShownFrom::states) {
    values.push_back(
        {.name = NameText(name), .offset = offset, .what = Shown::joint, .from = from});
  }
  void position(std::string_view body, std::uint32_t offset, ShownFrom from = ShownFrom::states) {
    values.push_back(
        {.name = NameText(body), .offset = offset, .what = Shown::position, .from = from});
  }
  bool empty() const { return mjcf.empty() && file.empty() && values.empty(); }
  bool operator==(const ShownModel&) const = default;
};

}  // namespace o80
