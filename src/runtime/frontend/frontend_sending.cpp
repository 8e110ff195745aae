// How a frontend adds records to a batch and sends it.
// See ARCHITECTURE.md#a-commands-way.

#include <algorithm>
#include <sstream>

#include "base/short_text.hpp"
#include "o80/runtime/frontend.hpp"
#include "runtime/frontend/link.hpp"
#include "runtime/frontend/sending.hpp"
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

void check_range(const char* name, std::int64_t value, std::int64_t low, std::int64_t high) {
  if (value >= low && value <= high) return;
  throw InvalidArgument(std::string(name) + " must be from " + std::to_string(low) + " to " +
                        std::to_string(high) + ", got " + std::to_string(value));
}

void check_pace(const PaceSpec& pace, std::uint32_t rows) {
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
      return check_range("iterations", pace.amount, 1, kMaxIterations);
    case Pace::until:
      if (rows == 1) return check_range("until", pace.amount, 0, kMaxIterations);
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
  const auto rows = static_cast<std::int64_t>(due.size());
  check_range("the number of rows of a chunk", rows, 1, kMaxChunkRows);
  check_range("first (the first row to play)", options.first, 0, rows - 1);
  check_range("ease [iterations]", options.ease, 0, kLatestDue);
  check_range("the anchor", options.anchor, -std::int64_t{kLatestDue}, kMaxIterations);
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

RecordHead checked_command(const CommandCheck& check, std::uint32_t actuator,
                           std::span<const std::byte> state, const CommandOptions& options,
                           std::span<const std::uint64_t> mask) {
  const std::uint32_t index = check.actuator(std::int64_t{actuator});
  check.targets(index, state, mask);
  check_options(options);
  if (options.profile && is_of_rows(*options.profile)) {
    throw InvalidArgument("the profile " + std::string(to_text(*options.profile)) +
                          " is for rows of targets, of a trajectory or a chunk");
  }
  const PaceSpec& pace = options.pace;
  check_pace(pace, 1);
  if (pace.pace == Pace::speed) check.speed(index, pace.per_second, mask);
  if (pace.pace == Pace::fastest) check.fastest(index, mask);
  if (pace.pace == Pace::direct) check.direct(index, state, mask);
  return head_of(index, options, check.usual_profile(index));
}

/// Throws InvalidArgument unless the actuators are there, each once, with a mask for each or none.
void check_actuators(const Link& link, std::span<const std::uint32_t> actuators,
                     std::span<const std::uint64_t> masks) {
  if (actuators.empty()) throw InvalidArgument("a command needs at least one actuator");
  std::size_t words = 0;
  for (std::size_t i = 0; i < actuators.size(); ++i) {
    const std::uint32_t index = link.command_check.actuator(std::int64_t{actuators[i]});
    words += link.command_check.words_of_mask(index);
    if (std::ranges::count(actuators.first(i), index) == 0) continue;
    throw InvalidArgument("actuator '" + link.description->schema.actuators[index].name.str() +
                          "' is named twice: one command gives it one target");
  }
  if (!masks.empty()) refuse_size("masks", actuators.size(), masks.size(), words, "words");
}

/// Calls `visit` with each actuator, the states of its rows and its mask. The last one gets all
/// states that are left: the check of its targets says what is wrong with them.
template <class Visit>
void each_share(const CommandCheck& check, std::span<const std::uint32_t> actuators,
                std::uint32_t rows, std::span<const std::byte> states,
                std::span<const std::uint64_t> masks, Visit&& visit) {
  for (const std::uint32_t& actuator : actuators) {
    const std::size_t size = std::size_t{rows} * check.layout(actuator).size();
    const bool is_last = &actuator == &actuators.back();
    const auto own = states.first(is_last ? states.size() : std::min(size, states.size()));
    const auto mask = masks.first(masks.empty() ? 0 : check.words_of_mask(actuator));
    visit(actuator, own, mask);
    states = states.subspan(own.size());
    masks = masks.subspan(mask.size());
  }
}

/// Checks a trajectory; returns its options with the pace that follows from its times.
CommandOptions checked_trajectory(const Link& link, std::uint32_t actuator, std::uint32_t rows,
                                  std::span<const std::byte> states, const CommandOptions& options,
                                  std::span<const std::int64_t> times,
                                  std::span<const std::uint64_t> mask) {
  if (rows == 0) throw InvalidArgument("the trajectory has no row");
  check_options(options);
  link.command_check.targets(actuator, states, mask);
  CommandOptions paced = options;
  // a trajectory always has a pace
  if (paced.pace.pace == Pace::direct) paced.pace = iterations(1);
  if (!times.empty()) {
    check_times(times, rows, link.description->schema.head.period);
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
    link.command_check.speed(actuator, paced.pace.per_second, mask);
  if (paced.pace.pace == Pace::fastest) link.command_check.fastest(actuator, mask);
  return paced;
}

/// Adds the command of Link::members.
std::uint32_t add_members(const Link& link, BatchBuilder& builder,
                          std::span<const std::int64_t> times = {}, std::uint32_t rows = 1) {
  if (link.members.size() > 1) return builder.group(link.members, times, rows);
  const BatchBuilder::Member& only = link.members.front();
  return builder.command(only.head, only.mask, times, rows, only.states);
}

}  // namespace

// ------------------------------------------------------------------------------ adding

std::uint32_t UntypedFrontend::add_command(std::uint32_t actuator, std::span<const std::byte> state,
                                           const CommandOptions& options,
                                           std::span<const std::uint64_t> mask) {
  const RecordHead head = checked_command(link_->command_check, actuator, state, options, mask);
  const auto lock = link_->lock_to_add();
  return link_->builder.command(head, mask, {}, 1, state);
}

std::uint32_t UntypedFrontend::add_commands(std::span<const std::uint32_t> actuators,
                                            std::span<const std::byte> states,
                                            const CommandOptions& options,
                                            std::span<const std::uint64_t> masks) {
  const auto lock = link_->lock_to_add();
  return add_commands_to(*link_, link_->builder, actuators, states, options, masks);
}

std::uint32_t add_commands_to(Link& link, BatchBuilder& builder,
                              std::span<const std::uint32_t> actuators,
                              std::span<const std::byte> states, const CommandOptions& options,
                              std::span<const std::uint64_t> masks) {
  const CommandCheck& check = link.command_check;
  check_actuators(link, actuators, masks);
  std::size_t bytes = 0;
  for (const std::uint32_t actuator : actuators) bytes += check.layout(actuator).size();
  refuse_size("states", actuators.size(), states.size(), bytes, "bytes");

  link.members.clear();
  Profile profile = Profile::linear;
  each_share(check, actuators, 1, states, masks,
             [&](std::uint32_t actuator, auto state, auto mask) {
               const RecordHead head = checked_command(check, actuator, state, options, mask);
               if (head.profile == Profile::minimum_jerk) profile = Profile::minimum_jerk;
               link.members.push_back({head, mask, state});
             });
  // all members use one profile: minimum_jerk if one of them needs it
  for (BatchBuilder::Member& member : link.members) member.head.profile = profile;
  return add_members(link, builder);
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
  check_actuators(*link_, actuators, masks);
  const auto lock = link_->lock_to_add();
  link_->members.clear();
  each_share(link_->command_check, actuators, rows, states, masks,
             [&](std::uint32_t actuator, auto own, auto mask) {
               const CommandOptions paced =
                   checked_trajectory(*link_, actuator, rows, own, options, times, mask);
               link_->members.push_back({head_of(actuator, paced, Profile::linear), mask, own});
             });
  return add_members(*link_, link_->builder, rows > 1 ? times : std::span<const std::int64_t>{},
                     rows);
}

BatchBuilder& UntypedFrontend::own_builder() { return link_->builder; }

std::uint32_t UntypedFrontend::add_chunk(BatchBuilder& batch,
                                         std::span<const std::uint32_t> actuators,
                                         std::span<const std::uint32_t> due,
                                         std::span<const std::byte> states,
                                         const ChunkOptions& options,
                                         std::span<const std::uint64_t> masks) {
  check_actuators(*link_, actuators, masks);
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
  each_share(link_->command_check, actuators, rows, states, masks,
             [&](std::uint32_t actuator, auto own, auto mask) {
               link_->command_check.targets(actuator, own, mask);
               RecordHead head;
               head.actuator = static_cast<std::uint16_t>(actuator);
               head.profile = options.profile;
               layouts.push_back(&link_->command_check.layout(actuator));
               if (own.size() != due.size() * layouts.back()->size()) {
                 throw InvalidArgument("a chunk needs a state for each of its " +
                                       std::to_string(rows) + " rows");
               }
               link_->members.push_back({head, mask, own});
             });
  return batch.chunk(link_->members, chunk, due, layouts);
}

void UntypedFrontend::add_set_points(std::span<const std::uint32_t> actuators, std::uint32_t rows,
                                     std::span<const std::byte> states, Mode mode) {
  check_actuators(*link_, actuators, {});
  each_share(link_->command_check, actuators, rows, states, {},
             [&](std::uint32_t actuator, auto targets, auto) {
               link_->command_check.targets(actuator, targets);
             });
  const auto lock = link_->lock_to_add();
  each_share(link_->command_check, actuators, rows, states, {},
             [&](std::uint32_t actuator, auto targets, auto) {
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

/// Refuses a batch with too many requests or orders, which would make the iteration that takes it
/// too long.
void refuse_if_too_much(const Link& link, const BatchBuilder& builder) {
  const auto refuse = [&](std::uint32_t count, std::uint32_t most, const char* what) {
    if (count <= most) return;
    throw InvalidArgument("a batch can have at most " + std::to_string(most) + " " + what +
                          ", this one has " + std::to_string(count) +
                          ": send them in several pulses. Nothing was sent, all stays added "
                          "(forget_added() drops it)");
  };
  refuse(builder.requests(), kMaxRequests, "requests");
  refuse(builder.orders(), kMaxOrders, "orders to take or release control, or to close plans");

  const std::uint64_t journal = link.segment.view().shape.journal_bytes;
  const std::uint64_t bytes = builder.blocks() * kBlockBytes;
  if (journal == 0 || bytes <= journal / 2) return;
  throw InvalidArgument(
      "this batch takes " + std::to_string(bytes) + " bytes, and the journal of '" +
      link.segment.name() + "' allows " + std::to_string(journal / 2) +
      " (half of its size). Send the commands in several pulses, or start the "
      "robot with a larger journal (--journal). Nothing was sent, all stays added "
      "(forget_added() drops it)");
}

/// Refuses a batch for a later iteration if too many of them wait already.
void refuse_if_too_many_wait(Link& link, Iteration at, const LaneSender& lane) {
  if (at == kNow) return;
  std::erase_if(link.scheduled, [&](const Link::Scheduled& sent) {
    return sent.at <= link.history.published() || has_begun(lane, sent.id);
  });
  const auto refuse = [&](std::size_t there, std::uint32_t most, const std::string& of) {
    if (there < most) return;
    throw LaneFull("'" + link.segment.name() + "' has " + std::to_string(most) +
                   " batches of this frontend that wait for " + of +
                   ", the maximum. Nothing was "
                   "sent, all stays added: put several commands into one batch, or pulse later");
  };
  const auto same = std::ranges::count(link.scheduled, at, &Link::Scheduled::at);
  refuse(static_cast<std::size_t>(same), kMaxScheduledAt, "iteration " + std::to_string(at));
  refuse(link.scheduled.size(), kMaxScheduled, "later iterations");
}

/// Refuses a batch that does not fit into the lane. Checked before ids are drawn: ids that are
/// never sent would overwrite the statuses of other batches.
void refuse_if_full(const Link& link, const BatchBuilder& builder, const BatchRecord& wanted,
                    const LaneSender& lane) {
  const std::uint64_t needed = builder.blocks();
  // commands leave some blocks free for a burst, a purge or a request
  const bool stays = does_stay(builder, wanted);
  const std::uint32_t most = lane.blocks() - (stays ? kept_free(lane.blocks()) : 0);
  const std::uint32_t sent = lane.blocks() - lane.free_blocks();
  const std::uint32_t free = most - std::min(sent, most);
  if (needed > free) throw lane_full(link.segment.name(), needed, free, most);
}

/// Draws ids whose status slots are free.
CommandId draw_ids(Link& link, LaneSender& lane, std::uint64_t n, bool stays) {
  const auto has_ended = [&](CommandId id) {
    const LaneSender::StatusAnswer answer = lane.status(id);
    return answer.known == LaneSender::Known::forgotten ||
           (answer.known == LaneSender::Known::yes &&
            is_end(static_cast<Status>(answer.word.status)));
  };
  const std::optional<CommandId> first = stays ? link.ids.draw(lane.next_id(), n, has_ended)
                                               : link.ids.draw_kept(lane.next_id(), n, has_ended);
  if (!first) {
    throw LaneFull("the batches in the lane of '" + link.segment.name() +
                   "' that have not ended leave no status slots for " + std::to_string(n - 2) +
                   " more records. Nothing was sent, all stays added: wait for a batch, purge, or "
                   "start the backend with larger lanes (lane_blocks)");
  }
  lane.draw_ids(*first + n);
  return *first;
}

}  // namespace

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

BatchRecord batch_of(const PulseOptions& options) {
  if (options.at != kNow && options.at < 0) {
    throw InvalidArgument("at must be at least iteration 0, got " + std::to_string(options.at));
  }
  BatchRecord record;
  record.at = options.at;
  record.late_now = options.late == PulseOptions::Late::now ? 1 : 0;
  return record;
}

std::shared_ptr<LaneSender> refuse_unless_sendable(Link& link, BatchBuilder& builder,
                                                   const BatchRecord& wanted,
                                                   const std::optional<Seen>& seen) {
  if (link.runner) link.runner->refuse_nested();
  if (builder.records() > 0) refuse_if_played(link.segment);
  std::shared_ptr<LaneSender> lane = link.lane();
  link.segment.throw_if_known_gone();
  builder.set_seen(seen);
  refuse_if_too_much(link, builder);
  refuse_if_too_many_wait(link, wanted.at, *lane);
  refuse_if_full(link, builder, wanted, *lane);
  return lane;
}

Sent send(Link& link, BatchBuilder& builder, const BatchRecord& wanted,
          const std::optional<Seen>& seen, Statuses statuses) {
  Sent sent;
  sent.seen = link.with_newest_row(seen);
  std::shared_ptr<InlineRunner> runner;
  {
    const auto lock = link.lock_to_send();
    if (builder.empty() && wanted.burst == 0) return sent;
    runner = link.runner;
    sent.lane = refuse_unless_sendable(link, builder, wanted, sent.seen);
    LaneSender& lane = *sent.lane;
    BatchRecord record = wanted;
    const std::uint32_t records = builder.records();
    sent.events_before_send = lane.events();
    record.id = draw_ids(link, lane, std::uint64_t{records} + 2, does_stay(builder, wanted));
    const std::span<const Block> blocks = builder.seal(record);
    link.sent_commands.note(blocks, statuses == Statuses::noted ? &sent.commands : nullptr);
    lane.send(std::as_bytes(blocks), offsetof(BatchRecord, ticket));
    sent.clipped = builder.clipped();
    builder.clear();
    if (records > 0) link.ids.sent(record.id, std::uint64_t{records} + 2);
    if (record.at != kNow) link.scheduled.push_back({record.at, record.id});
    sent.id = record.id;
    sent.records = records;
  }
  if (runner) runner->run();
  return sent;
}

namespace {
Batch pulsed(const std::shared_ptr<Link>& link, BatchBuilder& builder, BatchRecord record,
             const std::optional<Seen>& seen, std::uint16_t flags = 0) {
  record.flags = flags;
  Sent sent = send(*link, builder, record, seen);
  return sent.lane ? Batch(link, std::move(sent)) : Batch();
}
}  // namespace

Batch UntypedFrontend::pulse(const PulseOptions& options) {
  return pulsed(link_, link_->builder, batch_of(options), options.seen);
}

Batch UntypedFrontend::pulse(BatchBuilder& batch, const std::optional<Seen>& seen) {
  return pulsed(link_, batch, {}, seen);
}

Batch UntypedFrontend::pulse_to_end(const PulseOptions& options) {
  return pulsed(link_, link_->builder, batch_of(options), options.seen,
                bursting() ? kBurstUntilEnded : std::uint16_t{0});
}

Batch UntypedFrontend::pulse_to_end(BatchBuilder& batch, const std::optional<Seen>& seen) {
  return pulsed(link_, batch, {}, seen, bursting() ? kBurstUntilEnded : std::uint16_t{0});
}

}  // namespace o80
