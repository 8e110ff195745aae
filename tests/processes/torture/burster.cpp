#include <optional>

#include "torture/halting.hpp"
#include "torture/sender.hpp"
#include "torture/verify.hpp"

namespace torture {

namespace {

/// Waits for the end of a burst, and verifies its last row.
void await(Actor& actor, Sender& sender, const o80::Burst& burst, Verifier& verifier) {
  const auto timeout = actor.some_timeout();
  const o80::Iteration row =
      actor.timed("burst.wait", timeout, [&] { return burst.wait_done(timeout); });
  if (row < 0) return;
  sender.entry().burst_row = row;
  const o80::Rows rows = sender.frontend().history(row, row);
  if (rows.count == 1) verifier.verify(rows.row(0).data(), row);
  if (rows.count == 0 && sender.frontend().published() < row)
    actor.fail(Fault::falsely_told, "a burst ended with row %ld, which is not there",
               static_cast<long>(row));
}

class Burster {
 public:
  explicit Burster(Actor& actor) : actor_(actor) {}

  void run() {
    serve_every_backend(actor_, call_began_, [&](Sender& sender) {
      Verifier verifier(actor_, sender.frontend());
      while (actor_.acting() && sender.has_room()) burst(sender, verifier);
    });
  }

 private:
  void burst(Sender& sender, Verifier& verifier) {
    const std::int64_t stopped = actor_.stopped();
    call_began_ = o80::monotonic_now();
    if (sender.open_commands() < 60) sender.add_some();
    if (actor_.chance.percent(20)) sender.pulse();
    const std::int64_t n = actor_.chance.percent(20) ? 0 : actor_.chance.between(1, 12);
    const std::optional<o80::Burst> burst = sender.burst(n);
    if (actor_.chance.percent(2)) halt(actor_, sender.frontend());
    if (burst && sender.open() > 0 && sender.last().id() == burst->batch().id())
      wait(sender, *burst, verifier, stopped);
    sender.settle();
    if (actor_.chance.percent(20)) resume(actor_, sender.frontend(), call_began_);
    if (actor_.chance.percent(50)) actor_.pause(actor_.chance.between(0, 2) * kMillisecond);
  }

  void wait(Sender& sender, const o80::Burst& burst, Verifier& verifier, std::int64_t stopped) {
    try {
      await(actor_, sender, burst, verifier);
    } catch (const o80::TimeoutError&) {
      actor_.judge_timeout(sender.life(), call_began_, stopped);
    } catch (const o80::BackendHalted&) {
      ++actor_.slot.bursts_halted;
    } catch (const o80::RowOverwritten&) {
      // forgotten: others did many bursts since
    }
  }

  Actor& actor_;
  std::int64_t call_began_ = 0;
};

/// Bursts two backends at once.
class GroupBurster {
 public:
  explicit GroupBurster(Actor& actor) : actor_(actor) {}

  void run() {
    while (actor_.acting()) {
      std::array both{actor_.attach(0), actor_.attach(1)};
      if (!both[0] || !both[1]) continue;
      Sender first(actor_, std::move(*both[0]));
      Sender second(actor_, std::move(*both[1]));
      serve({&first, &second});
      if (!first.has_room()) return;
    }
  }

 private:
  using Both = std::array<Sender*, 2>;

  void serve(const Both& both) {
    std::array verifiers{Verifier(actor_, both[0]->frontend()),
                         Verifier(actor_, both[1]->frontend())};
    try {
      while (actor_.acting() && both[0]->has_room()) burst(both, verifiers);
    } catch (const o80::BackendGone& error) {
      const bool second = std::string(error.what()).find(segment_name(1)) != std::string::npos;
      actor_.judge_gone(both[second ? 1 : 0]->life(), error, call_began_);
    }
    for (Sender* sender : both) sender->settle_all();
    for (Sender* sender : both) sender->close();
  }

  void burst(const Both& both, std::array<Verifier, 2>& verifiers) {
    const std::int64_t stopped = actor_.stopped();
    call_began_ = o80::monotonic_now();
    try {
      if (actor_.chance.percent(50)) {
        burst_with_commands(both, verifiers);
      } else {
        burst_at_once(both, verifiers);
      }
    } catch (const o80::TimeoutError&) {
      for (const Sender* sender : both) actor_.judge_timeout(sender->life(), call_began_, stopped);
    } catch (const o80::BackendHalted&) {
      ++actor_.slot.bursts_halted;
    } catch (const o80::RowOverwritten&) {
      // others were faster
    } catch (const o80::Error& error) {
      if (!is_refusal(error)) throw;
      actor_.pause(kMillisecond);  // one of them may stand still
    }
    for (Sender* sender : both) {
      sender->settle();
      if (actor_.chance.percent(20)) resume(actor_, sender->frontend(), call_began_);
    }
  }

  void burst_at_once(const Both& both, std::array<Verifier, 2>& verifiers) {
    const std::array<std::pair<o80::UntypedFrontend*, std::int64_t>, 2> wanted{
        {{&both[0]->frontend(), actor_.chance.between(1, 8)},
         {&both[1]->frontend(), actor_.chance.between(1, 8)}}};
    const auto timeout = actor_.some_timeout();
    const auto rows =
        actor_.timed("burst of two", timeout, [&] { return o80::burst(wanted, timeout); });
    for (std::size_t i = 0; i < 2; ++i) verifiers[i].verify(rows[i]);
  }

  /// Grants to both, then waits for both, all of it in the ledger.
  void burst_with_commands(const Both& both, std::array<Verifier, 2>& verifiers) {
    std::array<std::optional<o80::Burst>, 2> bursts;
    for (std::size_t i = 0; i < 2; ++i) {
      both[i]->begin();
      if (both[i]->open_commands() < 60) both[i]->add_some();
      bursts[i] = both[i]->burst(actor_.chance.between(1, 8));
    }
    for (std::size_t i = 0; i < 2; ++i)
      if (bursts[i]) await(actor_, *both[i], *bursts[i], verifiers[i]);
  }

  Actor& actor_;
  std::int64_t call_began_ = 0;
};

}  // namespace

void be_a_burster(Actor& actor) { Burster(actor).run(); }

void be_a_group_burster(Actor& actor) { GroupBurster(actor).run(); }

}  // namespace torture
