// Random scripts: whatever a robot is asked, and whatever it reads, its promises hold in every
// iteration. CONTRIBUTING.md says how to play more of them.
#include <gtest/gtest.h>

#include <array>
#include <cstdlib>
#include <limits>
#include <map>
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
      1005831};  // a member that had waited went on with the motion from before its wait
  for (const std::uint64_t seed : kSeeds) {
    const Script script = random_script(seed);
    const auto failure = play(script);
    if (failure) ADD_FAILURE() << "seed " << seed << ", " << report(script, *failure);
  }
}

/// One actuator within limits of speed, acceleration and jerk, and when it is commanded.
struct PlannedMotions {
  std::vector<std::array<double, 3>> rates;
  struct Command {
    Iteration at;
    RecordHead head;
    std::vector<double> target;
  };
  std::vector<Command> commands;

  Script script() const {
    Script script;
    auto& numbers = script.actuators.emplace_back().numbers;
    for (const auto& [speed, acceleration, jerk] : rates) {
      numbers.emplace_back().limits = {.speed = speed, .acceleration = acceleration, .jerk = jerk};
    }
    Iteration next = 1;
    const auto add = [&](Action action) -> ScriptStep& {
      script.steps.emplace_back().action = action;
      return script.steps.back();
    };
    for (const Command& command : commands) {
      add(Action::run).count = command.at - std::exchange(next, command.at);
      ScriptStep& step = add(Action::command);
      step.head = command.head;
      step.values = command.target;
      add(Action::pulse);
    }
    add(Action::settle);
    return script;
  }
};

// found among many millions
TEST(Script, OfPlannedMotionsKeepsThePromisesItBroke) {
  constexpr double kNone = std::numeric_limits<double>::infinity();
  const RecordHead fastest = paced(Pace::fastest, 0);
  const PlannedMotions all[] = {
      {// a smooth motion that waits is longer than it proposed
       {{10.784056006283391, 1960.2497575799987, kNone},
        {15.6023539831279, 2366.2537958306866, 2675262.4812128879},
        {50.552476925372581, 5664.5644647638155, kNone}},
       {
           {1,
            overwriting(until(112)),
            {0.028353868843783339, -0.0019355163568690954, -0.50488292323075568}},
           {56,
            smoothly(direct()),
            {-0.018106191681567518, 0.080229592196452038, -0.089792749381096257}},
           {67,
            overwriting(direct()),
            {0.26811152105645053, 0.036255784666623651, -0.00056749143688849049}},
           {97,
            paced(Pace::direct, 26000000),
            {-0.0069565981036566549, 0.082831905176821263, 0.45845236485328944}},
           {135,
            overwriting(smoothly(at_speed(2.1682601588028603))),
            {-0.01356849975671439, -0.32149732859814451, -0.78045541564760157}},
       }},
      {// speeds just above its cruising speed lead to almost the same place
       {{93.037650359279098, 12157.93043307472, kNone}},
       {
           {1, fastest, {4.797035938608051}},
           {61, overwriting(over(266)), {-0.017503031628065761}},
           {198, overwriting(fastest), {2.3046609629018251}},
           {201, overwriting(smoothly(over(126))), {2.3046609629018251}},
       }},
      {// it needs an iteration more to get to that speed
       {{11.43274845604925, 894.76297593409231, kNone},
        {31.336973028471022, 1053.7761246337577, 933796.68721175299},
        {9.9087038305429438, 3928.5954270252028, 1188508.9379981598}},
       {
           {1, smoothly(direct()), {0.042412536898759789, -0.49187007313364239, 0}},
           {46,
            overwriting(smoothly(direct())),
            {0.0092738268208743223, 0.18684603144127931, 0.00055665536383796527}},
           {97,
            smoothly(over(221)),
            {0.009310702360843609, 0.062237306242674359, 0.00083973476658283711}},
           {207,
            overwriting(at_speed(4.3510159262401853)),
            {-0.011169792426061968, 0.5200890939122591, -0.44123512817299343}},
       }},
      {// the same, to a lower speed
       {{12.293948107652097, 2230.2635983827986, 586737.95519783429},
        {3.5968741518713712, 997.54560289787207, 218923.93971848977},
        {54.516033656318662, 49290.432808096259, kNone}},
       {
           {1,
            overwriting(smoothly(until(286))),
            {0.013832444157506497, 0.17012068870274477, -0.98344638904963455}},
           {86,
            overwriting(over(103)),
            {0.0093113952562822073, 0.030022686472107027, -0.028623525483104074}},
           {108,
            overwriting(smoothly(at_speed(14.315428021725872))),
            {-4.0664968067069367e-07, 0.00076174941729415316, -0.0016390525456867122}},
           {125,
            overwriting(smoothly(until(195))),
            {0.055750313059936066, -8.8478027108189082e-06, 1.7643933235569937}},
       }},
      {// stretched by one iteration, it would end before its target
       {{12.051086768181655, 6047.6510841008694, 1959210.0267242901},
        {33.031060638526675, 13974.889676894791, 23787533.076953299}},
       {
           {1, fastest, {-0.1785808099989418, 0.02141616677031977}},
           {22, fastest, {-0.0014174751120996964, 0.090848313246476353}},
           {38,
            overwriting(smoothly(at_speed(2.7677636590625019))),
            {0.0078911298338483066, -0.0082503754762126933}},
           {45,
            smoothly(at_speed(7.2645971225958483)),
            {0.013020420013415811, 0.089606414002495374}},
           {52, overwriting(smoothly(over(96))), {0.013020420013415811, 0.089606414002495374}},
       }},
  };
  for (const PlannedMotions& motions : all) {
    const Script script = motions.script();
    const auto failure = play(script);
    if (failure) ADD_FAILURE() << report(script, *failure);
  }
}

}  // namespace
}  // namespace o80::test
