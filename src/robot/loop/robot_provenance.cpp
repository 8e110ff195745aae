#include "robot/loop/robot_provenance.hpp"

#include <dlfcn.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <system_error>
#include <tuple>
#include <utility>

#include "base/sha256.hpp"
#include "memory/os/fork.hpp"

namespace o80 {

namespace fs = std::filesystem;

namespace {

constexpr std::uintmax_t kLargestHashed = 64U << 20;  // [bytes]

/// SHA-256 of the content of a file; empty if it cannot be read or is larger than kLargestHashed.
std::string sha256_of(const fs::path& path) {
  std::error_code error;
  if (!fs::is_regular_file(path, error) || fs::file_size(path, error) > kLargestHashed || error)
    return {};
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(path.c_str(), "rbe"),
                                                             &std::fclose);
  if (file == nullptr) return {};
  Sha256 hash;
  std::array<std::byte, 1U << 16> part;
  while (const std::size_t size = std::fread(part.data(), 1, part.size(), file.get()))
    hash.add({part.data(), size});
  return std::ferror(file.get()) != 0 ? std::string{} : hash.hex();
}

/// The library or program that holds a table; empty if it is not known.
fs::path holder_of(const RobotTable& table) {
  Dl_info info{};
  if (dladdr(&table, &info) == 0 || info.dli_fname == nullptr) return {};
  std::error_code error;
  const fs::path name = info.dli_fname;
  // a program that was found through PATH is called by its bare name
  return fs::canonical(name.has_parent_path() ? name : fs::path("/proc/self/exe"), error);
}

/// Path and hash of the library of each robot; guarded by fork_mutex(), so that a forked child does
/// not find it locked.
using KnownLibraries = std::map<const RobotTable*, std::pair<std::string, std::string>>;

KnownLibraries& known_libraries() {
  static KnownLibraries known;
  return known;
}

/// The library of a robot and its hash, which are computed once: a library stays loaded until the
/// process ends.
std::pair<std::string, std::string> library_of(const RobotTable& table) {
  {
    const std::scoped_lock lock(fork_mutex());
    const auto found = known_libraries().find(&table);
    if (found != known_libraries().end()) return found->second;
  }
  const std::string path = holder_of(table).string();
  name_library(table, path, path);
  return library_of(table);
}

}  // namespace

void name_library(const RobotTable& table, const std::string& path, const std::string& name) {
  const std::pair<std::string, std::string> library{name, sha256_of(path)};
  const std::scoped_lock lock(fork_mutex());
  known_libraries()[&table] = library;
}

Provenance provenance_of(const RobotTable& table, const OptionValues& options) {
  Provenance provenance;
  provenance.robot = table.name;
  provenance.built_with = table.built_with;
  std::tie(provenance.library, provenance.library_sha256) = library_of(table);
  provenance.options = options;
  const std::vector<Option> rows = options_of(table);
  for (const auto& [name, text] : options) {
    const auto row = std::ranges::find(rows, name, &Option::name);
    std::error_code error;
    if (text.empty() || row == rows.end() || row->kind != "text") continue;
    if (!fs::is_regular_file(text, error)) continue;
    provenance.files.push_back({name, fs::absolute(text, error).string(), sha256_of(text)});
  }
  return provenance;
}

Provenance::Options texts_of(const RealTimeOptions& options) {
  const std::string_view policy = kPolicies.at(static_cast<std::size_t>(options.policy));
  Provenance::Options texts{{"policy", std::string(policy)},
                            {"lock_memory", options.lock_memory ? "true" : "false"}};
  if (options.policy != RealTimeOptions::Policy::other)
    texts.emplace_back("priority", std::to_string(options.priority));
  if (!options.processors.empty()) texts.emplace_back("cpus", text_of(options.processors));
  return texts;
}

}  // namespace o80
