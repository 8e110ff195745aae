#include "torture/sender.hpp"

#include <bit>

#include "runtime/frontend/link.hpp"

namespace torture {

namespace {

template <class T>
std::span<const std::byte> bytes_of(const T& value) {
  return std::as_bytes(std::span(&value, 1));
}

std::uint64_t bits_of(double value) { return std::bit_cast<std::uint64_t>(value); }

}  // namespace

Sender::Sender(Actor& actor, o80::UntypedFrontend frontend)
    : actor_(actor), frontend_(std::move(frontend)), life_(actor.life_of(frontend_)) {
  first_ = actor_.slot.commands;
  actor_.slot.commanding = 1;
  attachment_ = ++actor_.slot.attachments;
}

Sender::~Sender() = default;

bool Sender::has_room() const {
  return actor_.slot.batches + 4 < kMaxBatches && actor_.slot.commands + 64 < kMaxCommands;
}

// ------------------------------------------------------------------------------ adding

SentCommand& Sender::note(SentKind kind, std::uint64_t value, std::uint32_t actuator) {
  const std::uint32_t place = actor_.slot.commands;
  SentCommand& command = actor_.slot.sent_commands[place];
  command.kind = kind;
  command.value = value;
  command.actuator = actuator;
  actor_.slot.commands = place + 1;
  return command;
}

void Sender::add_command() {
  Chance& chance = actor_.chance;
  const auto actuator = static_cast<std::uint32_t>(chance.below(kActuators));
  const double target = unique_target(chance.bits());
  o80::CommandOptions options;
  const bool limited = life_.limited != 0 && actuator == kLimited;
  switch (chance.below(limited ? 8 : 7)) {
    case 0:
      options.pace = o80::iterations(chance.between(1, 20));
      break;
    case 1:
      options.pace = o80::duration(std::chrono::nanoseconds(chance.between(0, 3'000'000)));
      break;
    case 2:
      options.pace =
          o80::until(std::max<o80::Iteration>(0, frontend_.published()) + chance.between(0, 30));
      break;
    case 3:
      options.pace = o80::speed(static_cast<double>(chance.between(20, limited ? 200 : 2000)));
      break;
    case 7:
      options.pace = o80::fastest();
      break;
    default:
      break;
  }
  if (chance.percent(20)) options.mode = o80::Mode::overwrite;
  const bool has_profile = options.pace.pace != o80::Pace::fastest;
  if (chance.percent(20) && has_profile) options.profile = o80::Profile::minimum_jerk;
  if (chance.percent(20)) options.start = o80::Start::observed;
  const bool fades = limited || (options.mode == o80::Mode::overwrite &&
                                 options.profile == o80::Profile::minimum_jerk);
  note(SentKind::command, bits_of(target), actuator).arrives_early = fades ? 1 : 0;
  frontend_.add_command(actuator, bytes_of(target), options);
}

void Sender::add_group() {
  Chance& chance = actor_.chance;
  std::array<std::uint32_t, kActuators> actuators{};
  std::array<double, kActuators> targets{};
  for (std::uint32_t i = 0; i < kActuators; ++i) {
    actuators[i] = i;
    targets[i] = unique_target(chance.bits());
  }
  o80::CommandOptions options;
  switch (chance.below(5)) {
    case 0:
      options.pace = o80::iterations(chance.between(1, 20));
      break;
    case 1:
      options.pace = o80::duration(std::chrono::nanoseconds(chance.between(0, 3'000'000)));
      break;
    case 2:
      options.pace = o80::speed(static_cast<double>(chance.between(20, 200)));
      break;
    default:
      break;
  }
  if (chance.percent(20)) options.mode = o80::Mode::overwrite;
  if (chance.percent(20)) options.profile = o80::Profile::minimum_jerk;
  // all members arrive together: none starts where it is not, which the limiter would follow
  SentCommand& sent = note(SentKind::group, 0, 0);
  sent.targets = std::bit_cast<std::array<std::uint64_t, kActuators>>(targets);
  sent.arrives_early = 1;
  frontend_.add_commands(actuators, std::as_bytes(std::span(targets)), options);
}

void Sender::add_trajectory() {
  Chance& chance = actor_.chance;
  const auto actuator = static_cast<std::uint32_t>(chance.below(kActuators));
  std::vector<double> rows(static_cast<std::size_t>(chance.between(2, 30)));
  for (double& row : rows) row = unique_target(chance.bits());
  note(SentKind::command, bits_of(rows.back()), actuator).arrives_early =
      life_.limited != 0 && actuator == kLimited ? 1 : 0;
  const auto count = static_cast<std::uint32_t>(rows.size());
  const auto states = std::as_bytes(std::span(rows));
  if (chance.percent(50)) {
    frontend_.add_trajectory(actuator, count, states,
                             {.pace = o80::iterations(chance.between(1, 3))});
    return;
  }
  std::vector<std::int64_t> times(rows.size());
  std::int64_t time = 0;
  for (std::int64_t& end : times) end = time += chance.between(kMillisecond, 3 * kMillisecond);
  frontend_.add_trajectory(actuator, count, states, {}, times);
}

/// A chunk that begins when it is taken: it overwrites as a command does.
void Sender::add_chunk() {
  Chance& chance = actor_.chance;
  const auto actuator = static_cast<std::uint32_t>(chance.below(kActuators));
  std::vector<double> rows(static_cast<std::size_t>(chance.between(1, 30)));
  std::vector<std::uint32_t> due;
  for (double& row : rows) {
    row = unique_target(chance.bits());
    due.push_back((due.empty() ? 0 : due.back()) +
                  static_cast<std::uint32_t>(chance.between(1, 10)));
  }
  const o80::Iteration published = std::max<o80::Iteration>(0, frontend_.published());
  const o80::ChunkOptions options{
      .anchor = std::max<o80::Iteration>(0, published - chance.between(0, 20)),
      .plan = static_cast<std::uint64_t>(attachment_),
      .ease = static_cast<std::uint32_t>(chance.between(1, 20)),
      .fixed = chance.percent(30)};
  note(SentKind::command, bits_of(rows.back()), actuator).arrives_early =
      life_.limited != 0 && actuator == kLimited ? 1 : 0;
  frontend_.add_chunk({&actuator, 1}, due, std::as_bytes(std::span(rows)), options);
}

void Sender::add_outside() {
  const double target = actor_.chance.percent(50) ? kHighest + 1e-9 : kLowest - 1e-9;
  try {
    frontend_.add_command(0, bytes_of(target));
  } catch (const o80::InvalidArgument&) {
    return;
  }
  actor_.fail(Fault::bad_error, "a target outside of the limits was taken");
}

void Sender::add_some() {
  Chance& chance = actor_.chance;
  for (std::int64_t n = chance.between(1, 5); n > 0; --n) {
    const std::uint64_t kind = chance.below(100);
    if (kind < 55) {
      add_command();
    } else if (kind < 70) {
      add_group();
    } else if (kind < 75) {
      add_trajectory();
    } else if (kind < 80) {
      add_chunk();
    } else if (kind < 82) {
      add_outside();
    } else if (kind < 84) {
      const Look look{chance.bits() >> 1 | 3ULL << 62};
      note(SentKind::look, look.id, 0);
      frontend_.add_request(2, bytes_of(look));
    } else if (kind < 92) {
      const Mark mark{chance.bits() >> 1};
      note(SentKind::mark, mark.id, 0);
      frontend_.add_request(0, bytes_of(mark));
    } else if (kind < 94) {
      note(SentKind::other, 0, 0);
      frontend_.add_purge_own();
    } else if (kind < 96) {
      note(SentKind::other, 0, 0);
      frontend_.add_purge(static_cast<std::uint32_t>(chance.below(kActuators)));
    } else if (kind < 97) {
      const Again again{chance.bits() >> 1 | 1ULL << 63};
      note(SentKind::mark, again.id, 0);
      frontend_.add_request(1, bytes_of(again));
    } else if (kind < 98) {
      note(SentKind::take_control, 0, 0);
      frontend_.add_take_control();
      controls_ = true;
    } else {
      note(SentKind::release_control, 0, 0);
      frontend_.add_release_control();
      controls_ = false;
    }
  }
}

// ------------------------------------------------------------------------------ sending

bool Sender::send(std::int64_t at, bool late_now, std::int64_t burst, bool until_ended,
                  const std::function<o80::Batch()>& send) {
  const std::uint32_t place = actor_.slot.batches;
  SentBatch& entry = actor_.slot.sent_batches[place];
  entry.generation = static_cast<std::uint32_t>(&life_ - actor_.round.lives.data());
  entry.first_command = first_;
  entry.commands = actor_.slot.commands - first_;
  entry.attachment = attachment_;
  entry.at = at;
  entry.late_now = late_now ? 1 : 0;
  entry.burst = burst;
  entry.until_ended = until_ended ? 1 : 0;
  entry.taken = -1;
  entry.burst_row = -1;
  entry.sent_at = 0;
  entry.seen = 0;
  entry.sent = static_cast<std::uint32_t>(Sent::under_way);
  actor_.slot.batches = place + 1;
  first_ = actor_.slot.commands;
  try {
    const o80::Batch batch = send();
    entry.id = batch.id();
    entry.lane = frontend_.link()->lane()->lane();
    entry.seen = batch.seen() ? batch.seen()->iteration + 1 : 0;
    entry.sent = static_cast<std::uint32_t>(Sent::sent);
    entry.sent_at = o80::monotonic_now();
    open_.push_back({batch, &entry});
  } catch (const o80::Error& error) {
    entry.sent = static_cast<std::uint32_t>(Sent::refused);
    frontend_.forget_added();
    if (!is_refusal(error)) throw;
    return false;
  }
  watch_lane();
  return true;
}

bool Sender::pulse(const o80::PulseOptions& options) {
  if (actor_.slot.commands == first_) return false;
  return send(options.at, options.late == o80::PulseOptions::Late::now, 0, false,
              [&] { return frontend_.pulse(options); });
}

std::optional<o80::Burst> Sender::burst(std::int64_t iterations) {
  std::optional<o80::Burst> burst;
  if (iterations == 0 && actor_.slot.commands == first_) return burst;
  send(o80::kNow, false, iterations, iterations == 0, [&] {
    if (iterations > 0) {
      burst = frontend_.start_burst(iterations);
    } else {
      burst.emplace(frontend_.link(), frontend_.pulse_to_end());
    }
    return burst->batch();
  });
  return burst;
}

/// Nobody has taken the lane of a sender that lives.
void Sender::watch_lane() {
  const auto lane = frontend_.link()->lane();
  const std::uint64_t counted =
      frontend_.link()->segment.view().lane(lane->lane()).incarnation.load();
  if (counted != lane->incarnation())
    actor_.fail(Fault::taken_alive, "lane %u of a living frontend has another owner", lane->lane());
  if (lane_ != kNoLane) return;
  lane_ = lane->lane();
  const std::uint32_t former = life_.lane_owners[lane_].exchange(actor_.number() + 1);
  if (former == 0 || actor_.round.slots[former - 1].doomed_at != 0) return;
  actor_.fail(Fault::taken_alive, "lane %u was taken from actor %u, which lives", lane_,
              former - 1);
}

void Sender::close() {
  if (lane_ != kNoLane) {
    std::uint32_t own = actor_.number() + 1;
    life_.lane_owners[lane_].compare_exchange_strong(own, 0);
  }
  if (attachment_ > actor_.slot.closed) actor_.slot.closed = attachment_;
  frontend_.close();
  actor_.slot.commanding = 0;
}

// ------------------------------------------------------------------------------ settling

std::size_t Sender::open_commands() const {
  std::size_t count = 0;
  for (const Open& open : open_) count += open.entry->commands;
  return count;
}

void Sender::settle(const Open& open) {
  // asked first: of a batch that is refused in between, no iteration is known
  const o80::Iteration first = open.batch.first_iteration();
  if (open.batch.rejection().empty()) open.entry->taken = first;
  for (std::uint32_t i = 0; i < open.entry->commands; ++i) {
    const o80::Handle handle = open.batch.handle(i);
    SentCommand& command = actor_.slot.sent_commands[open.entry->first_command + i];
    command.told_at = handle.iteration;
    command.told = static_cast<std::uint32_t>(handle.status);
  }
}

void Sender::settle() {
  std::erase_if(open_, [&](const Open& open) {
    if (!open.batch.ended()) return false;
    settle(open);
    return true;
  });
}

void Sender::settle_all() {
  for (const Open& open : open_) settle(open);
  open_.clear();
}

}  // namespace torture
