// What a frontend adds to a batch, and how it sends it.

#include <algorithm>
#include <limits>

#include "o80/runtime/frontend.hpp"

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

}  // namespace o80
