// Random scripts: whatever a robot is asked, and whatever it reads, its promises hold in every
// iteration. CONTRIBUTING.md says how to play more of them.
#include <gtest/gtest.h>

#include <cstdlib>
#include <iterator>
#include <map>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "cases.hpp"
#include "scripts/script_generator.hpp"
#include "scripts/script_player.hpp"
#include "scripts/script_shrink.hpp"

namespace o80::test {
namespace {

constexpr std::uint64_t kScriptsOfEachRun = 1000;
constexpr std::uint64_t kPlannedScripts = 8000;
constexpr std::size_t kMaxShown = 6;

std::uint64_t from_environment(const char* name, std::uint64_t otherwise) {
  const char* text = std::getenv(name);
  return text == nullptr ? otherwise : std::stoull(text);
}

void expect_promises_kept(Script (*script_of)(std::uint64_t), std::uint64_t scripts) {
  const std::uint64_t first = from_environment("O80_SCRIPT_SEED", 0);
  // one of each kind is shown whole, the others are counted
  std::map<std::string, std::uint64_t> failures;
  for (std::uint64_t seed = first; seed < first + scripts; ++seed) {
    const Script script = script_of(seed);
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

// rules C3, C18, L2
TEST(Script, KeepsEveryPromise) {
  expect_promises_kept(random_script, from_environment("O80_SCRIPTS", cases(kScriptsOfEachRun)));
}

// rules C5, C13, C14, L3
TEST(Script, OfPlannedMotionsKeepsEveryPromise) {
  expect_promises_kept(planned_script, from_environment("O80_SCRIPTS", cases(kPlannedScripts)));
}

// scripts that once broke a promise
TEST(Script, KeepsThePromisesItBroke) {
  constexpr std::uint64_t kSeeds[] = {
      1074205,   // a motion that had just left a bound was continued at its reference's speed
      1076616,   // a row clamped where rounding left an unsigned kind
      91090800,  // a motion that first went on with the plan before it could not stop in its span
      91058671,  // a set-point equal to that of a group took as long as the group
      1005831};  // a member that had waited went on with the motion from before its wait
  for (const std::uint64_t seed : kSeeds) {
    const Script script = random_script(seed);
    const auto failure = play(script);
    if (failure) ADD_FAILURE() << "seed " << seed << ", " << report(script, *failure);
  }
}

/// Motions of one actuator, found among many millions: a number for each `limits` of speed,
/// acceleration and jerk, and commands behind the iteration in which they are sent.
constexpr auto kPlannedMotions = R"(
# a smooth motion that waits is longer than it proposed
limits 10.784056006283391 1960.2497575799987 inf
limits 15.6023539831279 2366.2537958306866 2675262.4812128879
limits 50.552476925372581 5664.5644647638155 inf
1 overwrite until 112 to 0.028353868843783339 -0.0019355163568690954 -0.50488292323075568
56 smooth direct to -0.018106191681567518 0.080229592196452038 -0.089792749381096257
67 overwrite direct to 0.26811152105645053 0.036255784666623651 -0.00056749143688849049
97 direct every 26000000 to -0.0069565981036566549 0.082831905176821263 0.45845236485328944
135 overwrite smooth speed 2.1682601588028603 \
  to -0.01356849975671439 -0.32149732859814451 -0.78045541564760157
# speeds just above its cruising speed lead to almost the same place
limits 93.037650359279098 12157.93043307472 inf
1 fastest to 4.797035938608051
61 overwrite over 266 to -0.017503031628065761
198 overwrite fastest to 2.3046609629018251
201 overwrite smooth over 126 to 2.3046609629018251
# it needs an iteration more to get to that speed
limits 11.43274845604925 894.76297593409231 inf
limits 31.336973028471022 1053.7761246337577 933796.68721175299
limits 9.9087038305429438 3928.5954270252028 1188508.9379981598
1 smooth direct to 0.042412536898759789 -0.49187007313364239 0
46 overwrite smooth direct to 0.0092738268208743223 0.18684603144127931 0.00055665536383796527
97 smooth over 221 to 0.009310702360843609 0.062237306242674359 0.00083973476658283711
207 overwrite speed 4.3510159262401853 \
  to -0.011169792426061968 0.5200890939122591 -0.44123512817299343
# the same, to a lower speed
limits 12.293948107652097 2230.2635983827986 586737.95519783429
limits 3.5968741518713712 997.54560289787207 218923.93971848977
limits 54.516033656318662 49290.432808096259 inf
1 overwrite smooth until 286 to 0.013832444157506497 0.17012068870274477 -0.98344638904963455
86 overwrite over 103 to 0.0093113952562822073 0.030022686472107027 -0.028623525483104074
108 overwrite smooth speed 14.315428021725872 \
  to -4.0664968067069367e-07 0.00076174941729415316 -0.0016390525456867122
125 overwrite smooth until 195 to 0.055750313059936066 -8.8478027108189082e-06 1.7643933235569937
# stretched by one iteration, it would end before its target
limits 12.051086768181655 6047.6510841008694 1959210.0267242901
limits 33.031060638526675 13974.889676894791 23787533.076953299
1 fastest to -0.1785808099989418 0.02141616677031977
22 fastest to -0.0014174751120996964 0.090848313246476353
38 overwrite smooth speed 2.7677636590625019 to 0.0078911298338483066 -0.0082503754762126933
45 smooth speed 7.2645971225958483 to 0.013020420013415811 0.089606414002495374
52 overwrite smooth over 96 to 0.013020420013415811 0.089606414002495374
)";

ScriptStep command_of(const std::vector<std::string>& words) {
  ScriptStep step;
  step.action = Action::command;
  for (std::size_t i = 1; i < words.size(); ++i) {
    const std::string& word = words[i];
    const auto value = [&] { return std::stod(words.at(++i)); };
    if (word == "overwrite") step.head.mode = Mode::overwrite;
    if (word == "smooth") step.head.profile = Profile::minimum_jerk;
    if (word == "direct") step.head.pace = Pace::direct;
    if (word == "fastest") step.head.pace = Pace::fastest;
    if (word == "until") step.head.pace = Pace::until;
    if (word == "over") step.head.pace = Pace::iterations;
    if (word == "speed") step.head.pace = Pace::speed;
    if (word == "speed") step.head.speed = value();
    if (word == "until" || word == "over" || word == "every") {
      step.head.amount = static_cast<std::int64_t>(value());
    }
    while (word == "to" && i + 1 < words.size()) step.values.push_back(value());
  }
  return step;
}

std::vector<Script> planned_motions() {
  std::vector<Script> scripts;
  Iteration next = 1;
  std::istringstream lines(kPlannedMotions);
  for (std::string line; std::getline(lines, line);) {
    for (std::string rest; line.ends_with('\\') && std::getline(lines, rest);) {
      line = line.substr(0, line.size() - 1) + rest;
    }
    std::istringstream in(line);
    const std::vector<std::string> words{std::istream_iterator<std::string>(in), {}};
    if (words.empty()) continue;
    if (words[0] == "#") {
      scripts.emplace_back().actuators.emplace_back();
      next = 1;
    } else if (words[0] == "limits") {
      scripts.back().actuators[0].numbers.emplace_back().limits = {
          .speed = std::stod(words[1]),
          .acceleration = std::stod(words[2]),
          .jerk = std::stod(words[3])};
    } else {
      std::vector<ScriptStep>& steps = scripts.back().steps;
      const Iteration at = std::stoll(words[0]);
      steps.emplace_back().count = at - std::exchange(next, at);
      steps.push_back(command_of(words));
      steps.emplace_back().action = Action::pulse;
    }
  }
  for (Script& script : scripts) script.steps.emplace_back().action = Action::settle;
  return scripts;
}

TEST(Script, OfPlannedMotionsKeepsThePromisesItBroke) {
  for (const Script& script : planned_motions()) {
    const auto failure = play(script);
    if (failure) ADD_FAILURE() << report(script, *failure);
  }
}

}  // namespace
}  // namespace o80::test
