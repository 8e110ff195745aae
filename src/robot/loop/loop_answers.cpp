// What a loop does beside its iterations: requests and halts of the robot, and what its faults say.
#include <algorithm>
#include <cstring>

#include "base/short_text.hpp"
#include "memory/segment/verb_word.hpp"
#include "robot/loop/loop.hpp"

namespace o80 {

void Loop::note_requests(const ReadingView& view) noexcept {
  for (std::uint32_t i = 0; i < reports_.size(); ++i) {
    const RequestReport& report = view.requests[i];
    if (report.changed == 0) continue;
    const Served how = DriverInstance::served(report);
    backend_.end_request(i, how);
    if (how.kind == Served::Kind::failed) {
      failed(backend_.schema().requests[i].name.chars.data(), how.why());
    }
  }
}

/// Ticks were so fast that speed limits, which count iterations, no longer hold: halts, and sleeps
/// so that the robot brakes within its limits.
void Loop::hold_back() noexcept {
  if (backend_.halted().number == 0) {
    const double period = static_cast<double>(backend_.schema().head.period) * 1e-6;
    const Pacer::FastTicks& fast = pacer_.fast_ticks();
    ShortText<248> text;
    text.add(fast.ticks).add(" ticks of the robot came in ");
    text.add(static_cast<double>(fast.time) * 1e-6).add(" ms, at a period of ").add(period);
    text.add(
        " ms: its clock or the link has jitter, --frequency is not its rate, or wait() returns "
        "too early");
    backend_.halt(HaltCause::overruns, text.view());
  }
  const std::int64_t before = monotonic_now();
  sleep_until(before + std::min(pacer_.excess(), kLongestBraking));
  pacer_.slept(monotonic_now() - before);
}

bool Loop::failed(const char* verb) noexcept { return failed(verb, robot_->fault()); }

bool Loop::failed(const char* verb, std::string_view why) noexcept {
  fault_ = "'";
  fault_ += robot_->table().name;
  fault_ += "' failed in ";
  fault_ += verb;
  fault_ += ": ";
  fault_ += why;
  return false;
}

Served Loop::serve(std::uint32_t request, std::span<const std::byte> payload) noexcept {
  const Served served =
      calls(Verb::request, [&] { return robot_->request(request, payload.data()); });
  if (served.kind == Served::Kind::failed) {
    failed(backend_.schema().requests[request].name.chars.data());
  }
  return served;
}

bool Loop::restore(std::uint32_t slot) noexcept {
  for (std::uint32_t i = 0; i < backend_.schema().requests.size(); ++i) {
    if (backend_.schema().requests[i].name.view() != "restore") continue;
    const Served served = serve(i, std::as_bytes(std::span(&slot, 1)));
    return served.kind == Served::Kind::start_afresh;
  }
  return false;
}

KeptState Loop::kept_state(std::uint32_t request, std::span<const std::byte> payload) noexcept {
  if (request != snapshot_ || payload.size() < sizeof(std::uint32_t)) return {};
  KeptState kept;
  std::memcpy(&kept.slot, payload.data(), sizeof kept.slot);
  kept.bytes = robot_->snapshot_bytes(kept.slot);
  return kept;
}

bool Loop::read_fresh(FreshReading& reading) noexcept {
  view_.observed = reading.observed;
  view_.extended = reading.extended;
  view_.desired = reading.desired;
  const bool reads = read_into_view();
  std::ranges::fill(interrupted_, 0);  // there is nothing to interrupt
  reading.has_desired = view_.has_desired != 0;
  reading.follows = view_.follows != 0;
  if (!reads && reading.may_fail) {
    unread_ = fault_;
    fault_.clear();
    reading.why = unread_;
  }
  return reads;
}

void Loop::note_halt(const ReadingView& view) noexcept {
  const std::size_t size = strnlen(view.halt_text.text, sizeof view.halt_text.text);
  backend_.halt(HaltCause::driver, {view.halt_text.text, size});
}

bool Loop::halt() noexcept {
  return calls(Verb::halt, [&] { return robot_->halt(); }) || failed("halt");
}

Served Loop::resume() noexcept {
  const Served served = calls(Verb::resume, [&] { return robot_->resume(); });
  if (served.kind == Served::Kind::failed) failed("resume");
  return served;
}

}  // namespace o80
