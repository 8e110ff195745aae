// The controller beside a second implementation of the rules, on random scripts, bit for bit.
#include "scripts/linear_reference.hpp"

#include <gtest/gtest.h>

#include <cstdlib>
#include <string>

#include "scripts/script_generator.hpp"
#include "scripts/script_shrink.hpp"
#include "scripts/script_world.hpp"

namespace o80::test {
namespace {

constexpr std::int64_t kIterationsOfEachRun = 120'000;

/// The script with smooth motion; no pace of it depends on the way.
Script smooth(Script script) {
  for (ScriptStep& step : script.steps) {
    if (step.head.pace == Pace::speed) {
      step.head.pace = Pace::iterations;
      step.head.amount = 9;
    }
    step.head.profile = Profile::minimum_jerk;
  }
  return script;
}

/// Both play a script side by side; says where they differ first, or nothing. Of smooth motion
/// only what is told of the commands is compared.
class Comparison {
 public:
  explicit Comparison(const Script& script) : script_(script), world_(script), reference_(script) {
    for (const ScriptStep& step : script.steps) {
      is_linear_ = is_linear_ && step.head.profile == Profile::linear;
    }
  }

  std::string run() {
    for (std::size_t i = 0; i < script_.steps.size(); ++i) {
      const ScriptStep& step = script_.steps[i];
      if (step.action == Action::run) {
        for (std::int64_t n = 0; n < step.count; ++n) {
          if (std::string found = iterate(); !found.empty()) return found;
        }
      } else {
        reference_.act(step, i);
        world_.act(step, i);
      }
    }
    for (int n = 0; n < 3; ++n) {
      if (std::string found = iterate(); !found.empty()) return found;
    }
    return statuses();
  }
  std::int64_t iterations() const { return reference_.iteration(); }

 private:
  std::string iterate() {
    if (const auto failure = world_.step()) return failure->text;
    reference_.step();
    if (reference_.is_too_long() || !is_linear_) return {};
    for (std::size_t a = 0; a < world_.actuators.size(); ++a) {
      for (std::size_t n = 0; n < world_.actuators[a].numbers.size(); ++n) {
        const long double desired = world_.actuators[a].numbers[n].now;
        const long double expected = reference_.desired()[a][n];
        if (desired == expected) continue;
        return world_.where(a, n) + std::to_string(desired) + ", not " + std::to_string(expected);
      }
    }
    return {};
  }

  std::string statuses() const {
    if (reference_.is_too_long()) return {};
    for (const SentCommand* command : world_.sent) {
      const CommandEnd& expected = reference_.outcomes().at(command->step);
      const CommandEnd& found = command->told;
      if (found == expected) continue;
      return "the command of step " + std::to_string(command->step) + " is " +
             std::string(to_text(found.status)) + " at " + std::to_string(found.iteration) +
             ", not " + std::string(to_text(expected.status)) + " at " +
             std::to_string(expected.iteration);
    }
    return {};
  }

  const Script& script_;
  ScriptWorld world_;
  LinearReference reference_;
  bool is_linear_ = true;
};

// rules C1, C12, C20
TEST(LinearReference, AgreesWithTheControllerBitForBit) {
  const char* wanted = std::getenv("O80_REFERENCE_ITERATIONS");
  const std::int64_t most = wanted == nullptr ? kIterationsOfEachRun : std::stoll(wanted);
  std::int64_t played = 0;
  for (std::uint64_t seed = 0; played < most; ++seed) {
    const Script linear = linear_script(seed / 2);
    const Script script = seed % 2 == 0 ? linear : smooth(linear);
    Comparison comparison(script);
    const bool differs = !comparison.run().empty();
    played += comparison.iterations();
    if (!differs) continue;
    const Script shortest =
        shrunk(script, [](const Script& shorter) { return !Comparison(shorter).run().empty(); });
    FAIL() << "seed " << seed << ", " << Comparison(shortest).run() << '\n' << shortest.text();
  }
}

}  // namespace
}  // namespace o80::test
