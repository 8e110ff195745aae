#pragma once

#include <string>

namespace o80 {

/// A library file that may be loaded into this process. Neither movable nor copyable.
///
/// In a process with privileges that its user lacks (set-user-ID, file capabilities), only files
/// that root owns and only root can write are accepted: code of the library would get these
/// privileges. Throws DriverError.
class TrustedLibrary {
 public:
  explicit TrustedLibrary(const std::string& path);
  TrustedLibrary& operator=(TrustedLibrary&&) = delete;
  ~TrustedLibrary();

  /// Path for dlopen: it leads to the same file that was checked.
  const std::string& path() const { return path_; }

 private:
  std::string path_;
  int descriptor_ = -1;
};

}  // namespace o80
