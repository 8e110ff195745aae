// Random scripts: whatever a robot is asked, and whatever it reads, its promises hold in every
// iteration. CONTRIBUTING.md says how to play more of them.
#include <gtest/gtest.h>

#include <cstdlib>
#include <map>
#include <string>

#include "scripts/script_generator.hpp"
#include "scripts/script_player.hpp"
#include "scripts/script_shrink.hpp"

namespace o80::test {
namespace {

constexpr std::uint64_t kScriptsOfEachRun = 1000;
constexpr std::size_t kMaxShown = 6;

std::uint64_t from_environment(const char* name, std::uint64_t otherwise) {
  const char* text = std::getenv(name);
  return text == nullptr ? otherwise : std::stoull(text);
}

TEST(Script, KeepsEveryPromise) {
  const std::uint64_t scripts = from_environment("O80_SCRIPTS", kScriptsOfEachRun);
  const std::uint64_t first = from_environment("O80_SCRIPT_SEED", 0);
  // one of each kind is shown whole, the others are counted
  std::map<std::string, std::uint64_t> failures;
  for (std::uint64_t seed = first; seed < first + scripts; ++seed) {
    const Script script = random_script(seed);
    const auto failure = play(script);
    if (!failure) continue;
    if (failures[failure->property]++ > 0 || failures.size() > kMaxShown) continue;
    const Script shortest = shrunk(script, [&](const Script& shorter) {
      const auto found = play(shorter);
      return found && found->property == failure->property;
    });
    ADD_FAILURE() << "seed " << seed << ", " << report(shortest, *play(shortest));
  }
  for (const auto& [property, count] : failures) {
    ADD_FAILURE() << count << " of " << scripts << " scripts break '" << property << "'";
  }
}

// scripts that once broke a promise
TEST(Script, KeepsThePromisesItBroke) {
  constexpr std::uint64_t kSeeds[] = {
      1074205,   // a motion that had just left a bound was continued at its reference's speed
      1076616,   // a row clamped where rounding left an unsigned kind
      1005831};  // a member that had waited went on with the motion from before its wait
  for (const std::uint64_t seed : kSeeds) {
    const Script script = random_script(seed);
    const auto failure = play(script);
    if (failure) ADD_FAILURE() << "seed " << seed << ", " << report(script, *failure);
  }
}

}  // namespace
}  // namespace o80::test
