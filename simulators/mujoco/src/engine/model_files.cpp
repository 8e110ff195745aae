#include "engine/model_files.hpp"

#include <cctype>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>
#include <string_view>
#include <system_error>

namespace o80::mujoco {
namespace {

using std::filesystem::path;

/// Lists quoted values of a text that may be files, or folders of files.
struct Quoted {
  void read(std::string_view text) {
    std::size_t begin = 0;
    while ((begin = text.find_first_of("'\"", begin)) != text.npos) {
      const std::size_t end = text.find(text[begin], begin + 1);
      if (end == text.npos) return;
      const std::string value(text.substr(begin + 1, end - begin - 1));
      const std::string extension = path(value).extension();
      if (text.substr(0, begin).ends_with("dir=")) folders.insert(value + "/");
      if (extension.size() > 1 && std::isalpha(extension[1]) != 0) files.insert(value);
      begin = end + 1;
    }
  }

  std::set<std::string> files;
  std::set<std::string> folders{""};
};

}  // namespace

std::string state_of_files(const std::string& path_of_model) {
  std::string state;
  Quoted quoted;
  std::set<path> seen, bases;
  const auto add = [&](const path& file) {
    std::error_code failed;
    if (!is_regular_file(file, failed) || !seen.insert(file).second) return false;
    state += file.string() + '\0';
    if (file.extension() != ".xml" && file != path_of_model) {
      const auto changed = last_write_time(file, failed).time_since_epoch().count();
      state += std::to_string(file_size(file, failed)) + ' ' + std::to_string(changed) + '\0';
      return false;
    }
    std::ifstream stream(file, std::ios::binary);
    const std::string text(std::istreambuf_iterator<char>(stream), {});
    quoted.read(text);
    bases.insert(file.parent_path());
    state += text + '\0';
    return true;
  };
  for (bool more = add(path_of_model); more;) {
    more = false;
    for (const path& base : std::set<path>(bases)) {  // copies: add() extends all three
      for (const std::string& folder : std::set<std::string>(quoted.folders)) {
        for (const std::string& file : std::set<std::string>(quoted.files)) {
          if (add((base / folder / file).lexically_normal())) more = true;
        }
      }
    }
  }
  return state;
}

}  // namespace o80::mujoco
