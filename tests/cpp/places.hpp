#pragma once

#include <filesystem>
#include <string>

namespace o80::test {

/// The prefix of this build: tests start programs and load robots below it. It is found from
/// /proc/self/exe, because presets share compiled objects.
inline const std::string kPrefix =
    std::filesystem::read_symlink("/proc/self/exe").parent_path().parent_path();

}  // namespace o80::test
