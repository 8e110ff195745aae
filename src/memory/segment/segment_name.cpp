#include "memory/segment/segment_name.hpp"

#include <dirent.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cinttypes>
#include <cstdio>
#include <cstdlib>

#include "o80/base/error.hpp"

namespace o80 {

namespace {

constexpr const char* kDirectory = "/dev/shm";
constexpr std::string_view kPrefix = "o80-";
constexpr std::string_view kCommands = ".commanders-";
constexpr std::string_view kDraft = ".new-";

std::string with_epoch(std::string path, std::string_view mark, std::uint64_t epoch) {
  char digits[17];
  std::snprintf(digits, sizeof digits, "%016" PRIx64, epoch);
  return path.append(mark).append(digits);
}

}  // namespace

std::string segment_directory() {
  const char* directory = secure_getenv("O80_DIRECTORY");
  return directory != nullptr && *directory != '\0' ? directory : kDirectory;
}

std::string directory_problem() {
  const std::string directory = segment_directory();
  struct stat found{};
  if (stat(directory.c_str(), &found) == 0 && S_ISDIR(found.st_mode)) {
    // without permission every listing would be empty
    if (access(directory.c_str(), R_OK | X_OK) == 0) return {};
    return "The directory " + directory +
           " cannot be read by this user, so its segments are not seen: ask its owner, or set "
           "O80_DIRECTORY to another one";
  }
  const bool given = secure_getenv("O80_DIRECTORY") != nullptr && directory != kDirectory;
  return "The directory " + directory + (given ? ", which O80_DIRECTORY names, " : " ") +
         "does not exist: " + (given ? "create it, or unset O80_DIRECTORY" : "mount a tmpfs there");
}

bool is_segment_name(std::string_view name) noexcept {
  const auto allowed = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' ||
           c == '-' || c == '.';
  };
  return !name.empty() && name.size() <= 64 && name.front() != '.' && name.front() != '-' &&
         std::all_of(name.begin(), name.end(), allowed) &&
         name.find(kDraft) == std::string_view::npos &&
         name.find(kCommands) == std::string_view::npos;
}

void check_segment_name(std::string_view name) {
  if (!is_segment_name(name))
    throw InvalidArgument("'" + std::string(name) +
                          "' cannot name a segment: use 1 to 64 letters, digits, '_', '-' and "
                          "'.', with neither '.' nor '-' in front");
}

std::string segment_path(std::string_view name) {
  check_segment_name(name);
  return (segment_directory() + "/").append(kPrefix).append(name);
}

std::string commands_path(std::string_view name, std::uint64_t epoch) {
  return with_epoch(segment_path(name), kCommands, epoch);
}

std::string draft_path(std::string_view name, std::uint64_t epoch) {
  return with_epoch(segment_path(name), kDraft, epoch);
}

std::optional<SegmentFileName> parse_file_name(std::string_view file) {
  if (!file.starts_with(kPrefix)) return std::nullopt;
  file.remove_prefix(kPrefix.size());
  SegmentFileName parsed;
  for (const auto& [mark, kind] : {std::pair(kCommands, SegmentFileName::Kind::commands),
                                   std::pair(kDraft, SegmentFileName::Kind::draft)}) {
    const std::size_t at = file.find(mark);
    if (at == std::string_view::npos) continue;
    const std::string digits(file.substr(at + mark.size()));
    const char* const end = digits.data() + digits.size();
    const auto read = std::from_chars(digits.data(), end, parsed.epoch, 16);
    if (digits.size() != 16 || read.ec != std::errc() || read.ptr != end) return std::nullopt;
    parsed.kind = kind;
    file = file.substr(0, at);
    break;
  }
  if (!is_segment_name(file)) return std::nullopt;
  parsed.name = file;
  return parsed;
}

std::vector<SegmentFileName> list_files(int* error) {
  std::vector<std::string> names;
  DIR* directory = opendir(segment_directory().c_str());
  if (directory == nullptr) {
    if (error != nullptr && errno != ENOENT && errno != ENOTDIR && errno != EACCES) *error = errno;
    return {};
  }
  errno = 0;
  while (const dirent* entry = readdir(directory)) {
    names.emplace_back(entry->d_name);
    errno = 0;
  }
  if (error != nullptr) *error = errno;
  closedir(directory);
  std::sort(names.begin(), names.end());
  std::vector<SegmentFileName> files;
  for (const std::string& name : names)
    if (const auto file = parse_file_name(name)) files.push_back(*file);
  return files;
}

}  // namespace o80
