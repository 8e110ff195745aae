#include "o80/memory/segment_name.hpp"

#include <algorithm>
#include <cstdlib>

#include "o80/base/error.hpp"

namespace o80 {

std::string segment_directory() {
  const char* directory = std::getenv("O80_DIRECTORY");
  return directory != nullptr && *directory != '\0' ? directory : "/dev/shm";
}

bool is_segment_name(std::string_view name) noexcept {
  const auto allowed = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' ||
           c == '-' || c == '.';
  };
  return !name.empty() && name.size() <= 64 && name.front() != '.' &&
         std::all_of(name.begin(), name.end(), allowed) &&
         name.find(".new-") == std::string_view::npos;
}

void check_segment_name(std::string_view name) {
  if (!is_segment_name(name))
    throw InvalidArgument("'" + std::string(name) +
                          "' cannot name a segment: use 1 to 64 letters, digits, '_', '-' and "
                          "'.', no '.' in front");
}

std::string segment_path(std::string_view name) {
  check_segment_name(name);
  return segment_directory() + "/o80-" + std::string(name);
}

}  // namespace o80
