#include "robot/loop/loop.hpp"

#include <algorithm>
#include <bit>

#include "base/short_text.hpp"
#include "memory/segment/signal.hpp"
#include "memory/segment/verb_word.hpp"
#include "o80/base/error.hpp"
#include "o80/base/time.hpp"
#include "o80/robot/plant_requests.hpp"
#include "robot/loop/robot_provenance.hpp"

namespace o80 {

namespace {
constexpr std::int64_t kLongestBraking = 1'000'000'000;  // [ns]

/// Index of the request `snapshot` whose first field is the slot; the number of requests if there
/// is none.
std::uint32_t snapshot_of(const Schema& schema) {
  const auto found = std::ranges::find_if(schema.requests, [&](const RequestRow& request) {
    const TypeRow& type = schema.types[request.type];
    return request.name.view() == "snapshot" && type.size == sizeof(Snapshot);
  });
  return static_cast<std::uint32_t>(found - schema.requests.begin());
}

BackendOptions with_provenance(BackendOptions options, const DriverInstance& robot) {
  Provenance provenance = provenance_of(robot.table(), robot.options());
  provenance.run_options = std::move(options.provenance.run_options);
  options.provenance = std::move(provenance);
  return options;
}
}  // namespace

Loop::Loop(std::unique_ptr<DriverInstance> robot, const BackendOptions& options,
           RecordedDecisions* recorded)
    : robot_(std::move(robot)),
      backend_(robot_->describe(options.period), with_provenance(options, *robot_), this, recorded),
      pacer_(backend_.schema().head.period),
      paced_(!options.bursting && recorded == nullptr),
      accepts_reading_(options.accept_reading),
      interrupted_(backend_.layout().mask_words + 1),
      reports_(backend_.schema().requests.size()),
      snapshot_(snapshot_of(backend_.schema())) {
  fault_.reserve(1024);
  view_.interrupted = interrupted_.data();
  view_.requests = reports_.data();
}

Loop::~Loop() {
  if (!guard_.forked()) {
    static_cast<void>(stop());
  } else {
    // in a forked child the robot and its hardware belong to the parent
    [[maybe_unused]] DriverInstance* of_the_parent = robot_.release();
  }
}

void Loop::start() {
  const bool started = calls(Verb::start, [&] { return robot_->start(); });
  if (!started) failed("start");
  if (!started || !read_first() || !begin()) {
    const std::string why = fault_;
    stop();
    throw DriverError(why);
  }
}

/// The reading of row 0. In real time the robot must be where it was a period before, as far as it
/// can have moved: a sensor that gives one wrong value is read again.
bool Loop::read_first() {
  constexpr int kReadings = 6;
  if (!read()) return false;
  if (!paced_ || accepts_reading_ || !backend_.watches_readings()) return true;
  const std::int64_t period = std::min(backend_.schema().head.period, kLongestBraking);
  backend_.judge_first(false);
  for (int i = 0; i < kReadings; ++i) {
    const std::int64_t due = monotonic_now() + period;
    const bool paces_itself = robot_->table().paces_itself != 0;
    if (paces_itself && !calls(Verb::wait, [&] { return robot_->wait(due); })) {
      return failed("wait");
    }
    while (!paces_itself && !sleep_until(due)) {
    }
    if (!read()) return false;
    if (backend_.judge_first(true)) return true;
  }
  return cannot_begin();
}

/// Row 0.
bool Loop::begin() { return backend_.publish() || cannot_begin(); }

bool Loop::cannot_begin() {
  fault_ = "'";
  fault_ += robot_->table().name;
  fault_ += "' cannot begin: ";
  fault_ += backend_.failure();
  return false;
}

// commands => desired => hardware, wait, hardware => observed, the row is published
Ended Loop::run() noexcept {
  pacer_.begin(monotonic_now());
  while (view_.finished == 0 && backend_.step() == Step::run) {
    if (!iterate()) break;
  }
  brake();
  return stop();
}

/// Before an end in order in real time: brakes all actuators, for at most one second. Not after a
/// failed function of the driver.
void Loop::brake() noexcept {
  if (!paced_ || !fault_.empty()) return;
  const std::int64_t end = monotonic_now() + kLongestBraking;
  while (monotonic_now() < end && backend_.brake() == Step::run) {
    if (!iterate()) return;
  }
}

Step Loop::run_granted(std::uint32_t most) noexcept {
  if (guard_.forked() || has_ended()) return Step::ended;
  for (std::uint32_t i = 0; i < most; ++i) {
    const Step step = view_.finished != 0 ? Step::ended : backend_.try_step();
    if (step == Step::standing) return step;
    if (step == Step::run && iterate()) continue;
    stop();
    return Step::ended;
  }
  return Step::run;
}

Step Loop::replay(Iteration last) noexcept {
  while (!has_ended() && backend_.iteration() <= last) {
    if (backend_.step() == Step::ended || !iterate()) stop();
  }
  return has_ended() ? Step::ended : Step::run;
}

bool Loop::iterate() noexcept {
  if (!write() || (paced_ && !pace()) || !read()) return false;
  backend_.publish();
  return true;
}

bool Loop::write() noexcept {
  const auto difference = [](const void* backend, std::uint32_t offset, std::uint32_t order) {
    return static_cast<const UntypedBackend*>(backend)->difference(offset, order);
  };
  const DesiredView view{backend_.desired(),
                         backend_.active(),
                         backend_.iteration(),
                         backend_.time(),
                         backend_.schema().head.period,
                         difference,
                         &backend_};
  return calls(Verb::write, [&] { return robot_->write(view); }) || failed("write");
}

/// In real time: waits for the end of the period, or in the driver's wait() for the robot's tick.
bool Loop::pace() noexcept {
  const bool in_time = pacer_.in_time(monotonic_now());
  if (robot_->table().paces_itself != 0) {
    if (!calls(Verb::wait, [&] { return robot_->wait(pacer_.due()); })) return failed("wait");
    backend_.set_timing(pacer_.tick(monotonic_now()));
    return !pacer_.runs_ahead() || failed_to_wait();
  }
  // A signal may arrive just before the sleep, so a long sleep is cut into slices. While the robot
  // moves, a stop does not shorten the period: the robot would have to move faster.
  bool over = !in_time;
  const bool moves = backend_.acts() && backend_.schema().head.period <= kLongestBraking;
  while (!over && (moves || !backend_.stop_asked() || backend_.phase() == Phase::braking)) {
    const std::int64_t slice = std::min(pacer_.due(), monotonic_now() + kSlice);
    over = sleep_until(slice) && slice == pacer_.due();
  }
  backend_.set_timing(pacer_.next(monotonic_now()));
  return true;
}

bool Loop::read() noexcept {
  view_.observed = backend_.observed();
  view_.extended = backend_.extended();
  view_.desired = nullptr;
  if (!read_into_view()) return false;
  if (paced_ && view_.missed != 0) backend_.set_timing(pacer_.missed());
  for (std::uint32_t word = 0; word < interrupted_.size(); ++word) {
    if (interrupted_[word] == 0) continue;
    for (std::uint64_t bits = std::exchange(interrupted_[word], 0); bits != 0; bits &= bits - 1) {
      const auto actuator = word * 64 + static_cast<std::uint32_t>(std::countr_zero(bits));
      if (actuator < backend_.schema().actuators.size()) backend_.interrupt(actuator);
    }
  }
  return true;
}

/// Reads into the places that `view_` names. `interrupted_` is zero before.
bool Loop::read_into_view() noexcept {
  view_.iteration = backend_.iteration();
  view_.time = backend_.time();
  const std::uint32_t finished = view_.finished;  // stays set
  view_.finished = view_.has_desired = view_.missed = view_.halted = view_.reported = 0;
  view_.halt_text.text[0] = 0;
  // reports change only while requests run, and by drivers that say so
  if (const bool any = backend_.runs_any(); any || reported_) {
    for (std::uint32_t i = 0; i < reports_.size(); ++i) {
      reports_[i].runs = backend_.runs(i) ? 1 : 0;
      reports_[i].changed = 0;
    }
    reported_ = any;
  }
  const bool reads = calls(Verb::read, [&] { return robot_->read(view_); });
  view_.finished = (reads ? view_.finished : 0) | finished;
  if (!reads) return failed("read");
  note_halt(view_);
  reported_ = reported_ || view_.reported != 0;
  if (view_.reported != 0) note_requests(view_);
  return true;
}

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

/// Reports ticks that came so fast that speed limits, which count iterations, no longer hold.
bool Loop::failed_to_wait() noexcept {
  const double period = static_cast<double>(backend_.schema().head.period) * 1e-6;
  const Pacer::FastTicks& fast = pacer_.fast_ticks();
  ShortText<400> text;
  text.add("'").add(robot_->table().name).add("' failed in wait: ").add(fast.ticks);
  text.add(" ticks came in ").add(static_cast<double>(fast.time) * 1e-6);
  text.add(" ms, where the period of ").add(period).add(" ms says ");
  text.add(static_cast<double>(fast.ticks) * period);
  text.add(" ms: give the rate of the robot's ticks (--frequency), or make wait() wait for them");
  fault_ = text.view();
  return false;
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
  if (!reads && reading.may_fail) {
    unread_ = fault_;
    fault_.clear();
    reading.why = unread_;
  }
  return reads;
}

void Loop::note_halt(const ReadingView& view) noexcept {
  if (view.halted == 0) return;
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

Ended Loop::stop() noexcept {
  if (!has_ended()) {
    calls(Verb::stop, [&] {
      robot_->stop();
      return true;
    });
    if (fault_.empty()) fault_ = backend_.failure();
    backend_.end(fault_.empty() ? BackendState::stopped : BackendState::failed, fault_);
  }
  return {fault_.empty(), fault_};
}

}  // namespace o80
