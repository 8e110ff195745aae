#include "memory/os/file_owner.hpp"

#include <pwd.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <string_view>
#include <vector>

namespace o80 {

std::string user_name(uid_t user) {
  std::vector<char> buffer(16384);
  passwd entry{};
  passwd* found = nullptr;
  if (getpwuid_r(user, &entry, buffer.data(), buffer.size(), &found) == 0 && found != nullptr)
    return found->pw_name;
  return std::to_string(user);
}

namespace {

bool is_named_in_the_environment(uid_t user) {
  const char* trusted = secure_getenv("O80_TRUST");
  std::string_view left = trusted == nullptr ? "" : trusted;
  if (left.empty()) return false;
  const std::string name = user_name(user);
  const std::string number = std::to_string(user);
  while (!left.empty()) {
    const std::string_view one = left.substr(0, left.find(','));
    if (one == name || one == number) return true;
    left.remove_prefix(std::min(left.size(), one.size() + 1));
  }
  return false;
}

bool is_member(gid_t group) {
  if (group == getegid()) return true;
  const int count = getgroups(0, nullptr);
  std::vector<gid_t> groups(static_cast<std::size_t>(std::max(count, 0)));
  if (getgroups(count, groups.data()) != count) return false;
  return std::find(groups.begin(), groups.end(), group) != groups.end();
}

}  // namespace

std::string why_untrusted(int descriptor) {
  struct stat file;
  if (fstat(descriptor, &file) != 0)
    return std::string("its owner cannot be read: ") + std::strerror(errno);
  if (file.st_uid == geteuid() || file.st_uid == 0) return {};
  if ((file.st_mode & S_IRGRP) != 0 && is_member(file.st_gid)) return {};
  if (is_named_in_the_environment(file.st_uid)) return {};
  const std::string owner = user_name(file.st_uid);
  return "it belongs to user " + owner + ", whom this user does not trust. If " + owner +
         " is meant to run it, set O80_TRUST=" + owner;
}

std::string owner_of(const std::string& path) {
  struct stat file;
  return lstat(path.c_str(), &file) == 0 ? user_name(file.st_uid) : "unknown";
}

}  // namespace o80
