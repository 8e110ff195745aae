#pragma once

#include <fstream>
#include <iterator>
#include <string>
#include <vector>

namespace o80 {

/// All of a file.
inline std::vector<char> read_all(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

/// A file of these bytes and no others.
inline void write_all(const std::string& path, const std::vector<char>& bytes) {
  std::ofstream file(path, std::ios::binary | std::ios::trunc);
  file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

}  // namespace o80
