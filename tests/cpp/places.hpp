#pragma once

#include <filesystem>
#include <string>

namespace o80::test {

/// Where what a test starts and loads lies, from bin/o80_test_<folder> of the same build: no path
/// is compiled in, so that presets share what they compile alike.
inline const std::string kPrefix =
    std::filesystem::read_symlink("/proc/self/exe").parent_path().parent_path();

}  // namespace o80::test
