#include "memory/segment/halt_word.hpp"

#include <algorithm>

#include "base/crash_point.hpp"
#include "base/printable.hpp"
#include "memory/os/atomic_words.hpp"
#include "memory/segment/signal.hpp"

namespace o80 {

namespace {

constexpr int kReasonReadings = 1000;  // retries while the slot is being written

void write_halt(HaltSlot& slot, std::uint64_t number, HaltCause cause, Iteration iteration,
                std::string_view who, std::string_view text) noexcept {
  slot.number.store(0, std::memory_order_relaxed);
  O80_CRASH_POINT("halt.before_reason");
  slot.cause.store(static_cast<std::uint32_t>(cause),
                   std::memory_order_release);                 // sync halt_words
  slot.iteration.store(iteration, std::memory_order_release);  // sync halt_words
  store_text(slot.who, std::size(slot.who), who);
  store_text(slot.text, std::size(slot.text), text);
  O80_CRASH_POINT("halt.before_number");
  slot.number.store(number, std::memory_order_release);  // sync halt_number
}

/// False if the slot belongs to another halt, or is being written.
bool read_halt(const HaltSlot& slot, std::uint64_t number, Halt& halt) noexcept {
  if (slot.number.load(std::memory_order_acquire) != number) return false;     // sync halt_number
  const std::uint32_t cause = slot.cause.load(std::memory_order_acquire);      // sync halt_words
  const Iteration iteration = slot.iteration.load(std::memory_order_acquire);  // sync halt_words
  Halt whole;
  load_text(slot.who, std::size(slot.who), whole.who.data());
  load_text(slot.text, std::size(slot.text), whole.text.data());
  if (slot.number.load(std::memory_order_relaxed) != number) return false;
  whole.number = number;
  whole.cause = static_cast<HaltCause>(cause);
  whole.iteration = iteration;
  halt = whole;
  return true;
}

}  // namespace

std::string_view to_text(HaltCause cause) noexcept {
  constexpr std::string_view kTexts[] = {"none",     "frontend",      "driver",
                                         "silence",  "dead_frontend", "error",
                                         "overruns", "predecessor",   "unreachable"};
  const auto index = static_cast<std::size_t>(cause);
  return index < std::size(kTexts) ? kTexts[index] : "unknown";
}

std::string halt_text(const Halt& halt) {
  std::string text = "iteration " + std::to_string(halt.iteration) + " (halt " +
                     std::to_string(halt.number) + ", cause " + std::string(to_text(halt.cause));
  if (!halt.who_text().empty()) text += ", requested by " + printable(halt.who_text());
  return text + ")" + (halt.reason().empty() ? "" : ": " + printable(halt.reason()));
}

std::uint64_t request_halt(const SegmentView& view, HaltCause cause, std::string_view who,
                           std::string_view text) noexcept {
  Bell& bell = view.bell();
  O80_CRASH_POINT("halt.before_count");
  const std::uint64_t number =
      bell.halts.fetch_add(1, std::memory_order_seq_cst) + 1;  // sync halts
  O80_CRASH_POINT("halt.after_count");
  ring_bell(view);
  write_halt(bell.reasons[number % kHaltsKept], number, cause, -1, who, text);
  // again: the backend may have read the slot before this reason and sleep since
  ring_bell(view);
  return number;
}

void put_halt(const SegmentView& view, std::uint64_t number, HaltCause cause, std::string_view who,
              std::string_view text) noexcept {
  Bell& bell = view.bell();
  write_halt(bell.reasons[number % kHaltsKept], number, cause, -1, who, text);
  bell.halts.store(number, std::memory_order_seq_cst);  // sync halts
}

HaltLatch::HaltLatch(const SegmentView& view) noexcept : view_(view) {}

void HaltLatch::latch(std::uint64_t requested) noexcept {
  seen_ = requested;
  halt_ = Halt{};
  halt_.number = std::max<std::uint64_t>(requested, 1);
}

bool HaltLatch::show(Iteration iteration) noexcept {
  const bool known =
      read_halt(view_.bell().reasons[halt_.number % kHaltsKept], halt_.number, halt_);
  halt_.iteration = iteration;
  Counters& counters = view_.counters();
  write_halt(counters.halt, halt_.number, halt_.cause, iteration, halt_.who_text(), halt_.reason());
  counters.halted.store(halt_.number, std::memory_order_release);  // sync halted
  return known;
}

bool HaltLatch::clear() noexcept {
  if (view_.bell().halts.load(std::memory_order_seq_cst) != seen_) return false;  // sync halts
  halt_ = Halt{};
  view_.counters().cleared.store(seen_, std::memory_order_release);  // sync cleared
  view_.counters().halted.store(0, std::memory_order_release);       // sync halted
  return true;
}

std::optional<Halt> shown_halt(const SegmentView& view) noexcept {
  const Counters& counters = view.counters();
  Halt halt;
  for (int i = 0; i < kReasonReadings; ++i) {
    const std::uint64_t number = counters.halted.load(std::memory_order_acquire);  // sync halted
    if (number == 0) return std::nullopt;
    if (read_halt(counters.halt, number, halt)) return halt;
    halt.number = number;
  }
  // the backend died while it wrote the slot: the number alone is valid
  return halt;
}

std::optional<Halt> requested_halt(const SegmentView& view) noexcept {
  const std::uint64_t requested = view.bell().halts.load(std::memory_order_seq_cst);  // sync halts
  const std::optional<Halt> shown = shown_halt(view);
  const bool is_shown = shown && shown->number == requested;
  if (is_shown && shown->cause != HaltCause::none) return shown;
  if (!is_shown && requested == view.counters().cleared.load(std::memory_order_acquire))
    return shown;  // sync cleared
  Halt halt;
  halt.number = std::max<std::uint64_t>(requested, 1);
  // its requester may just be writing the reason, or was killed before
  for (int i = 0; i < kReasonReadings; ++i) {
    if (read_halt(view.bell().reasons[halt.number % kHaltsKept], halt.number, halt)) break;
  }
  if (is_shown) halt.iteration = shown->iteration;
  return halt;
}

}  // namespace o80
