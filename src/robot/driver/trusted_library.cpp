#include "robot/driver/trusted_library.hpp"

#include <fcntl.h>
#include <sys/auxv.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "o80/base/error.hpp"
#include "robot/driver/machine_limits.hpp"

namespace o80 {

TrustedLibrary::TrustedLibrary(const std::string& path) : path_(path) {
  if (getauxval(AT_SECURE) == 0) return;
  descriptor_ = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  struct stat file{};
  if (descriptor_ < 0 || fstat(descriptor_, &file) != 0)
    throw DriverError("the robot library '" + path + "' cannot be opened: " + std::strerror(errno));
  if (file.st_uid != 0 || (file.st_mode & (S_IWGRP | S_IWOTH)) != 0) {
    ::close(descriptor_);
    throw DriverError("the robot library '" + path +
                      "' is not loaded: this program has privileges of its own (set-user-ID or "
                      "`setcap`), and users other than root can write the library. Remove the "
                      "privileges (`chmod u-s`, `setcap -r`) and allow real-time priorities by `" +
                      kPriorityLimit.for_good + "`");
  }
  path_ = "/proc/self/fd/" + std::to_string(descriptor_);
}

TrustedLibrary::~TrustedLibrary() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

}  // namespace o80
