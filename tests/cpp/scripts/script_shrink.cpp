#include "scripts/script_shrink.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace o80::test {
namespace {

constexpr double kUnlimited = std::numeric_limits<double>::infinity();

class Shrinker {
 public:
  Shrinker(Script script, const std::function<bool(const Script&)>& fails)
      : script_(std::move(script)), fails_(fails) {}

  Script shrink() {
    for (bool smaller = true; smaller;) {
      smaller = drop_steps();
      smaller |= shorten_runs();
      smaller |= drop_rows();
      smaller |= simplify_commands();
      smaller |= drop_limits();
    }
    drop_actuators();
    return script_;
  }

 private:
  /// Keeps the change if the script still fails.
  bool accept(Script changed) {
    if (!fails_(changed)) return false;
    script_ = std::move(changed);
    return true;
  }

  bool drop_steps() {
    bool any = false;
    for (std::size_t chunk = std::max<std::size_t>(1, script_.steps.size() / 2);; chunk /= 2) {
      for (std::size_t at = script_.steps.size(); at > 0;) {
        const std::size_t first = at > chunk ? at - chunk : 0;
        Script changed = script_;
        changed.steps.erase(changed.steps.begin() + static_cast<std::ptrdiff_t>(first),
                            changed.steps.begin() + static_cast<std::ptrdiff_t>(at));
        any |= accept(std::move(changed));
        at = first;
      }
      if (chunk == 1) return any;
    }
  }

  bool shorten_runs() {
    bool any = false;
    for (std::size_t i = 0; i < script_.steps.size(); ++i) {
      if (script_.steps[i].action != Action::run) continue;
      for (std::int64_t less = script_.steps[i].count / 2; less > 0; less /= 2) {
        Script changed = script_;
        changed.steps[i].count -= less;
        any |= accept(std::move(changed));
      }
    }
    return any;
  }

  /// Visits a command and those that are one command with it.
  template <class Visit>
  static void each_of_group(Script& script, std::size_t i, Visit&& visit) {
    const std::uint32_t group = script.steps[i].group;
    if (group == 0) return visit(script.steps[i]);
    for (ScriptStep& step : script.steps) {
      if (step.action == Action::command && step.group == group) visit(step);
    }
  }

  /// The last row of trajectories, one after the other.
  bool drop_rows() {
    bool any = false;
    for (std::size_t i = 0; i < script_.steps.size(); ++i) {
      for (bool dropped = true; dropped;) {
        dropped = false;
        const ScriptStep& step = script_.steps[i];
        if (step.action != Action::command) break;
        const auto numbers_of = [&](const ScriptStep& each) {
          return script_.actuators[each.actuator].numbers.size();
        };
        const std::size_t rows = step.values.size() / numbers_of(step);
        if (rows <= (step.times.empty() ? 1U : 2U)) break;
        Script changed = script_;
        each_of_group(changed, i, [&](ScriptStep& shorter) {
          shorter.values.resize(shorter.values.size() - numbers_of(shorter));
          if (!shorter.times.empty()) shorter.times.pop_back();
        });
        any |= dropped = accept(std::move(changed));
      }
    }
    return any;
  }

  bool simplify_commands() {
    bool any = false;
    const auto try_change = [&](std::size_t i, auto&& change) {
      Script changed = script_;
      change(changed.steps[i]);
      if (changed.text() != script_.text()) any |= accept(std::move(changed));
    };
    const auto try_change_of_all = [&](std::size_t i, auto&& change) {
      Script changed = script_;
      each_of_group(changed, i, change);
      if (changed.text() != script_.text()) any |= accept(std::move(changed));
    };
    for (std::size_t i = 0; i < script_.steps.size(); ++i) {
      if (script_.steps[i].action != Action::command) continue;
      try_change_of_all(i, [](ScriptStep& step) { step.head.profile = Profile::linear; });
      try_change_of_all(i, [](ScriptStep& step) { step.head.start = Start::desired; });
      try_change_of_all(i, [](ScriptStep& step) { step.head.mode = Mode::queue; });
      try_change_of_all(i, [](ScriptStep& step) { step.group = 0; });
      try_change(i, [](ScriptStep& step) { step.mask = 0; });
      for (std::size_t v = 0; v < script_.steps[i].values.size(); ++v) {
        try_change(i, [v](ScriptStep& step) { step.values[v] = 0.0; });
        try_change(i, [v](ScriptStep& step) { step.values[v] = std::round(step.values[v]); });
      }
    }
    return any;
  }

  bool drop_limits() {
    bool any = false;
    for (std::size_t a = 0; a < script_.actuators.size(); ++a) {
      for (std::size_t n = 0; n < script_.actuators[a].numbers.size(); ++n) {
        const auto try_change = [&](auto&& change) {
          Script changed = script_;
          change(changed.actuators[a].numbers[n]);
          if (changed.text() != script_.text()) any |= accept(std::move(changed));
        };
        try_change([](NumberSpec& number) { number.limits.jerk = kUnlimited; });
        try_change([](NumberSpec& number) {
          number.limits.acceleration = number.limits.jerk = kUnlimited;
        });
        try_change([](NumberSpec& number) {
          number.limits.speed = number.limits.acceleration = number.limits.jerk = kUnlimited;
        });
        try_change([](NumberSpec& number) {
          number.limits.minimum = -kUnlimited;
          number.limits.maximum = kUnlimited;
        });
        try_change([](NumberSpec& number) { number.resting = false; });
        try_change([](NumberSpec& number) { number.start = 0.0; });
      }
      Script changed = script_;
      changed.actuators[a].follow = false;
      if (script_.actuators[a].follow) any |= accept(std::move(changed));
    }
    return any;
  }

  /// Actuators that nothing names.
  void drop_actuators() {
    for (std::size_t a = script_.actuators.size(); a-- > 0 && script_.actuators.size() > 1;) {
      Script changed = script_;
      changed.actuators.erase(changed.actuators.begin() + static_cast<std::ptrdiff_t>(a));
      bool named = false;
      for (ScriptStep& step : changed.steps) {
        if (step.action == Action::restart_with) named = true;
        if (step.actuator == kEveryActuator || step.actuator < a) continue;
        const bool has_actuator = step.action == Action::command || step.action == Action::purge ||
                                  step.action == Action::purge_own ||
                                  step.action == Action::interrupt || step.action == Action::read;
        if (has_actuator && step.actuator == a) named = true;
        if (step.actuator > a) --step.actuator;
      }
      if (!named) accept(std::move(changed));
    }
  }

  Script script_;
  const std::function<bool(const Script&)>& fails_;
};

}  // namespace

Script shrunk(Script script, const std::function<bool(const Script&)>& fails) {
  return Shrinker(std::move(script), fails).shrink();
}

}  // namespace o80::test
