#pragma once

#include <stdlib.h>

#include <filesystem>
#include <stdexcept>
#include <string>

/// Segments of a test live in a folder of its own, which goes with it.
class PrivateDirectory {
 public:
  PrivateDirectory() {
    char path[] = "/dev/shm/o80-test-XXXXXX";
    if (mkdtemp(path) == nullptr) throw std::runtime_error("no folder in /dev/shm");
    path_ = path;
    setenv("O80_DIRECTORY", path, 1);
  }
  PrivateDirectory(const PrivateDirectory&) = delete;
  PrivateDirectory& operator=(const PrivateDirectory&) = delete;
  ~PrivateDirectory() {
    unsetenv("O80_DIRECTORY");
    std::filesystem::remove_all(path_);
  }

  const std::string& path() const { return path_; }
  std::string file_of(const std::string& name) const { return path_ + "/o80-" + name; }
  std::size_t files() const {
    std::size_t count = 0;
    for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(path_)) ++count;
    return count;
  }

 private:
  std::string path_;
};
