#include "engine/names.hpp"

#include <charconv>

#include "o80/base/error.hpp"
#include "o80/base/nearest_name.hpp"

namespace o80::mujoco {
namespace {

int count_of(const mjModel& model, mjtObj kind) {
  switch (kind) {
    case mjOBJ_BODY:
      return static_cast<int>(model.nbody);
    case mjOBJ_JOINT:
      return static_cast<int>(model.njnt);
    case mjOBJ_GEOM:
      return static_cast<int>(model.ngeom);
    case mjOBJ_KEY:
      return static_cast<int>(model.nkey);
    case mjOBJ_ACTUATOR:
      return static_cast<int>(model.nactuator);
    default:
      return 0;
  }
}

}  // namespace

std::string trimmed(std::string_view text) {
  while (!text.empty() && text.front() == ' ') text.remove_prefix(1);
  while (!text.empty() && text.back() == ' ') text.remove_suffix(1);
  return std::string(text);
}

std::vector<std::string> entries_of(std::string_view list) {
  std::vector<std::string> entries;
  while (!list.empty()) {
    const auto comma = list.find(',');
    const std::string entry = trimmed(list.substr(0, comma));
    list.remove_prefix(comma == std::string_view::npos ? list.size() : comma + 1);
    if (!entry.empty()) entries.push_back(entry);
  }
  return entries;
}

std::optional<std::vector<double>> numbers_of(std::string_view text) {
  std::vector<double> numbers;
  const char* at = text.data();
  const char* const end = at + text.size();
  while (at != end) {
    if (*at == ' ') {
      ++at;
      continue;
    }
    const auto [rest, error] = std::from_chars(at, end, numbers.emplace_back());
    if (error != std::errc() || (rest != end && *rest != ' ')) return std::nullopt;
    at = rest;
  }
  return numbers;
}

std::string name_of(const mjModel& model, mjtObj kind, int id, const char* fallback) {
  const char* name = mj_id2name(&model, kind, id);
  return name != nullptr && *name != 0 ? name : fallback + std::string("_") + std::to_string(id);
}

int find(const mjModel& model, mjtObj kind, const std::string& name, const char* what) {
  const int id = mj_name2id(&model, kind, name.c_str());
  if (id >= 0) return id;
  std::vector<std::string> known;
  for (int i = 0; i < count_of(model, kind); ++i) {
    const char* each = mj_id2name(&model, kind, i);
    if (each != nullptr && *each != 0) known.emplace_back(each);
  }
  throw DriverError("the model has no " + std::string(what) + " '" + name + "'" +
                    names_instead(name, known));
}

}  // namespace o80::mujoco
