#include "runtime/backend/readings.hpp"

#include <algorithm>
#include <cstring>
#include <utility>

#include "describe/number_name.hpp"
#include "o80/describe/describe.hpp"
#include "runtime/journal/recorded_decisions.hpp"

namespace o80 {

namespace {
// a robot that moves at its highest speed may be read to be faster, because of noise
constexpr double kInMotion = 2.0;
constexpr std::string_view kToFollow =
    "halt the robot and resume with --accept-reading (accept_reading in code)";
}  // namespace

Readings::Readings(BackendCore& core, const BackendOptions& options)
    : core_(core),
      watch_(core.schema),
      followed_(core.schema, options.bursting || core.recorded != nullptr
                                 ? ReadingWatch::Of::none
                                 : ReadingWatch::Of::followers),
      judges_first_(!options.bursting && core.recorded == nullptr && !options.accept_reading &&
                    !watch_.empty()),
      judges_fresh_(options.has_loop && core.recorded == nullptr &&
                    core.schema.head.of_the_world >= (options.bursting ? 3 : 1) &&
                    !core.schema.head.is_simulated()),
      last_row_(core.layout.size / 8) {}

void Readings::begin(const std::byte* observed, std::int64_t time) noexcept {
  watch_.begin(observed);
  read_at_ = time;
}

bool Readings::name_not_finite(const std::byte* states, std::string_view what,
                               ShortText<248>& why) const noexcept {
  const std::optional<NotFinite> found = core_.controller.not_finite(states);
  if (!found) return false;
  name_number(core_.schema, found->actuator, found->number, why);
  why.add(" is NaN or infinite in ").add(what);
  return true;
}

bool Readings::can_begin(const std::byte* states, std::string_view what) noexcept {
  ShortText<248> why;
  if (name_not_finite(states, what, why)) core_.note_failure(why.view());
  return why.view().empty();
}

bool Readings::is_misread(const std::byte* observed, std::string_view cure,
                          ShortText<248>& why) const noexcept {
  const auto fault = watch_.find(observed, since_reading());
  if (fault) describe_reading(core_.schema, *fault, cure, why);
  return fault.has_value();
}

bool Readings::judge_first(bool again) noexcept {
  judges_first_ = false;
  const std::byte* observed = core_.row() + core_.layout.observed;
  ShortText<248> why;
  const bool is_good =
      !again || !is_misread(observed, "start with --accept-reading (accept_reading in code)", why);
  if (!is_good) core_.note_failure(why.view());
  begin(observed, core_.time());
  return is_good;
}

bool Readings::judge_against_first() noexcept {
  if (core_.has_begun() && core_.timing.missed) return true;
  if (core_.has_begun()) {
    judges_first_ = false;
  } else {
    begin(core_.row() + core_.layout.observed, core_.time());
  }
  ShortText<248> why;
  if (!is_misread(core_.row() + core_.layout.observed, "begin with accept_reading", why))
    return true;
  core_.note_failure(why.view());
  if (core_.has_begun()) core_.stop.store(true, std::memory_order_relaxed);
  return false;
}

bool Readings::read_again(FreshReading& reading, Judged judged, ShortText<248>& why) noexcept {
  std::byte* const observed = core_.row() + core_.layout.observed;
  auto* const last = reinterpret_cast<std::byte*>(last_row_.data());
  std::copy_n(observed, core_.layout.block, last);
  reading.may_fail = true;
  if (!reads_fresh(reading)) {
    why.add(reading.why.empty() ? "the robot could not be read" : reading.why);
  } else if (!name_not_finite(reading.observed, "the reading of a fresh start", why) &&
             (!reading.has_desired ||
              !name_not_finite(reading.desired, "the desired states of a fresh start", why))) {
    // a homing that gives desired states may move the zero of a sensor
    const bool is_judged =
        judged == Judged::all || (judged == Judged::readings && !reading.has_desired);
    if (!is_judged || !is_misread(reading.observed, kToResume, why)) return true;
  }
  std::copy_n(last, core_.layout.block, observed);
  return false;
}

void Readings::begin_of_halt() noexcept {
  auto* before = reinterpret_cast<std::byte*>(last_row_.data());
  const bool has_before = core_.has_begun() && core_.current > 1 &&
                          unpack<RowHead>(core_.row()).fresh == 0 &&
                          HistoryReader(core_.segment.view()).read(core_.current - 2, before);
  begin((has_before ? before : core_.row()) + core_.layout.observed, core_.time());
  if (has_before) watch_.add(core_.row() + core_.layout.observed, kInMotion * since_reading());
}

void Readings::add() noexcept {
  if (empty() || core_.timing.missed) return;
  const double share = core_.controller.braking() ? kInMotion : 1.0;
  watch_.add(core_.row() + core_.layout.observed, share * since_reading());
  read_at_ = core_.time();
}

void Readings::add_followed(bool fresh) noexcept {
  if (core_.timing.missed && core_.has_begun() && !fresh) return;
  const std::int64_t since = core_.time() - std::exchange(followed_at_, core_.time());
  if (!core_.has_begun() || fresh) return followed_.begin(core_.row() + core_.layout.observed);
  const std::int64_t elapsed = std::max(since, core_.schema.head.period);
  followed_.add(core_.row() + core_.layout.observed,
                kInMotion * static_cast<double>(elapsed) * 1e-9);
}

bool Readings::admitted_by_followers(const StagedBatch& sent) noexcept {
  if (followed_.empty() || !core_.controller.effort(sent.batch).moves) return true;
  const auto fault =
      followed_.find_idle(core_.controller.active_mask(), core_.controller.braking_mask());
  if (!fault) return true;
  ShortText<248> why;
  describe_reading(core_.schema, *fault, kToFollow, why);
  core_.lanes[sent.lane].set_message(core_.pool.batch(sent.batch).id, why.view());
  return core_.reject(sent, Reason::reading);
}

bool Readings::may_begin(std::uint32_t actuator, std::uint32_t lane, CommandId id) noexcept {
  if (core_.recorded != nullptr) {
    if (core_.recorded->interrupt_due(core_.current, true) != actuator) return true;
    core_.recorded->interrupt(core_.current, static_cast<std::uint16_t>(actuator), {});
  } else {
    const auto fault = followed_.find_of(actuator);
    if (!fault) return true;
    ShortText<248> why;
    describe_reading(core_.schema, *fault, kToFollow, why);
    core_.lanes[lane].set_message(id, why.view());
  }
  core_.journal.interrupted(actuator, true);
  return false;
}

double Readings::since_reading() const noexcept {
  return static_cast<double>(std::max(core_.time() - read_at_, core_.schema.head.period)) * 1e-9;
}

}  // namespace o80
