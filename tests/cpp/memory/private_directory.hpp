#pragma once

#include <fcntl.h>
#include <stdlib.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>

/// Removes a folder at the end of this process and of the children that it forked, also when they
/// are killed: another process waits for that.
class FolderGuardian {
 public:
  explicit FolderGuardian(const std::string& path) {
    int ends[2];
    if (pipe2(ends, O_CLOEXEC) != 0) throw std::runtime_error("no pipe");
    life_ = ends[1];
    const pid_t child = fork();
    if (child < 0) throw std::runtime_error("no process");
    if (child == 0) {
      // a child of a child: whoever kills a test and its children leaves it alone
      setsid();
      if (fork() == 0) wait_for_the_end(ends[0], path);
      _exit(0);
    }
    close(ends[0]);
    waitpid(child, nullptr, 0);
  }
  FolderGuardian& operator=(FolderGuardian&&) = delete;
  ~FolderGuardian() { close(life_); }

 private:
  static void wait_for_the_end(int life, const std::string& path) {
    // also the standard output: who reads it waits until everybody has closed it
    for (int other = 0; other < 1024; ++other) {
      if (other != life) close(other);
    }
    char byte;
    while (read(life, &byte, 1) < 0 && errno == EINTR) {
    }
    std::error_code ignored;
    std::filesystem::remove_all(path, ignored);
    _exit(0);
  }

  int life_;  // open as long as one of those processes lives
};

/// Segments of a test live in a folder of its own, which goes with it.
class PrivateDirectory {
 public:
  PrivateDirectory() {
    char path[] = "/dev/shm/o80-test-XXXXXX";
    if (mkdtemp(path) == nullptr) throw std::runtime_error("no folder in /dev/shm");
    path_ = path;
    guardian_.emplace(path_);
    setenv("O80_DIRECTORY", path, 1);
  }
  PrivateDirectory& operator=(PrivateDirectory&&) = delete;
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
  std::optional<FolderGuardian> guardian_;
};
