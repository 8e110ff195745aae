#include "o80/runtime/backend.hpp"

#include "o80/describe/describe.hpp"
#include "torture/actor.hpp"

namespace torture {

namespace {

struct Habits {
  o80::BackendOptions options;
  std::int64_t pause;  // of an iteration [ns]
  bool interrupts;
  bool halts;
  bool limited;
  o80::Iteration orphan_at;  // -1: never
  o80::Iteration fails_at;   // the same
};

Habits draw(Actor& actor, bool bursting) {
  Chance& chance = actor.chance;
  Habits habits;
  habits.options.segment = segment_name(actor.slot.segment);
  habits.options.bursting = bursting;
  habits.pause = chance.percent(20) ? 0 : chance.between(50'000, 1'000'000);
  habits.options.history = static_cast<std::uint64_t>(
      chance.percent(50) ? chance.between(1, 40) : chance.between(100, 3000));
  habits.options.lanes = static_cast<std::uint32_t>(chance.between(2, 8));
  habits.options.lane_blocks = 16U << chance.below(7);
  constexpr o80::Stale kStale[] = {o80::Stale::hold, o80::Stale::hold, o80::Stale::purge,
                                   o80::Stale::stop, o80::Stale::halt};
  habits.options.stale = kStale[chance.below(std::size(kStale))];
  if (habits.options.stale != o80::Stale::hold && chance.percent(40))
    habits.options.silence = chance.between(20, 200);
  habits.options.resume = chance.percent(10);
  habits.interrupts = chance.percent(30);
  habits.halts = chance.percent(15);
  // the same for all of a round: a frontend attaches again only to the robot it knows
  habits.limited = mix(actor.round.seed, 99) % 2 == 0;
  habits.orphan_at = chance.percent(15) ? chance.between(0, 200) : -1;
  habits.fails_at = chance.percent(10) ? chance.between(1, 400) : -1;
  return habits;
}

/// A driver that keeps a journal of all it was told.
class Machine final : private o80::RequestServer {
 public:
  Machine(Actor& actor, const Habits& habits)
      : life_(actor.round.lives[actor.slot.generation]),
        number_(actor.slot.generation),
        chance_(mix(actor.slot.seed, 1)),
        backend_(schema_of("torture", habits.limited), habits.options, this) {
    life_.epoch = epoch_of(habits.options.segment);
  }

  o80::UntypedBackend& backend() { return backend_; }
  bool is_full() const { return life_.rows.load() + 16 >= kMaxRows; }

  o80::Step step() {
    stepped_at_ = o80::monotonic_now();
    life_.steps = backend_.iteration();
    return backend_.step_within(20 * kMillisecond);
  }

  void publish() {
    const States desired = states(backend_.desired());
    const States observed = desired;
    note(desired, static_cast<std::uint32_t>(backend_.active()[0] & ~backend_.braking()[0]), false);
    o80::pack(observed, backend_.observed());
    o80::pack(sensors(desired, observed), backend_.extended());
    chain_ = last_;
    backend_.publish();
  }

 private:
  static o80::Schema schema_of(const char* robot, bool limited) {
    o80::Schema schema;
    schema.head.robot = o80::NameText(robot);
    o80::describe_types<Robot>(schema);
    for (std::uint32_t i = 0; i < kActuators; ++i) {
      o80::Limits limits{.minimum = kLowest, .maximum = kHighest};
      if (limited && i == kLimited) {
        limits.speed = kSpeed;
        limits.acceleration = kAcceleration;
      }
      schema.actuator(i).limits(limits);
    }
    return schema;
  }
  States states(const std::byte* bytes) const { return o80::unpack<States>(bytes); }

  Sensors sensors(const States& desired, const States& observed) {
    const Sensors made = sensors_of(number_, backend_.iteration(), chain_, desired, observed);
    last_ = made.digest;
    JournalRow& row = life_.journal[static_cast<std::size_t>(backend_.iteration())];
    row.digest = made.digest;
    return made;
  }
  void note(const States& desired, std::uint32_t active, bool fresh) {
    JournalRow& row = life_.journal[static_cast<std::size_t>(backend_.iteration())];
    row.desired = desired;
    row.active = active;
    row.fresh = fresh ? 1 : 0;
    row.halted = backend_.halted().number;
    row.stepped_at = stepped_at_;
    row.at = o80::monotonic_now();
    life_.rows = backend_.iteration() + 1;
  }

  o80::Served serve(std::uint32_t request, std::span<const std::byte> payload) noexcept override {
    const auto mark = o80::unpack<Mark>(payload.data());
    if (request == 0 && is_refused(mark.id)) return o80::Served::rejected("a seventh one");
    const std::uint32_t place = life_.served;
    if (place < kMaxServed) {
      life_.requests[place] = {mark.id, backend_.iteration()};
      life_.served = place + 1;
    }
    return request == 1 ? o80::Served::start_afresh() : o80::Served::done();
  }
  o80::Served resume() noexcept override {
    const bool granted = !chance_.percent(15);
    const std::uint32_t place = life_.resumed;
    if (place < kMaxResumes) {
      life_.resumes[place] = {backend_.halted().number, backend_.iteration(), granted ? 1U : 0U};
      life_.resumed = place + 1;
    }
    return granted ? o80::Served::done() : o80::Served::rejected("the brakes are hot");
  }
  bool read_fresh(o80::FreshReading& reading) noexcept override {
    const States observed = states(reading.observed);
    note(observed, 0, true);
    o80::pack(sensors(observed, observed), reading.extended);
    chain_ = last_;
    return true;
  }

  Generation& life_;
  std::uint32_t number_;
  std::uint64_t chain_ = 0;  // digest of the last row
  std::uint64_t last_ = 0;   // and of the one under way
  std::int64_t stepped_at_ = 0;
  Chance chance_;
  o80::UntypedBackend backend_;
};

/// It ended on its own: for what its policy says, and only then.
void judge_own_end(Actor& actor, const Habits& habits, const std::string& why) {
  const bool silent = habits.options.silence > 0 && why.find("longer than") != std::string::npos;
  const bool died = why.find("frontend died") != std::string::npos && actor.any_sender_doomed();
  if (habits.options.stale == o80::Stale::stop && (silent || died)) return;
  actor.fail(Fault::false_death, "a backend ended on its own: %s", why.c_str());
}

/// Until it has failed, with the reason; or nothing, if it is to stop.
std::string iterate(Actor& actor, const Habits& habits, Machine& machine) {
  o80::UntypedBackend& backend = machine.backend();
  machine.publish();
  while (true) {
    if (actor.phase() == Phase::end || machine.is_full()) return "";
    const o80::Step step = machine.step();
    if (step == o80::Step::standing) continue;
    if (step == o80::Step::ended) {
      judge_own_end(actor, habits, std::string(backend.failure()));
      return std::string(backend.failure());
    }
    if (backend.iteration() == habits.fails_at && actor.acting()) return "the elbow is too hot";
    if (backend.iteration() == habits.orphan_at) actor.leave_an_orphan([] {});
    if (habits.interrupts && actor.chance.below(100) == 0)
      backend.interrupt(static_cast<std::uint32_t>(actor.chance.below(kActuators)));
    if (habits.halts && actor.acting() && actor.chance.below(300) == 0)
      backend.halt(o80::HaltCause::driver, "the belt slipped");
    if (!habits.options.bursting && habits.pause > 0 && actor.acting()) actor.pause(habits.pause);
    machine.publish();
  }
}

void run(Actor& actor, const Habits& habits, Machine& machine, Generation& life) {
  const std::string fault = iterate(actor, habits, machine);
  life.failed = fault.empty() ? 0 : 1;
  life.ending_at = o80::monotonic_now();
  machine.backend().end(fault.empty() ? o80::BackendState::stopped : o80::BackendState::failed,
                        fault);
}

}  // namespace

void be_a_backend(Actor& actor, bool bursting) {
  const Habits habits = draw(actor, bursting);
  Generation& life = actor.round.lives[actor.slot.generation];
  life.stops_stale = habits.options.stale == o80::Stale::stop ? 1 : 0;
  life.bursting = bursting ? 1 : 0;
  life.watches = habits.options.silence > 0 ? 1 : 0;
  life.limited = habits.limited ? 1 : 0;
  life.ignores_halts = bursting || habits.options.resume ? 1 : 0;
  try {
    Machine machine(actor, habits);
    run(actor, habits, machine, life);
  } catch (const o80::SegmentTaken& error) {
    actor.fail(Fault::unnoticed_death, "the successor of a dead backend was refused: %s",
               error.what());
  }
}

/// Starts a second backend beside one that lives, or is stopped: it must be refused.
void be_a_usurper(Actor& actor) {
  Generation& life = actor.round.lives[actor.slot.generation];
  // it may have the name until it is refused
  life.usurped = 1;
  try {
    o80::Schema schema;
    schema.head.robot = o80::NameText("usurper");
    o80::describe_types<Robot>(schema);
    const o80::UntypedBackend backend(schema, {.segment = segment_name(actor.slot.segment)});
    if (life.doomed_at == 0 && life.ending_at == 0)
      actor.fail(Fault::taken_alive, "generation %u lives, and another backend took its name",
                 actor.slot.generation);
  } catch (const o80::SegmentTaken&) {
    // as it must be
    life.usurped = 0;
  }
}

}  // namespace torture
