#include "torture/halting.hpp"
#include "torture/sender.hpp"

namespace torture {

namespace {

template <class Wanted, class Call>
void must_throw(Actor& actor, const char* what, Call&& call) {
  try {
    call();
  } catch (const Wanted&) {
    return;
  } catch (const std::exception& error) {
    actor.fail(Fault::bad_error, "%s in a forked child says: %s", what, error.what());
  }
  actor.fail(Fault::bad_error, "%s works in a forked child", what);
}

class Commander {
 public:
  explicit Commander(Actor& actor)
      : actor_(actor),
        max_open_(static_cast<std::size_t>(actor.chance.between(1, 60))),
        orphans_(actor.chance.percent(15)),
        keen_(actor.chance.percent(30)) {}

  void run() {
    serve_every_backend(actor_, call_began_, [&](Sender& sender) {
      while (actor_.acting() && sender.has_room()) command(sender);
      wind_up(sender);
    });
  }

 private:
  void command(Sender& sender) {
    call_began_ = o80::monotonic_now();
    if (sender.open_commands() < max_open_) {
      sender.add_some();
      const bool sent = sender.pulse(when(sender));
      // the more so when a lane is full
      if (actor_.chance.percent(sender.controls() ? 10 : sent ? 1 : 5)) halt_now(sender);
    }
    if (actor_.chance.percent(10)) resume(actor_, sender.frontend(), call_began_);
    if (orphans_ && actor_.chance.below(50) == 0) leave_an_orphan(sender);
    if (sender.open() > 0 && actor_.chance.percent(40)) wait(sender);
    sender.settle();
    if (sender.open_commands() >= max_open_ && sender.open() > 0) wait(sender);
    if (!keen_) actor_.pause(actor_.chance.between(0, 3) * kMillisecond);
  }

  void halt_now(Sender& sender) {
    if (sender.controls()) ++actor_.slot.halted_in_control;
    halt(actor_, sender.frontend());
  }

  o80::PulseOptions when(Sender& sender) {
    o80::PulseOptions options;
    const o80::Iteration newest = sender.frontend().published();
    if (actor_.chance.percent(30) && newest >= 0) {
      options.seen = {sender.frontend().epoch(), newest - actor_.chance.between(-5, 5)};
      options.seen->iteration = std::max<o80::Iteration>(0, options.seen->iteration);
    }
    if (actor_.chance.percent(85)) return options;
    options.at =
        std::max<o80::Iteration>(0, sender.frontend().published() + actor_.chance.between(-2, 40));
    if (actor_.chance.percent(50)) options.late = o80::PulseOptions::Late::now;
    return options;
  }

  void wait(Sender& sender) {
    const auto timeout = actor_.some_timeout();
    const std::int64_t stopped = actor_.stopped();
    call_began_ = o80::monotonic_now();
    const o80::Batch batch = sender.last();
    try {
      actor_.timed("batch.wait", timeout, [&] { batch.wait(timeout, {}, {.check = false}); });
      if (!batch.ended())
        actor_.fail(Fault::falsely_told, "a wait returned before its batch ended");
    } catch (const o80::TimeoutError&) {
      actor_.judge_timeout(sender.life(), call_began_, stopped);
    }
  }

  /// What was sent is waited for, for a while.
  void wind_up(Sender& sender) {
    for (int i = 0; i < 20 && sender.open() > 0; ++i) {
      wait(sender);
      sender.settle();
    }
  }

  void leave_an_orphan(Sender& sender) {
    actor_.leave_an_orphan([&] {
      o80::UntypedFrontend& frontend = sender.frontend();
      using o80::UsedAfterFork;
      must_throw<UsedAfterFork>(actor_, "latest", [&] { frontend.latest(); });
      must_throw<UsedAfterFork>(actor_, "wait_for",
                                [&] { frontend.wait_for(0, std::chrono::milliseconds(1)); });
      must_throw<UsedAfterFork>(actor_, "history", [&] { frontend.history(3); });
      must_throw<UsedAfterFork>(actor_, "add_command", [&] {
        const double target = 1;
        frontend.add_command(0, std::as_bytes(std::span(&target, 1)));
      });
      must_throw<UsedAfterFork>(actor_, "pulse", [&] { frontend.pulse(); });
    });
  }

  Actor& actor_;
  std::size_t max_open_;
  bool orphans_;
  bool keen_;
  std::int64_t call_began_ = 0;
};

}  // namespace

void be_a_commander(Actor& actor) { Commander(actor).run(); }

}  // namespace torture
