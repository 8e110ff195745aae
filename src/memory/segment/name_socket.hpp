#pragma once

#include <sys/types.h>

#include <atomic>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "memory/os/fork.hpp"

namespace o80 {

/// The process that holds the name of a segment by its socket.
struct NameHolder {
  std::string name;
  int pid = 0;
  uid_t user = 0;
  friend bool operator==(const NameHolder&, const NameHolder&) = default;
};

/// Move-only: an abstract Unix socket named after user, directory and name of a segment.
///
/// Files can be removed under a living backend. The socket cannot: while its process lives, a
/// second start of that name is refused, and `o80 list` and `o80 stop` find the process. It is an
/// additional guard: the locks of the files decide (NamedSegment), and where sockets are not
/// granted (a container, a name that another user has bound) the backend runs without.
class NameSocket {
 public:
  NameSocket() noexcept = default;
  /// Binds the socket of that name; on failure the result is not open and errno is set.
  static NameSocket take(std::string_view name);
  /// The process of this user that holds the name and has shown it; 0 if there is none.
  static int holder_of(std::string_view name);
  /// All that have shown themselves in this directory, sorted by name.
  static std::vector<NameHolder> holders();

  NameSocket(NameSocket&&) noexcept = default;
  NameSocket& operator=(NameSocket&& other) noexcept;
  ~NameSocket() { close(); }

  bool is_open() const noexcept { return descriptor_ && *descriptor_ >= 0; }
  /// Shows this process to holders() and holder_of(): call it when the files have their names.
  void show() noexcept;
  /// What is open as long as the socket is, for drain().
  std::shared_ptr<const std::atomic<int>> descriptor() const noexcept { return descriptor_; }
  /// Closes the connections of processes that wanted to know the holder. Needs fork_mutex().
  static void drain(int descriptor) noexcept;
  void close() noexcept;

 private:
  std::shared_ptr<std::atomic<int>> descriptor_;  // -1: closed
  ForkGuard guard_;
};

}  // namespace o80
