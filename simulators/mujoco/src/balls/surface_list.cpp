#include "balls/surface_list.hpp"

#include <algorithm>
#include <string_view>

#include "engine/names.hpp"
#include "o80/base/error.hpp"
#include "o80/base/nearest_name.hpp"

namespace o80::mujoco {
namespace {

/// Parses "0.8" => 0.8 three times; "0.7 0.7 0.9" => these; a fourth number is the friction. False
/// for other texts.
bool parse_bounce(std::string_view text, SurfaceEntry& entry) {
  const auto numbers = numbers_of(text);
  const std::size_t count = numbers ? numbers->size() : 0;
  if (count == 1) {
    entry.restitution.fill(numbers->front());
    return true;
  }
  if (count != 3 && count != 4) return false;
  std::copy_n(numbers->begin(), 3, entry.restitution.begin());
  if (count == 4) entry.friction = numbers->back();
  return true;
}

void check(const SurfaceEntry& entry) {
  for (const double share : entry.restitution) {
    if (share >= 0 && share <= 1) continue;
    throw DriverError("the restitution of '" + entry.geom + "' must be shares from 0 to 1, got " +
                      std::to_string(share));
  }
  if (!(entry.friction >= 0)) {
    throw DriverError("the friction of '" + entry.geom + "' must not be negative, got " +
                      std::to_string(entry.friction));
  }
}

SurfaceEntry parsed_entry(const std::string& text, const Restitution& common) {
  const auto equals = text.find('=');
  SurfaceEntry entry{.geom = trimmed(text.substr(0, equals)), .restitution = common};
  if (equals != std::string::npos &&
      !parse_bounce(std::string_view(text).substr(equals + 1), entry)) {
    throw DriverError("surfaces: '" + text +
                      "' must have one number after '=', or three or four separated by spaces: the "
                      "shares of the velocity that a bounce keeps (two tangents, normal), and the "
                      "coefficient of friction");
  }
  check(entry);
  return entry;
}

}  // namespace

std::vector<SurfaceEntry> surfaces_of(const BallOptions& options) {
  std::vector<SurfaceEntry> surfaces;
  std::vector<std::string> names;
  for (const std::string& text : entries_of(options.surfaces)) {
    surfaces.push_back(parsed_entry(text, options.restitution));
    const std::string& name = surfaces.back().geom;
    if (std::ranges::find(names, name) != names.end()) {
      throw DriverError("surfaces names '" + name + "' twice");
    }
    names.push_back(name);
  }
  for (const std::string& name : entries_of(options.watched)) {
    const auto at = std::ranges::find(names, name);
    if (at == names.end()) {
      throw DriverError("watched: '" + name + "' is not among the surfaces" +
                        names_instead(name, names));
    }
    surfaces[static_cast<std::size_t>(at - names.begin())].watched = true;
  }
  return surfaces;
}

}  // namespace o80::mujoco
