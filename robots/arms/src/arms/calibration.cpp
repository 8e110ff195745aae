#include "arms/calibration.hpp"

#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <stdexcept>
#include <string_view>

namespace o80::arms {
namespace {

namespace fs = std::filesystem;
using Fields = std::map<std::string, int, std::less<>>;

/// Reads `{"joint": {"field": number, ...}, ...}`, LeRobot's JSON.
class CalibrationText {
 public:
  explicit CalibrationText(std::string text) : text_(std::move(text)) {}

  std::map<std::string, Fields, std::less<>> joints() {
    std::map<std::string, Fields, std::less<>> found;
    each([&](const std::string& joint) {
      each([&](const std::string& field) { found[joint][field] = number(); });
    });
    if (next() != 0) fail("the end");
    return found;
  }

 private:
  static constexpr long kLargest = 1'044'479;  // offset of a Dynamixel servo [steps]

  /// Calls visit(key) behind each key of an object.
  template <class Visit>
  void each(Visit&& visit) {
    take('{');
    if (next() != '}') {
      do {
        const std::string key = word();
        take(':');
        visit(key);
      } while (takes(','));
    }
    take('}');
  }
  char next() {
    while (at_ < text_.size() && std::isspace(static_cast<unsigned char>(text_[at_])) != 0) ++at_;
    return at_ < text_.size() ? text_[at_] : '\0';
  }
  bool takes(char wanted) {
    if (next() != wanted) return false;
    ++at_;
    return true;
  }
  void take(char wanted) {
    if (!takes(wanted)) fail(std::string("'") + wanted + "'");
  }
  std::string word() {
    take('"');
    const std::size_t end = text_.find('"', at_);
    if (end == std::string::npos) fail("'\"'");
    std::string found = text_.substr(at_, end - at_);
    at_ = end + 1;
    return found;
  }
  int number() {
    static_cast<void>(next());
    char* end = nullptr;
    const long value = std::strtol(text_.c_str() + at_, &end, 10);
    const auto stop = static_cast<std::size_t>(end - text_.c_str());
    if (stop == at_ || std::abs(value) > kLargest) fail("a whole number of a servo");
    at_ = stop;
    return static_cast<int>(value);
  }
  [[noreturn]] void fail(const std::string& wanted) const {
    throw std::runtime_error("expected " + wanted + " at character " + std::to_string(at_ + 1));
  }

  std::string text_;
  std::size_t at_ = 0;
};

int field_of(const Fields& fields, std::string_view name) {
  const auto found = fields.find(name);
  if (found == fields.end()) throw std::runtime_error("'" + std::string(name) + "' is missing");
  return found->second;
}

Calibration of_joint(const Fields& fields, int id) {
  if (field_of(fields, "id") != id) {
    throw std::runtime_error("its id must be " + std::to_string(id) + ", not " +
                             std::to_string(field_of(fields, "id")));
  }
  if (field_of(fields, "drive_mode") != 0) {
    throw std::runtime_error("drive_mode must be 0, the only one that LeRobot writes, got " +
                             std::to_string(field_of(fields, "drive_mode")));
  }
  const Calibration found{.offset = field_of(fields, "homing_offset"),
                          .smallest = field_of(fields, "range_min"),
                          .largest = field_of(fields, "range_max")};
  if (found.smallest >= found.largest || found.smallest < 0 || found.largest > 4095) {
    throw std::runtime_error("its range must be inside 0..4095, got " +
                             std::to_string(found.smallest) + ".." + std::to_string(found.largest));
  }
  return found;
}

/// Returns LeRobot's folder of calibrations.
fs::path calibrations() {
  const auto variable = [](const char* name) {
    const char* const text = std::getenv(name);
    return fs::path(text == nullptr ? "" : text);
  };
  fs::path own = variable("HF_LEROBOT_CALIBRATION");
  if (!own.empty()) return own;
  const fs::path lerobot = variable("HF_LEROBOT_HOME");
  if (!lerobot.empty()) return lerobot / "calibration";
  const fs::path hub = variable("HF_HOME");
  const fs::path cache = hub.empty() ? variable("HOME") / ".cache" / "huggingface" : hub;
  return cache / "lerobot" / "calibration";
}

}  // namespace

std::vector<Calibration> read_calibration(const std::string& path,
                                          const std::vector<std::string>& joints) {
  std::ifstream file(path);
  if (!file) throw std::runtime_error("cannot read the calibration " + path);
  std::string joint;
  try {
    const auto found = CalibrationText({std::istreambuf_iterator<char>(file), {}}).joints();
    std::vector<Calibration> calibrations;
    for (const std::string& each : joints) {
      joint = each + ": ";
      const auto of = found.find(each);
      if (of == found.end()) throw std::runtime_error("it is missing");
      calibrations.push_back(of_joint(of->second, static_cast<int>(calibrations.size()) + 1));
    }
    return calibrations;
  } catch (const std::runtime_error& error) {
    throw std::runtime_error("the calibration " + path + ": " + joint + error.what());
  }
}

std::string find_calibration(const std::string& name, const std::vector<std::string>& folders) {
  if (name.find('/') != std::string::npos || name.ends_with(".json")) return name;
  std::vector<std::string> files;
  std::error_code error;
  for (const std::string& folder : folders) {
    for (const auto& file : fs::directory_iterator(calibrations() / folder, error)) {
      const fs::path& path = file.path();
      if (path.extension() == ".json" && (name.empty() || path.stem() == name)) {
        files.push_back(path);
      }
    }
    if (!name.empty() && !files.empty()) return files[0];
  }
  if (name.empty()) return files.size() == 1 ? files[0] : "";
  const std::string leader = folders[0].starts_with("teleoperators") ? " --leader" : "";
  throw std::runtime_error(
      "there is no calibration '" + name + "' in " + (calibrations() / folders[0]).string() +
      ": `o80 arms calibrate --take " + name + leader + "` makes it from the values in the servos");
}

}  // namespace o80::arms
