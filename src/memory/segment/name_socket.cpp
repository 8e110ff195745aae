#include "memory/segment/name_socket.hpp"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstddef>
#include <fstream>
#include <optional>
#include <span>
#include <utility>

#include "base/sha256.hpp"
#include "memory/segment/segment_name.hpp"

namespace o80 {

namespace {

constexpr int kBacklog = 1024;  // connections are made only to find a holder
constexpr int kDrained = 64;    // at most, in one call
constexpr std::string_view kScheme = "o80:";

/// "o80:<user>:<hash of the directory>:", which begins the names of this user and directory.
std::string prefix_of(uid_t user) {
  std::string directory = segment_directory();
  while (directory.size() > 1 && directory.back() == '/') directory.pop_back();
  Sha256 hash;
  hash.add(std::as_bytes(std::span(directory)));
  return std::string(kScheme) + std::to_string(user) + ":" + hash.hex().substr(0, 16) + ":";
}

struct Address {
  explicit Address(std::string_view text) {
    at.sun_family = AF_UNIX;
    // a zero in front makes it abstract; a name has at most 64 characters, so all of it fits
    text.copy(at.sun_path + 1, sizeof at.sun_path - 1);
    bytes = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 +
                                   std::min(text.size(), sizeof at.sun_path - 1));
  }
  const sockaddr* pointer() const noexcept { return reinterpret_cast<const sockaddr*>(&at); }

  sockaddr_un at{};
  socklen_t bytes = 0;
};

/// The process that listens at an address, as the kernel noted it; none if nobody listens, or if
/// the kernel does not say who.
std::optional<ucred> listener_at(const Address& address) {
  const int query = socket_for_this_process(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK);
  if (query < 0) return std::nullopt;
  ucred process{};
  socklen_t bytes = sizeof process;
  const bool known = connect(query, address.pointer(), address.bytes) == 0 &&
                     getsockopt(query, SOL_SOCKET, SO_PEERCRED, &process, &bytes) == 0;
  close_in_this_process(query);
  return known && process.pid > 0 ? std::optional(process) : std::nullopt;
}

}  // namespace

NameSocket NameSocket::take(std::string_view name) {
  const Address address(prefix_of(geteuid()).append(name));
  NameSocket made;
  made.descriptor_ = std::make_shared<std::atomic<int>>(
      socket_for_this_process(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK));
  if (made.is_open() && ::bind(*made.descriptor_, address.pointer(), address.bytes) != 0) {
    const int why = errno;
    made.close();
    errno = why;
  }
  return made;
}

int NameSocket::holder_of(std::string_view name) {
  const auto holder = listener_at(Address(prefix_of(geteuid()).append(name)));
  return holder && holder->uid == geteuid() ? holder->pid : 0;
}

std::vector<NameHolder> NameSocket::holders() {
  std::vector<NameHolder> found;
  std::ifstream sockets("/proc/net/unix");
  for (std::string line; std::getline(sockets, line);) {
    const std::size_t at = line.find('@' + std::string(kScheme));
    if (at == std::string::npos) continue;
    const std::string text = line.substr(at + 1);
    uid_t user = 0;
    const char* const number = text.data() + kScheme.size();
    if (std::from_chars(number, text.data() + text.size(), user).ec != std::errc()) continue;
    const std::string prefix = prefix_of(user);
    const std::string name = text.substr(std::min(text.size(), prefix.size()));
    if (!text.starts_with(prefix) || !is_segment_name(name)) continue;
    const auto process = listener_at(Address(text));
    // any user may bind any name: only its own counts
    if (process && process->uid == user) found.push_back({name, process->pid, user});
  }
  const auto of = [](const NameHolder& holder) { return std::pair(holder.name, holder.user); };
  std::ranges::sort(found, {}, of);
  const auto doubles = std::ranges::unique(found, {}, of);
  found.erase(doubles.begin(), doubles.end());
  return found;
}

NameSocket& NameSocket::operator=(NameSocket&& other) noexcept {
  if (this == &other) return *this;
  close();
  descriptor_ = std::move(other.descriptor_);
  guard_ = other.guard_;
  return *this;
}

void NameSocket::show() noexcept {
  if (is_open()) listen(*descriptor_, kBacklog);
}

void NameSocket::drain(int descriptor) noexcept {
  for (int i = 0; i < kDrained && descriptor >= 0; ++i) {
    const int visitor = accept4(descriptor, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
    if (visitor < 0) return;
    ::close(visitor);
  }
}

void NameSocket::close() noexcept {
  if (!is_open()) return;
  // the helper thread drains with fork_mutex(), which closing needs too
  const int descriptor = descriptor_->exchange(-1);
  if (!guard_.forked()) close_in_this_process(descriptor);
}

}  // namespace o80
