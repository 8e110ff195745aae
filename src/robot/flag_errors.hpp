#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace o80 {

// What `o80 run ROBOT ...` says of words it cannot read; `flags` and `switches` without dashes.

/// A flag that is unknown or ambiguous, or a switch that was given a value ("--bursting=0").
std::string refused_flag(std::string_view word, const std::vector<std::string>& flags,
                         const std::vector<std::string>& switches);
/// A word that belongs to no flag; `words` is the whole command line.
std::string refused_word(std::string_view word, std::span<const std::string> words,
                         const std::vector<std::string>& switches);

}  // namespace o80
