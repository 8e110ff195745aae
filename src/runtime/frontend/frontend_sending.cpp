// How a frontend adds records to a batch and sends it.
// See ARCHITECTURE.md#a-commands-way.

#include <algorithm>
#include <sstream>

#include "base/short_text.hpp"
#include "o80/runtime/frontend.hpp"
#include "runtime/frontend/link.hpp"
#include "runtime/frontend/sent.hpp"
#include "runtime/protocol/schedule_limits.hpp"

namespace o80 {

namespace {

RecordHead head_of(std::uint32_t actuator, const CommandOptions& options, Profile otherwise) {
  RecordHead head;
  head.actuator = static_cast<std::uint16_t>(actuator);
  head.mode = options.mode;
  head.profile = options.profile.value_or(otherwise);
  head.start = options.start;
  head.pace = options.pace.pace;
  if (options.pace.pace == Pace::speed) {
    head.speed = options.pace.per_second;
  } else {
    head.amount = options.pace.amount;
  }
  return head;
}

std::string seconds_text(std::int64_t nanoseconds) {
  std::ostringstream text;
  text << static_cast<double>(nanoseconds) * 1e-9 << " s";
  return text.str();
}

void check_pace(const PaceSpec& pace, std::uint32_t rows) {
  const auto check = [&pace](const std::string& name, std::int64_t low, std::int64_t high) {
    if (pace.amount >= low && pace.amount <= high) return;
    throw InvalidArgument(name + " must be from " + std::to_string(low) + " to " +
                          std::to_string(high) + ", got " + std::to_string(pace.amount));
  };
  const auto check_time = [&pace](const std::string& name) {
    if (pace.amount >= 0 && pace.amount <= kLongestDuration) return;
    throw InvalidArgument(name + " must be from 0 to " + seconds_text(kLongestDuration) + ", got " +
                          seconds_text(pace.amount));
  };
  switch (pace.pace) {
    case Pace::speed:
    case Pace::fastest:
    case Pace::chunk:
      return;
    case Pace::direct:
      return check_time("every");
    case Pace::duration:
      return check_time("duration");
    case Pace::iterations:
      return check("iterations", 1, kMaxIterations);
    case Pace::until:
      if (rows == 1) return check("until", 0, kMaxIterations);
      throw InvalidArgument("until is for one target: for a trajectory give iterations or times");
  }
}

void refuse_size(const char* what, std::size_t actuators, std::size_t given, std::size_t wanted,
                 const char* unit) {
  if (given == wanted) return;
  throw InvalidArgument(std::string("the ") + what + " of " + std::to_string(actuators) +
                        " actuators take " + std::to_string(wanted) + ' ' + unit + ", " +
                        std::to_string(given) + " were given");
}

/// Refuses options that contradict each other.
void check_options(const CommandOptions& options) {
  if (options.profile && options.pace.pace == Pace::fastest) {
    throw InvalidArgument(
        "a command that goes as fast as its limits allow has no profile: leave out profile");
  }
  if (options.profile == Profile::as_sent &&
      (options.pace.pace != Pace::direct || options.pace.amount != 0)) {
    throw InvalidArgument(
        "the profile as_sent is for set-points without a pace and without every: leave these out, "
        "or "
        "profile");
  }
}

/// Refuses rows that would be passed over, because another one is due in the same iteration.
void check_times(std::span<const std::int64_t> times, std::uint32_t rows, std::int64_t period) {
  if (times.size() != rows) {
    throw InvalidArgument("a trajectory of " + std::to_string(rows) + " rows needs " +
                          std::to_string(rows) + " times, got " + std::to_string(times.size()));
  }
  std::int64_t before = 0;
  for (std::size_t i = 0; i < times.size(); before = times[i++]) {
    const bool grows = times[i] > before && times[i] <= kLongestDuration;
    const auto iteration = [period](std::int64_t time) { return (time + period / 2) / period; };
    if (grows && iteration(times[i]) > iteration(before)) continue;
    ShortText<160> where;
    where.add("row ").add(i).add(" is due after ").add_seconds(times[i]);
    where.add(i == 0 ? ", the start is at " : ", the row before after ").add_seconds(before);
    if (grows) where.add(", in the same iteration of ").add_seconds(period);
    throw InvalidArgument("the times of a trajectory must grow from 0, by an iteration at least: " +
                          std::string(where.view()));
  }
}

void check_chunk(std::span<const std::uint32_t> due, const ChunkOptions& options) {
  const auto check = [](const char* name, std::int64_t value, std::int64_t low, std::int64_t high) {
    if (value >= low && value <= high) return;
    throw InvalidArgument(std::string(name) + " must be from " + std::to_string(low) + " to " +
                          std::to_string(high) + ", got " + std::to_string(value));
  };
  const auto rows = static_cast<std::int64_t>(due.size());
  check("the number of rows of a chunk", rows, 1, kMaxChunkRows);
  check("first (the first row to play)", options.first, 0, rows - 1);
  check("ease [iterations]", options.ease, 0, kLatestDue);
  check("the anchor", options.anchor, -std::int64_t{kLatestDue}, kMaxIterations);
  std::int64_t before = 0;
  for (std::size_t i = 0; i < due.size(); before = due[i++]) {
    if (due[i] > before && due[i] <= kLatestDue) continue;
    throw InvalidArgument("the due iterations of a chunk must rise from its anchor: row " +
                          std::to_string(i) + " is due " + std::to_string(due[i]) +
                          " iterations after it, the row before " + std::to_string(before));
  }
  if (is_of_rows(options.profile) || options.profile == Profile::linear) return;
  throw InvalidArgument("the profile of a chunk is smooth, monotone, linear or hold, got " +
                        std::string(to_text(options.profile)));
}

}  // namespace

// ------------------------------------------------------------------------------ adding

RecordHead UntypedFrontend::checked_command(std::uint32_t actuator,
                                            std::span<const std::byte> state,
                                            const CommandOptions& options,
                                            std::span<const std::uint64_t> mask) const {
  const std::uint32_t index = link_->command_check.actuator(std::int64_t{actuator});
  link_->command_check.targets(index, state, mask);
  check_options(options);
  if (options.profile && is_of_rows(*options.profile)) {
    throw InvalidArgument("the profile " + std::string(to_text(*options.profile)) +
                          " is for rows of targets, of a trajectory or a chunk");
  }
  const PaceSpec& pace = options.pace;
  check_pace(pace, 1);
  if (pace.pace == Pace::speed) link_->command_check.speed(index, pace.per_second, mask);
  if (pace.pace == Pace::fastest) link_->command_check.fastest(index, mask);
  if (pace.pace == Pace::direct) link_->command_check.direct(index, state, mask);
  return head_of(index, options, link_->command_check.usual_profile(index));
}

std::uint32_t UntypedFrontend::add_command(std::uint32_t actuator, std::span<const std::byte> state,
                                           const CommandOptions& options,
                                           std::span<const std::uint64_t> mask) {
  const RecordHead head = checked_command(actuator, state, options, mask);
  const auto lock = link_->lock_to_add();
  return link_->builder.command(head, mask, {}, 1, state);
}

std::uint32_t UntypedFrontend::add_commands(std::span<const std::uint32_t> actuators,
                                            std::span<const std::byte> states,
                                            const CommandOptions& options,
                                            std::span<const std::uint64_t> masks) {
  const auto lock = link_->lock_to_add();
  return add_commands_to(link_->builder, actuators, states, options, masks);
}

/// Throws InvalidArgument unless the actuators are there, each once, with a mask for each or none.
void UntypedFrontend::check_actuators(std::span<const std::uint32_t> actuators,
                                      std::span<const std::uint64_t> masks) const {
  if (actuators.empty()) throw InvalidArgument("a command needs at least one actuator");
  std::size_t words = 0;
  for (std::size_t i = 0; i < actuators.size(); ++i) {
    const std::uint32_t index = link_->command_check.actuator(std::int64_t{actuators[i]});
    words += link_->command_check.words_of_mask(index);
    if (std::ranges::count(actuators.first(i), index) == 0) continue;
    throw InvalidArgument("actuator '" + schema().actuators[index].name.str() +
                          "' is named twice: one command gives it one target");
  }
  if (!masks.empty()) refuse_size("masks", actuators.size(), masks.size(), words, "words");
}

/// Calls `visit` with each actuator, the states of its rows and its mask. The last one gets all
/// states that are left: the check of its targets says what is wrong with them.
template <class Visit>
void UntypedFrontend::each_share(std::span<const std::uint32_t> actuators, std::uint32_t rows,
                                 std::span<const std::byte> states,
                                 std::span<const std::uint64_t> masks, Visit&& visit) const {
  for (const std::uint32_t& actuator : actuators) {
    const std::size_t size = std::size_t{rows} * link_->command_check.layout(actuator).size();
    const bool is_last = &actuator == &actuators.back();
    const auto own = states.first(is_last ? states.size() : std::min(size, states.size()));
    const auto mask = masks.first(masks.empty() ? 0 : link_->command_check.words_of_mask(actuator));
    visit(actuator, own, mask);
    states = states.subspan(own.size());
    masks = masks.subspan(mask.size());
  }
}

std::uint32_t UntypedFrontend::add_commands_to(BatchBuilder& builder,
                                               std::span<const std::uint32_t> actuators,
                                               std::span<const std::byte> states,
                                               const CommandOptions& options,
                                               std::span<const std::uint64_t> masks) const {
  check_actuators(actuators, masks);
  std::size_t bytes = 0;
  for (const std::uint32_t actuator : actuators) {
    bytes += link_->command_check.layout(actuator).size();
  }
  refuse_size("states", actuators.size(), states.size(), bytes, "bytes");

  link_->members.clear();
  Profile profile = Profile::linear;
  each_share(actuators, 1, states, masks, [&](std::uint32_t actuator, auto state, auto mask) {
    const RecordHead head = checked_command(actuator, state, options, mask);
    if (head.profile == Profile::minimum_jerk) profile = Profile::minimum_jerk;
    link_->members.push_back({head, mask, state});
  });
  // all members use one profile: minimum_jerk if one of them needs it
  for (BatchBuilder::Member& member : link_->members) member.head.profile = profile;
  if (link_->members.size() == 1) {
    const BatchBuilder::Member& only = link_->members.front();
    return builder.command(only.head, only.mask, {}, 1, only.states);
  }
  return builder.group(link_->members);
}

/// Checks a trajectory; returns its options with the pace that follows from its times.
CommandOptions UntypedFrontend::checked_trajectory(std::uint32_t actuator, std::uint32_t rows,
                                                   std::span<const std::byte> states,
                                                   const CommandOptions& options,
                                                   std::span<const std::int64_t> times,
                                                   std::span<const std::uint64_t> mask) const {
  const std::uint32_t index = link_->command_check.actuator(std::int64_t{actuator});
  if (rows == 0) throw InvalidArgument("the trajectory has no row");
  check_options(options);
  link_->command_check.targets(index, states, mask);
  CommandOptions paced = options;
  // a trajectory always has a pace
  if (paced.pace.pace == Pace::direct) paced.pace = iterations(1);
  if (!times.empty()) {
    check_times(times, rows, link_->description->schema.head.period);
    paced.pace = duration(std::chrono::nanoseconds(times.back()));
  } else if (paced.pace.pace == Pace::duration && rows > 1) {
    throw InvalidArgument("a trajectory at a duration needs the times of its rows");
  }
  const bool is_timed = paced.pace.pace == Pace::iterations || paced.pace.pace == Pace::duration;
  if (!paced.profile) paced.profile = is_timed ? Profile::smooth : Profile::linear;
  if (!is_timed && is_of_rows(*paced.profile)) {
    throw InvalidArgument("the profile " + std::string(to_text(*paced.profile)) +
                          " needs rows that are due in fixed iterations: give iterations or times");
  }
  check_pace(paced.pace, rows);
  if (paced.pace.pace == Pace::speed)
    link_->command_check.speed(index, paced.pace.per_second, mask);
  if (paced.pace.pace == Pace::fastest) link_->command_check.fastest(index, mask);
  return paced;
}

std::uint32_t UntypedFrontend::add_trajectory(std::uint32_t actuator, std::uint32_t rows,
                                              std::span<const std::byte> states,
                                              const CommandOptions& options,
                                              std::span<const std::int64_t> times) {
  return add_trajectories({&actuator, 1}, rows, states, options, times);
}

std::uint32_t UntypedFrontend::add_trajectories(std::span<const std::uint32_t> actuators,
                                                std::uint32_t rows,
                                                std::span<const std::byte> states,
                                                const CommandOptions& options,
                                                std::span<const std::int64_t> times,
                                                std::span<const std::uint64_t> masks) {
  check_actuators(actuators, masks);
  CommandOptions paced = options;
  each_share(actuators, rows, states, masks, [&](std::uint32_t actuator, auto own, auto mask) {
    paced = checked_trajectory(actuator, rows, own, options, times, mask);
  });
  const std::span<const std::int64_t> ends = rows > 1 ? times : std::span<const std::int64_t>{};
  const auto lock = link_->lock_to_add();
  if (actuators.size() == 1) {
    return link_->builder.command(head_of(actuators[0], paced, Profile::linear), masks, ends, rows,
                                  states);
  }
  link_->members.clear();
  each_share(actuators, rows, states, masks, [&](std::uint32_t actuator, auto own, auto mask) {
    link_->members.push_back({head_of(actuator, paced, Profile::linear), mask, own});
  });
  return link_->builder.group(link_->members, ends, rows);
}

BatchBuilder& UntypedFrontend::own_builder() { return link_->builder; }

std::uint32_t UntypedFrontend::add_chunk(BatchBuilder& batch,
                                         std::span<const std::uint32_t> actuators,
                                         std::span<const std::uint32_t> due,
                                         std::span<const std::byte> states,
                                         const ChunkOptions& options,
                                         std::span<const std::uint64_t> masks) {
  check_actuators(actuators, masks);
  check_chunk(due, options);
  const auto rows = static_cast<std::uint32_t>(due.size());
  const ChunkHead chunk{.epoch = epoch(),
                        .anchor = options.anchor,
                        .plan = options.plan,
                        .rows = rows,
                        .ease = options.ease,
                        .first = options.first,
                        .fixed = static_cast<std::uint8_t>(options.fixed),
                        .reject_late = static_cast<std::uint8_t>(options.reject_late),
                        .final = static_cast<std::uint8_t>(options.final)};
  std::vector<const StateLayout*> layouts;
  const auto lock = link_->lock_to_add();
  link_->members.clear();
  each_share(actuators, rows, states, masks, [&](std::uint32_t actuator, auto own, auto mask) {
    link_->command_check.targets(actuator, own, mask);
    RecordHead head;
    head.actuator = static_cast<std::uint16_t>(actuator);
    head.profile = options.profile;
    layouts.push_back(&link_->command_check.layout(actuator));
    if (own.size() != due.size() * layouts.back()->size()) {
      throw InvalidArgument("a chunk needs a state for each of its " + std::to_string(rows) +
                            " rows");
    }
    link_->members.push_back({head, mask, own});
  });
  return batch.chunk(link_->members, chunk, due, layouts);
}

void UntypedFrontend::add_set_points(std::span<const std::uint32_t> actuators, std::uint32_t rows,
                                     std::span<const std::byte> states, Mode mode) {
  check_actuators(actuators, {});
  each_share(actuators, rows, states, {}, [&](std::uint32_t actuator, auto targets, auto) {
    link_->command_check.targets(actuator, targets);
  });
  const auto lock = link_->lock_to_add();
  each_share(actuators, rows, states, {}, [&](std::uint32_t actuator, auto targets, auto) {
    RecordHead head;
    head.actuator = static_cast<std::uint16_t>(actuator);
    head.mode = mode;
    head.profile = link_->command_check.usual_profile(actuator);
    link_->builder.command(head, {}, {}, rows, targets);
  });
}

std::uint32_t UntypedFrontend::add_close_plan(std::uint64_t plan) {
  const auto lock = link_->lock_to_add();
  return link_->builder.close_plan(plan);
}

std::uint32_t UntypedFrontend::add_purge(std::uint32_t actuator) {
  if (actuator != kEveryActuator) link_->command_check.actuator(std::int64_t{actuator});
  const auto lock = link_->lock_to_add();
  return link_->builder.purge(static_cast<std::uint16_t>(actuator));
}

std::uint32_t UntypedFrontend::add_purge_own() {
  const auto lock = link_->lock_to_add();
  return link_->builder.purge_own(kEveryActuator);
}

std::uint32_t UntypedFrontend::add_mark(std::string_view text) {
  const auto lock = link_->lock_to_add();
  return link_->builder.mark(text);
}

std::uint32_t UntypedFrontend::add_request(std::uint32_t request,
                                           std::span<const std::byte> payload) {
  link_->command_check.request(request, payload);
  const auto lock = link_->lock_to_add();
  return link_->builder.request(static_cast<std::uint16_t>(request), payload);
}

std::uint32_t UntypedFrontend::add_take_control() {
  const auto lock = link_->lock_to_add();
  return link_->builder.take_control();
}

std::uint32_t UntypedFrontend::add_release_control() {
  const auto lock = link_->lock_to_add();
  return link_->builder.release_control();
}

std::size_t UntypedFrontend::added() const {
  link_->segment.check_process();
  const std::scoped_lock lock(link_->sending);
  return link_->builder.records();
}

void UntypedFrontend::forget_added() {
  link_->segment.check_process();
  const std::scoped_lock lock(link_->sending);
  link_->builder.clear();
}

// ------------------------------------------------------------------------------ sending

namespace {

/// True if a batch may stay in the lane for long.
bool does_stay(const BatchBuilder& builder, const BatchRecord& wanted) {
  return builder.has_commands() || wanted.at != kNow;
}

/// True if a batch was taken or rejected.
bool has_begun(const LaneSender& lane, CommandId batch) {
  return lane.status(batch).known != LaneSender::Known::not_yet;
}

}  // namespace

BatchRecord UntypedFrontend::batch_of(const PulseOptions& options) {
  if (options.at != kNow && options.at < 0) {
    throw InvalidArgument("at must be at least iteration 0, got " + std::to_string(options.at));
  }
  BatchRecord record;
  record.at = options.at;
  record.late_now = options.late == PulseOptions::Late::now ? 1 : 0;
  return record;
}

/// Refuses a batch with too many requests or orders, which would make the iteration that takes it
/// too long.
void UntypedFrontend::refuse_if_too_much(const BatchBuilder& builder) const {
  const auto refuse = [&](std::uint32_t count, std::uint32_t most, const char* what) {
    if (count <= most) return;
    throw InvalidArgument("a batch can have at most " + std::to_string(most) + " " + what +
                          ", this one has " + std::to_string(count) +
                          ": send them in several pulses. Nothing was sent, all stays added "
                          "(forget_added() drops it)");
  };
  refuse(builder.requests(), kMaxRequests, "requests");
  refuse(builder.orders(), kMaxOrders, "orders to take or release control, or to close plans");

  const std::uint64_t journal = link_->segment.view().shape.journal_bytes;
  const std::uint64_t bytes = builder.blocks() * kBlockBytes;
  if (journal == 0 || bytes <= journal / 2) return;
  throw InvalidArgument(
      "this batch takes " + std::to_string(bytes) + " bytes, and the journal of '" + segment() +
      "' allows " + std::to_string(journal / 2) +
      " (half of its size). Send the commands in several pulses, or start the "
      "robot with a larger journal (--journal). Nothing was sent, all stays added "
      "(forget_added() drops it)");
}

/// Refuses a batch for a later iteration if too many of them wait already.
void UntypedFrontend::refuse_if_too_many_wait(Iteration at, const LaneSender& lane) {
  if (at == kNow) return;
  std::erase_if(link_->scheduled, [&](const Link::Scheduled& sent) {
    return sent.at <= link_->history.published() || has_begun(lane, sent.id);
  });
  const auto refuse = [&](std::size_t there, std::uint32_t most, const std::string& of) {
    if (there < most) return;
    throw LaneFull("'" + segment() + "' has " + std::to_string(most) +
                   " batches of this frontend that wait for " + of +
                   ", the maximum. Nothing was "
                   "sent, all stays added: put several commands into one batch, or pulse later");
  };
  const auto same = std::ranges::count(link_->scheduled, at, &Link::Scheduled::at);
  refuse(static_cast<std::size_t>(same), kMaxScheduledAt, "iteration " + std::to_string(at));
  refuse(link_->scheduled.size(), kMaxScheduled, "later iterations");
}

/// Refuses a batch that does not fit into the lane. Checked before ids are drawn: ids that are
/// never sent would overwrite the statuses of other batches.
void UntypedFrontend::refuse_if_full(const BatchBuilder& builder, const BatchRecord& wanted,
                                     const LaneSender& lane) const {
  const std::uint64_t needed = builder.blocks();
  // commands leave some blocks free for a burst, a purge or a request
  const bool stays = does_stay(builder, wanted);
  const std::uint32_t most = lane.blocks() - (stays ? kept_free(lane.blocks()) : 0);
  const std::uint32_t sent = lane.blocks() - lane.free_blocks();
  const std::uint32_t free = most - std::min(sent, most);
  if (needed > free) throw lane_full(segment(), needed, free, most);
}

/// Draws ids whose status slots are free.
CommandId UntypedFrontend::draw_ids(LaneSender& lane, std::uint64_t n, bool stays) {
  const auto has_ended = [&](CommandId id) {
    const LaneSender::StatusAnswer answer = lane.status(id);
    return answer.known == LaneSender::Known::forgotten ||
           (answer.known == LaneSender::Known::yes &&
            is_end(static_cast<Status>(answer.word.status)));
  };
  const std::optional<CommandId> first = stays ? link_->ids.draw(lane.next_id(), n, has_ended)
                                               : link_->ids.draw_kept(lane.next_id(), n, has_ended);
  if (!first) {
    throw LaneFull("the batches in the lane of '" + segment() +
                   "' that have not ended leave no status slots for " + std::to_string(n - 2) +
                   " more records. Nothing was sent, all stays added: wait for a batch, purge, or "
                   "start the backend with larger lanes (lane_blocks)");
  }
  lane.draw_ids(*first + n);
  return *first;
}

/// What a batch says about the row by which it was decided: also, which iteration was the newest
/// then.
std::optional<Seen> Link::with_newest_row(const std::optional<Seen>& seen) const {
  if (!seen) return {};
  if (seen->epoch == 0 || seen->iteration < 0 || seen->iteration > kMaxIterations) {
    throw InvalidArgument("seen: row " + std::to_string(seen->iteration) + " of run " +
                          std::to_string(seen->epoch) +
                          " is not a valid row: give an observation that a frontend or a "
                          "recording returned");
  }
  Seen sent = *seen;
  sent.since = -1;
  if (seen->epoch == description->epoch) {
    if (seen->iteration <= history.published()) sent.since = seen->iteration;
  } else if (seen->time >= 0 && seen->clock == description->schema.head.clock) {
    const Iteration newest = iteration_at(seen->time);
    if (newest >= history.oldest()) sent.since = newest;
  }
  return sent;
}

/// Seals a batch, sends it, and lets an inline robot take it.
Sent UntypedFrontend::send(BatchBuilder& builder, const BatchRecord& wanted,
                           const std::optional<Seen>& seen, Requested requested) {
  Sent sent;
  sent.seen = link_->with_newest_row(seen);
  std::shared_ptr<InlineRunner> runner;
  {
    const auto lock = link_->lock_to_send();
    runner = link_->runner;
    if (runner) runner->refuse_nested();
    if (builder.records() > 0) refuse_if_played(link_->segment);
    sent.lane = link_->lane();
    LaneSender* const lane = sent.lane.get();
    link_->segment.throw_if_known_gone();
    builder.set_seen(sent.seen);
    refuse_if_too_much(builder);
    refuse_if_too_many_wait(wanted.at, *lane);
    refuse_if_full(builder, wanted, *lane);
    BatchRecord record = wanted;
    const std::uint32_t records = builder.records();
    sent.events_before_send = lane->events();
    record.id = draw_ids(*lane, std::uint64_t{records} + 2, does_stay(builder, wanted));
    const std::span<const Block> blocks = builder.seal(record);
    link_->sent_commands.note(blocks, requested == Requested::yes ? &sent.commands : nullptr);
    lane->send(std::as_bytes(blocks), offsetof(BatchRecord, ticket));
    sent.clipped = builder.clipped();
    builder.clear();
    if (records > 0) link_->ids.sent(record.id, std::uint64_t{records} + 2);
    if (record.at != kNow) link_->scheduled.push_back({record.at, record.id});
    sent.id = record.id;
    sent.records = records;
  }
  if (runner) runner->run();
  return sent;
}

Batch UntypedFrontend::pulse(const PulseOptions& options, std::uint16_t flags) {
  BatchRecord record = batch_of(options);
  record.flags = flags;
  {
    const auto lock = link_->lock_to_send();
    if (link_->builder.empty()) return {};
  }
  return {link_, send(link_->builder, record, options.seen)};
}

Batch UntypedFrontend::pulse(BatchBuilder& batch, const std::optional<Seen>& seen) {
  link_->check_usable();
  return batch.empty() ? Batch() : Batch(link_, send(batch, {}, seen));
}

Batch UntypedFrontend::pulse_to_end(const PulseOptions& options) {
  return pulse(options, bursting() ? kBurstUntilEnded : std::uint16_t{0});
}

Batch UntypedFrontend::pulse_to_end(BatchBuilder& batch, const std::optional<Seen>& seen) {
  link_->check_usable();
  BatchRecord record;
  if (bursting()) record.flags = kBurstUntilEnded;
  return batch.empty() ? Batch() : Batch(link_, send(batch, record, seen));
}

}  // namespace o80
