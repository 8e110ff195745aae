#pragma once

#include <string>

namespace o80 {

/// Neither movable nor copyable: a library file that may be loaded into this process.
///
/// A process with privileges that its starter lacks (set-user-ID, file capabilities) would lend
/// them to whatever library it loads: there only files are accepted that root owns and nobody else
/// can write. Throws DriverError.
class TrustedLibrary {
 public:
  explicit TrustedLibrary(const std::string& path);
  TrustedLibrary(const TrustedLibrary&) = delete;
  TrustedLibrary& operator=(const TrustedLibrary&) = delete;
  ~TrustedLibrary();

  /// For dlopen: of the very file that was looked at.
  const std::string& path() const { return path_; }

 private:
  std::string path_;
  int descriptor_ = -1;
};

}  // namespace o80
