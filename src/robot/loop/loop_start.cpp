// How a loop begins: the segment, the start of the hardware, and row 0.
#include <algorithm>

#include "memory/segment/verb_word.hpp"
#include "o80/base/error.hpp"
#include "o80/base/time.hpp"
#include "o80/robot/plant_requests.hpp"
#include "robot/loop/loop.hpp"
#include "robot/loop/robot_provenance.hpp"

namespace o80 {

namespace {
/// Index of the request `snapshot` whose first field is the slot; the number of requests if there
/// is none.
std::uint32_t snapshot_of(const Schema& schema) {
  const auto found = std::ranges::find_if(schema.requests, [&](const RequestRow& request) {
    const TypeRow& type = schema.types[request.type];
    return request.name.view() == "snapshot" && type.size == sizeof(Snapshot);
  });
  return static_cast<std::uint32_t>(found - schema.requests.begin());
}

BackendOptions of_loop(BackendOptions options, const DriverInstance& robot) {
  Provenance provenance = provenance_of(robot.table(), robot.options());
  provenance.run_options = std::move(options.provenance.run_options);
  options.provenance = std::move(provenance);
  options.has_loop = true;
  return options;
}
}  // namespace

Loop::Loop(std::unique_ptr<DriverInstance> robot, const BackendOptions& options,
           RecordedDecisions* recorded)
    : robot_(std::move(robot)),
      backend_(robot_->describe(options.period), of_loop(options, *robot_), this, recorded),
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

void Loop::start(const std::function<void()>& set_up) {
  const bool started = calls(Verb::start, [&] { return robot_->start(); });
  if (!started) failed("start");
  const bool begins = started && read_first();
  if (begins) set_up();
  if (!begins || !begin()) {
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
  fault_ = "'" + std::string(robot_->table().name) +
           "' cannot begin: " + std::string(backend_.failure());
  return false;
}

}  // namespace o80
