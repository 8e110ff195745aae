#pragma once

#include <dirent.h>
#include <fcntl.h>
#include <linux/futex.h>
#include <pthread.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cstdint>
#include <fstream>
#include <functional>
#include <string>
#include <vector>

#include "memory/child_process.hpp"

namespace o80 {

/// Another user who may read what the permissions of the files in a directory let him read, and
/// does the worst with it: read locks on every byte, also queued behind the locks of others, and
/// hundreds of threads asleep on the words of the mapped files.
class HostileObserver {
 public:
  static constexpr std::uint64_t kBytes = 32;         // that are locked one by one
  static constexpr std::uint32_t kWordsOfAPage = 64;  // that are slept on

  explicit HostileObserver(const std::string& directory)
      : child_([directory](const ChildProcess::Ready& ready) {
          if (!become_a_stranger()) _exit(2);
          // with the test, however that ends; to be asked for after a change of user
          prctl(PR_SET_PDEATHSIG, SIGKILL);
          if (harass(directory) == 0) _exit(4);
          ready();
          pause_for_ever();
        }) {}

  /// False if this test may not become another user, or nothing could be opened.
  bool wait_until_at_work() {
    if (!child_.wait_until_ready()) return false;
    while (!all_asleep()) usleep(1000);
    return true;
  }
  /// Its threads, one for each word and for each lock it queues for.
  std::size_t threads() const { return tasks().size(); }

 private:
  static void start(std::function<void()> body) {
    pthread_attr_t small;
    pthread_attr_init(&small);
    pthread_attr_setstacksize(&small, 64U << 10);
    pthread_t thread;
    auto* own = new std::function<void()>(std::move(body));
    const auto run = [](void* given) -> void* {
      (*static_cast<std::function<void()>*>(given))();
      return nullptr;
    };
    if (pthread_create(&thread, &small, run, own) != 0) _exit(5);
    pthread_attr_destroy(&small);
  }
  static void lock(int file, std::uint64_t byte) {
    struct flock range{};
    range.l_type = F_RDLCK;
    range.l_whence = SEEK_SET;
    range.l_start = static_cast<off_t>(byte);
    range.l_len = 1;
    if (fcntl(file, F_OFD_SETLK, &range) == 0) return;
    start([file, range]() mutable { fcntl(file, F_OFD_SETLKW, &range); });
  }
  static void sleep_on(const std::uint32_t* word) {
    start([word] {
      while (true) {
        const std::uint32_t value = *static_cast<const volatile std::uint32_t*>(word);
        if (syscall(SYS_futex, word, FUTEX_WAIT, value, nullptr, nullptr, 0) != 0) usleep(1000);
      }
    });
  }
  /// How many files it could open.
  static int harass(const std::string& directory) {
    int opened = 0;
    DIR* files = opendir(directory.c_str());
    while (const dirent* entry = files == nullptr ? nullptr : readdir(files)) {
      const std::string path = directory + "/" + entry->d_name;
      const int file = open(path.c_str(), O_RDONLY | O_CLOEXEC);
      struct stat status;
      if (file < 0 || fstat(file, &status) != 0 || !S_ISREG(status.st_mode)) continue;
      ++opened;
      flock(file, LOCK_SH | LOCK_NB);
      for (std::uint64_t byte = 0; byte < kBytes; ++byte) lock(file, byte);
      const auto size = static_cast<std::size_t>(status.st_size);
      if (size == 0) continue;
      const auto page = static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
      const void* memory = mmap(nullptr, size, PROT_READ, MAP_SHARED, file, 0);
      if (memory == MAP_FAILED) _exit(6);
      for (std::size_t begin = 0; begin + page <= size; begin += page)
        for (std::uint32_t i = 0; i < kWordsOfAPage; ++i)
          sleep_on(
              reinterpret_cast<const std::uint32_t*>(static_cast<const char*>(memory) + begin) + i);
    }
    if (files != nullptr) closedir(files);
    return opened;
  }

  std::vector<std::string> tasks() const {
    std::vector<std::string> found;
    const std::string folder = "/proc/" + std::to_string(child_.pid()) + "/task";
    DIR* entries = opendir(folder.c_str());
    while (const dirent* entry = entries == nullptr ? nullptr : readdir(entries))
      if (entry->d_name[0] != '.') found.push_back(folder + "/" + entry->d_name);
    if (entries != nullptr) closedir(entries);
    return found;
  }
  bool all_asleep() const {
    for (const std::string& task : tasks())
      if (!is_asleep(task)) return false;
    return true;
  }

 public:
  /// By the folder of a thread below /proc.
  static bool is_asleep(const std::string& task) {
    std::string line;
    std::getline(std::ifstream(task + "/stat"), line);
    const std::size_t end = line.rfind(')');
    return end != std::string::npos && line.substr(end + 2, 1) == "S";
  }

 private:
  ChildProcess child_;
};

}  // namespace o80
