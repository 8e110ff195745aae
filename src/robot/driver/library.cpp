#include "robot/driver/library.hpp"

#include <cxxabi.h>
#include <dlfcn.h>
#include <link.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string_view>
#include <utility>

#include "base/sentence.hpp"
#include "o80/base/error.hpp"
#include "o80/base/nearest_name.hpp"
#include "robot/driver/driver_instance.hpp"
#include "robot/driver/trusted_library.hpp"

namespace o80 {

namespace fs = std::filesystem;

namespace {

/// The folder of the robots that come with o80, beside the library that contains this code.
fs::path bundled_folder() {
  Dl_info info{};
  if (dladdr(reinterpret_cast<void*>(&bundled_folder), &info) == 0) return {};
  std::error_code ignored;
  const fs::path library = fs::canonical(info.dli_fname, ignored);
  return library.parent_path() / "o80" / "robots";
}

/// Folders in which robots are found by name, those of O80_ROBOT_PATH first.
std::vector<std::string> robot_folders() {
  std::vector<std::string> folders;
  if (const char* given = secure_getenv("O80_ROBOT_PATH"); given != nullptr) {
    std::istringstream parts(given);
    for (std::string folder; std::getline(parts, folder, ':');) {
      if (!folder.empty()) folders.push_back(folder);
    }
  }
  folders.push_back(bundled_folder().string());
  return folders;
}

/// True if the file is a library that exports the table of a robot. Only reads it: loading would
/// run code of a library that may be no robot.
bool is_robot_library(const fs::path& path) {
  std::error_code ignored;
  if (!fs::is_regular_file(path, ignored)) return false;
  const std::uintmax_t size = fs::file_size(path, ignored);
  std::ifstream file(path, std::ios::binary);
  const auto read = [&]<class Row>(std::uintmax_t at, std::size_t count, std::vector<Row>& rows) {
    if (at > size || count > (size - at) / sizeof(Row)) return false;
    rows.resize(count);
    const auto bytes = static_cast<std::streamsize>(count * sizeof(Row));
    file.seekg(static_cast<std::streamoff>(at));
    return file.read(reinterpret_cast<char*>(rows.data()), bytes).good();
  };
  std::vector<ElfW(Ehdr)> head;
  std::vector<ElfW(Shdr)> sections;
  if (!read(0, 1, head) || std::memcmp(head[0].e_ident, ELFMAG, SELFMAG) != 0 ||
      !read(head[0].e_shoff, head[0].e_shnum, sections)) {
    return false;
  }
  for (const ElfW(Shdr) & section : sections) {
    if (section.sh_type != SHT_DYNSYM || section.sh_link >= sections.size()) continue;
    const ElfW(Shdr) & texts = sections[section.sh_link];
    std::vector<ElfW(Sym)> symbols;
    std::vector<char> names;
    if (!read(section.sh_offset, section.sh_size / sizeof(ElfW(Sym)), symbols) ||
        !read(texts.sh_offset, texts.sh_size, names)) {
      return false;
    }
    names.push_back(0);
    for (const ElfW(Sym) & symbol : symbols) {
      if (symbol.st_shndx == SHN_UNDEF || symbol.st_name >= names.size()) continue;
      if (std::string_view(&names[symbol.st_name]) == kRobotSymbol) return true;
    }
  }
  return false;
}

/// Robots of the other packages of o80's repository, and these packages.
constexpr std::array<std::pair<std::string_view, std::string_view>, 4> kPackaged{
    {{"koch", "o80-arms"}, {"mujoco", "o80-mujoco"}, {"pam", "o80-pam"}, {"so101", "o80-arms"}}};

/// Installed versions of a missing shared library ("libx.so.4.0.1"). A wheel puts it into package
/// "x", beside the package of the robot, which is a folder or a few above the robot's library.
std::string other_versions(const fs::path& robot, const std::string& missing) {
  const std::string::size_type end = missing.find(".so");
  if (end == std::string::npos || missing.rfind("lib", 0) != 0) return {};
  const std::string package = missing.substr(3, end - 3);
  std::string found;
  std::error_code ignored;
  fs::path above = robot.parent_path();
  for (int level = 0; level < 4 && found.empty(); ++level) {
    above = above.parent_path();
    for (const auto& entry : fs::directory_iterator(above / package, ignored)) {
      const std::string name = entry.path().filename().string();
      if (name.rfind(missing.substr(0, end + 3), 0) != 0) continue;
      found += (found.empty() ? "" : ", ") + name;
    }
  }
  return found;
}

/// The undefined function or variable in an error of the dynamic linker, as C++ writes it.
std::string undefined_symbol(const std::string& message) {
  constexpr std::string_view kMark = "undefined symbol: ";
  const std::string::size_type at = message.find(kMark);
  if (at == std::string::npos) return {};
  const std::string::size_type begin = at + kMark.size();
  // ", version NAME" may follow
  const std::string symbol = message.substr(begin, message.find_first_of(", ", begin) - begin);
  int status = 0;
  const std::unique_ptr<char, decltype(&std::free)> plain(
      abi::__cxa_demangle(symbol.c_str(), nullptr, nullptr, &status), &std::free);
  return plain == nullptr ? symbol : plain.get();
}

/// What the dynamic linker said, with the cure: it names one library only.
std::string why_not_loaded(const std::string& robot, const std::string& message) {
  std::string text =
      "the robot library '" + robot + "' cannot be loaded: " + sentence(message) + " ";
  if (const std::string symbol = undefined_symbol(message); !symbol.empty()) {
    const bool of_o80 = symbol.find("o80::") != std::string::npos;
    return text + (of_o80
                       ? "Build the robot again with the o80 that is installed, which has no '" +
                             symbol + "'"
                       : "It uses '" + symbol +
                             "', which is not defined in it or in a library that it links: add the "
                             "source file or the library (target_link_libraries) that defines it");
  }
  const std::string missing = message.substr(0, message.find(':'));
  if (message.find("cannot open shared object file") == std::string::npos || missing == robot) {
    return text + "Build the robot again with the o80 that is installed";
  }
  const std::string there = other_versions(robot, missing);
  text += "It was built for " + missing;
  text += there.empty() ? ", which is not installed" : ", but installed is " + there;
  return text +
         ". Install the version it was built for, or build the package of the robot again with " +
         "the installed one";
}

std::string where(const std::string& name_or_path) {
  if (name_or_path.find('/') != std::string::npos) return fs::absolute(name_or_path).string();
  std::vector<std::string> known;
  for (const RobotFile& robot : find_robots()) {
    if (robot.name == name_or_path) return robot.path;
    known.push_back(robot.name);
  }
  throw DriverError(no_such_robot(name_or_path, known));
}

}  // namespace

std::string no_such_robot(const std::string& name, const std::vector<std::string>& known) {
  std::string why = "there is no robot '" + name + "'";
  const auto* packaged =
      std::ranges::find(kPackaged, name, &std::pair<std::string_view, std::string_view>::first);
  if (packaged != kPackaged.end()) {
    return why + ". It is in the package " + std::string(packaged->second) + ": `pip install " +
           std::string(packaged->second) +
           "`. A C++ program finds it if O80_ROBOT_PATH has the folder of its library, which `o80 "
           "run` lists";
  }
  why += names_instead(name, known);
  if (!why.ends_with('?')) why += '.';
  return why +
         " `o80 run` lists all robots. For a library, give its path (for one in this folder: "
         "./NAME.so), or add its folder to O80_ROBOT_PATH";
}

std::vector<RobotFile> find_robots() {
  std::vector<RobotFile> robots;
  for (const std::string& folder : robot_folders()) {
    std::error_code ignored;
    std::vector<RobotFile> here;
    for (const auto& entry : fs::directory_iterator(folder, ignored)) {
      if (entry.path().extension() == ".so" && is_robot_library(entry.path())) {
        here.push_back({entry.path().stem().string(), fs::absolute(entry.path()).string()});
      }
    }
    std::ranges::sort(here, {}, &RobotFile::name);
    for (RobotFile& robot : here) {
      const bool hidden = std::ranges::any_of(
          robots, [&](const RobotFile& other) { return other.name == robot.name; });
      if (!hidden) robots.push_back(std::move(robot));
    }
  }
  return robots;
}

RobotLibrary RobotLibrary::load(const std::string& name_or_path) {
  RobotLibrary library;
  library.path = where(name_or_path);
  std::error_code ignored;
  if (!fs::exists(library.path, ignored)) {
    throw DriverError("there is no robot library '" + library.path + "'");
  }
  const TrustedLibrary file(library.path);
  void* handle = dlopen(file.path().c_str(), RTLD_NOW | RTLD_LOCAL);
  if (handle == nullptr) throw DriverError(why_not_loaded(library.path, dlerror()));
  auto* function = reinterpret_cast<RobotTableFunction>(dlsym(handle, kRobotSymbol));
  if (function == nullptr) {
    throw DriverError("'" + library.path +
                      "' is not a robot library: its sources have no O80_ROBOT(name, Driver)");
  }
  library.table = function();
  check_table(*library.table, library.path);
  return library;
}

}  // namespace o80
