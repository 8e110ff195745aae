#include "scripts/script_shrink.hpp"

#include <algorithm>
#include <utility>

namespace o80::test {
namespace {

class Shrinker {
 public:
  Shrinker(Script script, const std::function<bool(const Script&)>& fails)
      : script_(std::move(script)), fails_(fails) {}

  Script shrink() {
    for (bool smaller = true; smaller;) {
      smaller = drop_steps();
      smaller |= shorten_runs();
    }
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

  Script script_;
  const std::function<bool(const Script&)>& fails_;
};

}  // namespace

Script shrunk(Script script, const std::function<bool(const Script&)>& fails) {
  return Shrinker(std::move(script), fails).shrink();
}

}  // namespace o80::test
