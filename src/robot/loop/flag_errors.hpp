#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace o80 {

// Error texts for wrong words of a robot's command line. `flags` and `switches` are without the two
// dashes before them.

/// Text for an unknown or ambiguous flag, or for a switch with a value ("--bursting=0").
std::string refused_flag(std::string_view word, const std::vector<std::string>& flags,
                         const std::vector<std::string>& switches);
/// Text for a word that belongs to no flag; `words` is the whole command line.
std::string refused_word(std::string_view word, std::span<const std::string> words,
                         const std::vector<std::string>& switches);

}  // namespace o80
