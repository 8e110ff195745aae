#include "engine/urdf_speeds.hpp"

#include <algorithm>
#include <cctype>
#include <fstream>
#include <iterator>
#include <string_view>

#include "engine/names.hpp"
#include "o80/base/error.hpp"

namespace o80::mujoco {
namespace {

constexpr auto kNowhere = std::string_view::npos;

/// Cuts the first tag off the text, without angles: `limit upper="1"/`; empty at the end.
std::string_view next_tag(std::string_view& text) {
  while (true) {
    text.remove_prefix(std::min(text.find('<'), text.size()));
    const bool is_comment = text.starts_with("<!--");
    const auto end = text.find(is_comment ? "-->" : ">");
    if (end == kNowhere) return {};
    const std::string_view tag = text.substr(1, end - 1);
    text.remove_prefix(end);
    if (!is_comment) return tag;
  }
}

bool is_space(char each) { return std::isspace(static_cast<unsigned char>(each)) != 0; }

bool opens(std::string_view tag, std::string_view element) {
  return tag.starts_with(element) &&
         (tag.size() == element.size() || is_space(tag[element.size()]));
}

/// Value of an attribute; empty if missing in the tag.
std::string_view value_of(std::string_view tag, std::string_view attribute) {
  for (auto at = tag.find(attribute); at != kNowhere; at = tag.find(attribute, at + 1)) {
    const auto equals = tag.find_first_not_of(" \t\r\n", at + attribute.size());
    if (!is_space(tag[at - 1]) || equals == kNowhere || tag[equals] != '=') continue;
    const auto begin = tag.find_first_of("'\"", equals);
    if (begin == kNowhere) return {};
    return tag.substr(begin + 1, tag.find(tag[begin], begin + 1) - begin - 1);
  }
  return {};
}

}  // namespace

std::map<std::string, double> urdf_speeds(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  const std::string file(std::istreambuf_iterator<char>(stream), {});
  std::map<std::string, double> speeds;
  std::string joint;
  bool is_urdf = false;
  std::string_view text = file;
  for (std::string_view tag = next_tag(text); !tag.empty(); tag = next_tag(text)) {
    if (opens(tag, "mujoco") && !is_urdf) return {};  // MJCF
    if (opens(tag, "robot")) is_urdf = true;
    if (opens(tag, "joint")) joint = value_of(tag, "name");
    if (!is_urdf || joint.empty() || !opens(tag, "limit")) continue;
    const std::string_view given = value_of(tag, "velocity");
    const auto numbers = numbers_of(given);
    if (given.empty()) continue;
    if (!numbers || numbers->size() != 1 || !(numbers->front() >= 0)) {
      throw DriverError("'" + path + "': the velocity of joint '" + joint +
                        "' must be a number from 0, got '" + std::string(given) + "'");
    }
    if (numbers->front() > 0) speeds[joint] = numbers->front();
  }
  return speeds;
}

}  // namespace o80::mujoco
