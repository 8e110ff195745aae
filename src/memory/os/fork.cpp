#include "memory/os/fork.hpp"

#include <fcntl.h>
#include <pthread.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <mutex>
#include <string>
#include <vector>

#include "base/short_text.hpp"
#include "memory/os/descriptors.hpp"
#include "memory/os/file_lock.hpp"
#include "o80/base/error.hpp"

namespace o80 {

namespace {

std::atomic<std::uint64_t> generation{0};

// never destroyed: objects of static lifetime may close their files at exit
std::vector<int>& lock_files() {
  static auto* files = new std::vector<int>;
  return *files;
}

InheritingMutex& mutex() noexcept {
  // never destroyed, as above; no process can run without it
  static auto* made = new InheritingMutex;  // NOLINT(bugprone-unhandled-exception-at-new)
  return *made;
}

void before_fork() { mutex().lock(); }
void after_fork_in_parent() { mutex().unlock(); }

void after_fork_in_child() {
  // closing the copy keeps the parent's lock; unlocking would release it
  for (const int file : lock_files()) ::close(file);
  lock_files().clear();
  generation.fetch_add(1, std::memory_order_relaxed);
  mutex().unlock_in_child();
}

void watch_forks() noexcept {
  static const bool watching =
      pthread_atfork(before_fork, after_fork_in_parent, after_fork_in_child) == 0;
  static_cast<void>(watching);
}

/// Opens a file, which a forked child closes.
template <class Open>
int noted(Open&& open) {
  const std::lock_guard lock(fork_mutex());
  lock_files().reserve(lock_files().size() + 1);
  const int descriptor = above_standard(open());
  if (descriptor >= 0) lock_files().push_back(descriptor);
  return descriptor;
}

}  // namespace

std::uint64_t process_generation() noexcept { return generation.load(std::memory_order_relaxed); }

InheritingMutex& fork_mutex() noexcept {
  watch_forks();
  return mutex();
}

ForkGuard::ForkGuard() noexcept : generation_(process_generation()) { watch_forks(); }

void ForkGuard::check(std::string_view what) const {
  if (forked())
    throw UsedAfterFork(std::string(what) +
                        " was opened before this process was forked: open it again in this "
                        "process");
}

void end_forked_child(std::string_view robot, std::string_view function) noexcept {
  ShortText<400> text;
  text.add("o80: '").add(robot).add("' forked in ").add(function);
  text.add(", and the child (pid ").add(std::int64_t{getpid()});
  text.add(") returned from it: the child ends here, the robot belongs to its parent. ");
  text.add("End a child before it returns, by _exit (in Python os._exit) or exec\n");
  [[maybe_unused]] const ssize_t said =
      ::write(STDERR_FILENO, text.view().data(), text.view().size());
  _exit(1);
}

int open_for_this_process(const char* path, int flags, mode_t permission) {
  return noted([&] { return ::open(path, flags, permission); });
}

int socket_for_this_process(int domain, int type) {
  return noted([&] { return ::socket(domain, type, 0); });
}

void close_in_this_process(int descriptor) noexcept {
  const std::lock_guard lock(fork_mutex());
  std::erase(lock_files(), descriptor);
  ::close(descriptor);
}

}  // namespace o80
