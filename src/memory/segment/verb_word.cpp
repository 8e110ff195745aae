#include "memory/segment/verb_word.hpp"

#include <iterator>

namespace o80 {

std::string_view to_text(Verb verb) noexcept {
  constexpr std::string_view kTexts[] = {"none",    "start", "write",  "wait", "read",
                                         "request", "halt",  "resume", "stop"};
  const auto index = static_cast<std::size_t>(verb);
  return index < std::size(kTexts) ? kTexts[index] : "unknown";
}

void note_slow_verb(const SegmentView& view, std::int64_t now) noexcept {
  Counters& counters = view.counters();
  const std::uint64_t verb = counters.verb.load(std::memory_order_relaxed);
  if (verb == counters.slow_verb.load(std::memory_order_relaxed)) return;
  counters.slow_since.store(now, std::memory_order_relaxed);
  counters.slow_verb.store(verb, std::memory_order_release);  // sync slow_verb
}

SlowVerb slow_verb(const SegmentView& view) noexcept {
  const Counters& counters = view.counters();
  const std::uint64_t seen = counters.slow_verb.load(std::memory_order_acquire);  // sync slow_verb
  const std::uint64_t verb = counters.verb.load(std::memory_order_relaxed);
  if ((verb & 0xFF) == 0 || verb != seen) return {};
  return {static_cast<Verb>(verb & 0xFF), counters.slow_since.load(std::memory_order_relaxed)};
}

}  // namespace o80
