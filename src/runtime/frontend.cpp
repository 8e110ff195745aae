#include "o80/runtime/frontend.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "o80/describe/table.hpp"

namespace o80 {

namespace {

RecordHead head_of(std::uint32_t actuator, const CommandOptions& options) {
  RecordHead head;
  head.actuator = static_cast<std::uint16_t>(actuator);
  head.mode = options.mode;
  head.profile = options.profile;
  head.start = options.start;
  head.pace = options.pace.pace;
  if (options.pace.pace == Pace::speed) {
    head.speed = options.pace.per_second;
  } else {
    head.amount = options.pace.amount;
  }
  return head;
}

void check_pace(const PaceSpec& pace, std::uint32_t rows) {
  const auto refuse = [](const std::string& why) { throw InvalidArgument("the pace " + why); };
  switch (pace.pace) {
    case Pace::direct:
    case Pace::speed:
      return;
    case Pace::duration:
      if (pace.amount < 0) refuse("is a negative duration");
      if (pace.amount > kLongestDuration) refuse("is a duration too long to be counted");
      return;
    case Pace::iterations:
      if (pace.amount < 1) refuse("of iterations must be at least 1");
      if (pace.amount > kMostIterations) refuse("is too many iterations");
      return;
    case Pace::until:
      if (rows > 1) refuse("'until' suits one target; give a trajectory iterations or times");
      if (pace.amount < 0) refuse("'until' is a negative iteration");
      if (pace.amount > kMostIterations) refuse("'until' lies too far");
  }
}

void check_times(std::span<const std::int64_t> times, std::uint32_t rows) {
  if (times.size() != rows) {
    throw InvalidArgument("a trajectory of " + std::to_string(rows) +
                          " rows needs as many times, " + std::to_string(times.size()) +
                          " were given");
  }
  for (std::size_t i = 0; i < times.size(); ++i) {
    const std::int64_t before = i == 0 ? 0 : times[i - 1];
    if (times[i] < before || times[i] > kLongestDuration) {
      throw InvalidArgument("the times of a trajectory must grow from 0: row " + std::to_string(i) +
                            " ends at " + std::to_string(times[i]) + " ns, the one before at " +
                            std::to_string(before) + " ns");
    }
  }
}

}  // namespace

UntypedFrontend::UntypedFrontend(const std::string& segment, const FrontendOptions& options) {
  AttachOptions attach;
  attach.dead = options.dead ? AttachOptions::Dead::accept : AttachOptions::Dead::wait;
  attach.check = options.check;
  link_ = std::make_shared<Link>(
      AttachedSegment::attach(segment, options.access, Deadline(options.timeout), attach), nullptr);
  check_ = std::make_unique<CommandCheck>(link_->description->schema);
}

UntypedFrontend::UntypedFrontend(const std::string& segment, std::shared_ptr<InlineRunner> runner)
    : link_(std::make_shared<Link>(
          AttachedSegment::attach(segment, Access::read_write, Deadline(std::chrono::seconds(5))),
          std::move(runner))),
      check_(std::make_unique<CommandCheck>(link_->description->schema)) {}

UntypedFrontend::UntypedFrontend(UntypedFrontend&&) noexcept = default;
UntypedFrontend& UntypedFrontend::operator=(UntypedFrontend&& other) noexcept {
  // what was here closes with `other`
  std::swap(link_, other.link_);
  std::swap(check_, other.check_);
  std::swap(builder_, other.builder_);
  return *this;
}

UntypedFrontend::~UntypedFrontend() {
  if (link_) close();
}

const std::string& UntypedFrontend::segment() const { return link_->segment.name(); }
const Schema& UntypedFrontend::schema() const { return link_->description->schema; }
const RowLayout& UntypedFrontend::layout() const { return link_->description->layout; }
std::shared_ptr<const Description> UntypedFrontend::description() const {
  return link_->description;
}
std::uint64_t UntypedFrontend::epoch() const { return link_->segment.epoch(); }
bool UntypedFrontend::bursting() const { return schema().head.bursting != 0; }
std::int64_t UntypedFrontend::period() const { return schema().head.period; }
Life UntypedFrontend::life() const { return link_->segment.life(); }

std::uint32_t UntypedFrontend::actuator(std::string_view name) const {
  return check_->actuator(name);
}

std::uint32_t UntypedFrontend::request_index(std::string_view name) const {
  std::string there;
  for (std::uint32_t i = 0; i < schema().requests.size(); ++i) {
    if (schema().requests[i].name.view() == name) return i;
    there += (i == 0 ? "" : ", ") + schema().requests[i].name.str();
  }
  throw InvalidArgument("'" + segment() + "' serves no request '" + std::string(name) +
                        (there.empty() ? "': it serves none" : "'; there are: " + there));
}

// ------------------------------------------------------------------------------ adding

std::uint32_t UntypedFrontend::add_command(std::uint32_t actuator, std::span<const std::byte> state,
                                           const CommandOptions& options,
                                           std::span<const std::uint64_t> mask) {
  const std::uint32_t index = check_->actuator(std::int64_t{actuator});
  check_->targets(index, state, mask);
  check_pace(options.pace, 1);
  if (options.pace.pace == Pace::speed) check_->speed(index, options.pace.per_second);
  const std::scoped_lock lock(link_->sending);
  link_->check_usable();
  return builder_.command(head_of(index, options), mask, {}, 1, state);
}

std::uint32_t UntypedFrontend::add_trajectory(std::uint32_t actuator, std::uint32_t rows,
                                              std::span<const std::byte> states,
                                              const CommandOptions& options,
                                              std::span<const std::int64_t> times) {
  const std::uint32_t index = check_->actuator(std::int64_t{actuator});
  if (rows == 0) throw InvalidArgument("the trajectory has no row");
  check_->targets(index, states);
  CommandOptions paced = options;
  if (!times.empty()) {
    check_times(times, rows);
    paced.pace = duration(std::chrono::nanoseconds(times.back()));
  } else if (paced.pace.pace == Pace::duration && rows > 1) {
    throw InvalidArgument("a trajectory at a duration needs the times of its rows");
  }
  check_pace(paced.pace, rows);
  if (paced.pace.pace == Pace::speed) check_->speed(index, paced.pace.per_second);
  const std::scoped_lock lock(link_->sending);
  link_->check_usable();
  return builder_.command(head_of(index, paced), {},
                          rows > 1 ? times : std::span<const std::int64_t>{}, rows, states);
}

std::uint32_t UntypedFrontend::add_purge(std::uint32_t actuator) {
  if (actuator != kEveryActuator) check_->actuator(std::int64_t{actuator});
  const std::scoped_lock lock(link_->sending);
  return builder_.purge(static_cast<std::uint16_t>(actuator));
}

std::uint32_t UntypedFrontend::add_purge_own() {
  const std::scoped_lock lock(link_->sending);
  return builder_.purge_own(kEveryActuator);
}

std::uint32_t UntypedFrontend::add_request(std::uint32_t request,
                                           std::span<const std::byte> payload) {
  check_->request(request, payload);
  const std::scoped_lock lock(link_->sending);
  link_->check_usable();
  return builder_.request(static_cast<std::uint16_t>(request), payload);
}

std::uint32_t UntypedFrontend::add_take_control() {
  const std::scoped_lock lock(link_->sending);
  return builder_.take_control();
}

std::uint32_t UntypedFrontend::add_release_control() {
  const std::scoped_lock lock(link_->sending);
  return builder_.release_control();
}

std::size_t UntypedFrontend::added() const {
  const std::scoped_lock lock(link_->sending);
  return builder_.records();
}

void UntypedFrontend::forget_added() {
  const std::scoped_lock lock(link_->sending);
  builder_.clear();
}

// ------------------------------------------------------------------------------ sending

/// Before anything is used up: ids that are drawn and never sent would age the statuses of others.
void UntypedFrontend::refuse_if_full(const BatchBuilder& builder, const LaneSender& lane) const {
  const std::uint64_t needed = builder.blocks();
  const auto takes = [&] {
    return "the batch takes " + std::to_string(needed) + " blocks of 64 bytes, ";
  };
  if (needed > lane.blocks()) {
    throw LaneFull(takes() + "a lane of '" + segment() + "' has " + std::to_string(lane.blocks()) +
                   ": send it in parts, or start the backend with larger lanes (lane_blocks)");
  }
  if (const std::uint32_t free = lane.free_blocks(); needed > free) {
    throw LaneFull(takes() + std::to_string(free) + " of " + std::to_string(lane.blocks()) +
                   " are free in the lane of '" + segment() +
                   "'. Nothing was sent, all stays added: pulse again when earlier commands have "
                   "ended, purge, or start the backend with larger lanes (lane_blocks)");
  }
}

/// Seals a batch, sends it, and lets an inline robot take it.
Batch UntypedFrontend::send(BatchBuilder& builder, const BatchRecord& wanted) {
  Batch batch;
  std::shared_ptr<InlineRunner> runner;
  {
    const std::scoped_lock lock(link_->sending);
    const std::shared_ptr<LaneSender> lane = link_->lane();
    runner = link_->runner;
    link_->segment.throw_if_known_gone();
    refuse_if_full(builder, *lane);
    BatchRecord record = wanted;
    const std::uint32_t records = builder.records();
    record.id = lane->next_ids(std::uint64_t{records} + 2);
    lane->send(std::as_bytes(builder.seal(record)), offsetof(BatchRecord, ticket));
    builder.clear();
    batch = Batch(link_, lane, record.id, records);
  }
  if (runner) runner->run();
  return batch;
}

Batch UntypedFrontend::pulse(const PulseOptions& options, std::uint16_t flags) {
  if (options.at != kNow && options.at < 0) {
    throw InvalidArgument("a batch cannot be taken at iteration " + std::to_string(options.at));
  }
  BatchRecord record;
  record.at = options.at;
  record.late_now = options.late == PulseOptions::Late::now ? 1 : 0;
  record.flags = flags;
  {
    const std::scoped_lock lock(link_->sending);
    link_->check_usable();
    if (builder_.empty()) return {};
  }
  return send(builder_, record);
}

Batch UntypedFrontend::pulse(BatchBuilder& batch) {
  link_->check_usable();
  return batch.empty() ? Batch() : send(batch, {});
}

Batch UntypedFrontend::pulse_to_end(const PulseOptions& options) {
  return pulse(options, bursting() ? kBurstUntilEnded : std::uint16_t{0});
}

UntypedObservation UntypedFrontend::wait_for_end(const Batch& batch, Timeout timeout,
                                                 const Check& check) const {
  UntypedObservation observation(link_->description);
  Iteration last = -1;
  if (batch.id() != 0 && bursting()) {
    last = Burst(link_, batch).wait_done(timeout, check);
  } else {
    batch.wait(timeout, check);
    last = batch.last_iteration();
  }
  if (const std::string why = batch.rejection(); !why.empty()) {
    throw Error("the batch sent to '" + segment() + "' was rejected: " + why);
  }
  if (last < 0 || !link_->history.read(last, observation.bytes())) latest(observation.bytes());
  return observation;
}

UntypedObservation UntypedFrontend::pulse_and_wait(Timeout timeout, const PulseOptions& options,
                                                   const Check& check) {
  return wait_for_end(pulse_to_end(options), timeout, check);
}

Burst UntypedFrontend::start_burst(std::int64_t iterations) {
  if (!bursting()) {
    throw NotBursting("'" + segment() +
                      "' runs by its own clock and cannot be burst: start it with bursting");
  }
  if (iterations < 1) {
    throw InvalidArgument("a burst of " + std::to_string(iterations) +
                          " iterations: at least 1 is needed");
  }
  BatchRecord record;
  record.burst = iterations;
  return {link_, send(builder_, record)};
}

UntypedObservation UntypedFrontend::burst(std::int64_t iterations, Timeout timeout,
                                          const Check& check) {
  return start_burst(iterations).wait(timeout, check);
}

std::vector<UntypedObservation> burst(
    std::span<const std::pair<UntypedFrontend*, std::int64_t>> frontends, Timeout timeout,
    const Check& check) {
  // nothing is granted if one of them cannot burst
  for (const auto& [frontend, iterations] : frontends) {
    if (!frontend->bursting()) {
      throw NotBursting("'" + frontend->segment() +
                        "' runs by its own clock and cannot be burst: start it with bursting");
    }
    if (iterations < 1) {
      throw InvalidArgument("a burst of " + std::to_string(iterations) + " iterations of '" +
                            frontend->segment() + "': at least 1 is needed");
    }
  }
  const Deadline deadline(timeout);
  std::vector<Burst> bursts;
  bursts.reserve(frontends.size());
  for (const auto& [frontend, iterations] : frontends) {
    bursts.push_back(frontend->start_burst(iterations));
  }
  std::vector<UntypedObservation> observations;
  observations.reserve(frontends.size());
  for (const Burst& burst : bursts) {
    const Timeout left = timeout ? Timeout(std::chrono::nanoseconds(
                                       deadline.left(std::numeric_limits<std::int64_t>::max())))
                                 : Timeout();
    observations.push_back(burst.wait(left, check));
  }
  return observations;
}

// ------------------------------------------------------------------------------ reading

Iteration UntypedFrontend::published() const {
  link_->check_usable();
  return link_->history.published();
}

Iteration UntypedFrontend::oldest() const {
  link_->check_usable();
  return link_->history.oldest();
}

void UntypedFrontend::latest(std::byte* row) const {
  link_->check_usable();
  if (link_->history.latest(row) < 0) {
    throw Error("'" + segment() + "' has no row yet");
  }
}

UntypedObservation UntypedFrontend::latest() const {
  UntypedObservation observation(link_->description);
  latest(observation.bytes());
  return observation;
}

void UntypedFrontend::missing(Iteration k) const {
  throw RowOverwritten("row " + std::to_string(k) + " of '" + segment() +
                       "' is no longer there: the oldest one is " +
                       std::to_string(link_->history.oldest()) + " (the history keeps " +
                       std::to_string(link_->history.rows()) + " rows)");
}

void UntypedFrontend::wait_for(Iteration k, std::byte* row, Timeout timeout,
                               const Check& check) const {
  link_->check_usable();
  if (k < 0) throw InvalidArgument("there is no row " + std::to_string(k) + ": rows begin at 0");
  if (k > link_->history.published()) {
    const Deadline deadline(timeout);
    if (link_->rows.wait_for_row(k, deadline, link_->guarded(check)) == Waited::timed_out) {
      throw TimeoutError("row " + std::to_string(k) + " of '" + segment() +
                         "' was not there in time: it is at row " +
                         std::to_string(link_->history.published()) +
                         (bursting() ? ", and stands still until it is burst" : ""));
    }
  }
  if (!link_->history.read(k, row)) missing(k);
}

UntypedObservation UntypedFrontend::wait_for(Iteration k, Timeout timeout,
                                             const Check& check) const {
  UntypedObservation observation(link_->description);
  wait_for(k, observation.bytes(), timeout, check);
  return observation;
}

Rows UntypedFrontend::history(Iteration first, Iteration last) const {
  link_->check_usable();
  Rows rows;
  rows.row_bytes = layout().size;
  const Iteration begin = std::max(first, link_->history.oldest());
  const Iteration end = std::min(last, link_->history.published());
  rows.first = begin;
  if (end < begin) return rows;
  const auto count = static_cast<std::size_t>(end - begin + 1);
  rows.bytes.resize(count * rows.row_bytes);
  const HistoryReader::Range range = link_->history.read_range(begin, count, rows.bytes.data());
  rows.first = range.first;
  rows.count = range.count;
  rows.bytes.resize(range.count * rows.row_bytes);
  return rows;
}

Rows UntypedFrontend::history(std::size_t n) const {
  const Iteration last = published();
  const auto most = static_cast<std::size_t>(last + 1);
  return history(last + 1 - static_cast<Iteration>(std::min(n, most)), last);
}

std::int64_t UntypedFrontend::wait_for_next(Iteration& position, std::byte* row, Timeout timeout,
                                            const Check& check) const {
  link_->check_usable();
  const Iteration wanted = position;
  if (wanted > link_->history.published()) {
    const Deadline deadline(timeout);
    if (link_->rows.wait_for_row(wanted, deadline, link_->guarded(check)) == Waited::timed_out) {
      throw TimeoutError("row " + std::to_string(wanted) + " of '" + segment() +
                         "' was not there in time");
    }
  }
  Iteration next = wanted;
  while (!link_->history.read(next, row)) next = std::max(next, link_->history.oldest());
  position = next + 1;
  return next - wanted;
}

void UntypedFrontend::close() {
  link_->closed.store(true, std::memory_order_relaxed);
  const std::scoped_lock lock(link_->sending);
  // batches that are still asked keep their statuses, not the lane
  if (link_->lane_) link_->lane_->give_back();
  link_->lane_.reset();
  link_->runner.reset();
}

bool UntypedFrontend::closed() const { return link_->closed.load(std::memory_order_relaxed); }

}  // namespace o80
