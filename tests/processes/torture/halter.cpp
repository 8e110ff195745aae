#include <optional>

#include "torture/halting.hpp"

namespace torture {

namespace {

/// Halts and resumes, and commands nothing.
class Halter {
 public:
  explicit Halter(Actor& actor)
      : actor_(actor),
        calm_(actor.chance.between(2, 40) * kMillisecond),
        resumes_(actor.chance.percent(75)) {}

  void run() {
    while (actor_.acting()) {
      if (actor_.chance.percent(10)) halt_by_name(actor_);
      std::optional<o80::UntypedFrontend> frontend = actor_.attach(actor_.slot.segment);
      if (!frontend) continue;
      Generation& life = actor_.life_of(*frontend);
      try {
        while (actor_.acting() && actor_.slot.halts + 8 < kMaxHalts) halt_now_and_then(*frontend);
      } catch (const o80::BackendGone& error) {
        actor_.judge_gone(life, error, call_began_);
      }
      frontend->close();
      actor_.slot.commanding = 0;
      if (actor_.slot.halts + 8 >= kMaxHalts) return;
    }
  }

 private:
  void halt_now_and_then(o80::UntypedFrontend& frontend) {
    actor_.pause(actor_.chance.between(0, calm_));
    call_began_ = o80::monotonic_now();
    for (std::int64_t n = actor_.chance.percent(15) ? 3 : 1; n > 0; --n) halt(actor_, frontend);
    if (!resumes_) {
      actor_.pause(actor_.chance.between(0, 4 * calm_));
      // others may resume, and who goes on sending without end learns what a halt is
      if (actor_.chance.percent(50)) return;
    }
    for (int tries = 0; tries < 30 && actor_.acting() && frontend.halted(); ++tries) {
      resume(actor_, frontend, call_began_);
      if (actor_.chance.percent(70)) actor_.pause(actor_.chance.between(0, kMillisecond));
    }
  }

  Actor& actor_;
  std::int64_t calm_;
  bool resumes_;
  std::int64_t call_began_ = 0;
};

}  // namespace

void be_a_halter(Actor& actor) { Halter(actor).run(); }

}  // namespace torture
