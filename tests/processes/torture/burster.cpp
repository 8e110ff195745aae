#include <optional>

#include "torture/sender.hpp"
#include "torture/verify.hpp"

namespace torture {

namespace {

class Burster {
 public:
  explicit Burster(Actor& actor) : actor_(actor) {}

  void run() {
    while (actor_.acting()) {
      const auto timeout = actor_.some_timeout();
      try {
        Sender sender(actor_, actor_.timed("attach", timeout, [&] {
          return o80::UntypedFrontend(segment_name(actor_.slot.segment), {.timeout = timeout});
        }));
        serve(sender);
      } catch (const o80::TimeoutError&) {
        // nobody is there yet
      }
      if (actor_.slot.batches + 8 >= kMostBatches || actor_.slot.commands + 128 >= kMostCommands)
        return;
    }
  }

 private:
  void serve(Sender& sender) {
    Verifier verifier(actor_, sender.frontend());
    try {
      while (actor_.acting() && sender.has_room()) burst(sender, verifier);
    } catch (const o80::BackendGone& error) {
      actor_.judge_gone(sender.life(), error, call_began_);
    }
    sender.settle_all();
    sender.close();
  }

  void burst(Sender& sender, Verifier& verifier) {
    const std::int64_t stopped = actor_.stopped();
    call_began_ = o80::monotonic_now();
    if (sender.open_commands() < 60) sender.add_some();
    if (actor_.chance.percent(20)) sender.pulse();
    const std::int64_t n = actor_.chance.percent(20) ? 0 : actor_.chance.between(1, 12);
    const std::optional<o80::Burst> burst = sender.burst(n);
    if (burst && sender.open() > 0 && sender.last().id() == burst->batch().id())
      wait(sender, *burst, verifier, stopped);
    sender.settle();
    if (actor_.chance.percent(50)) actor_.pause(actor_.chance.between(0, 2) * kMillisecond);
  }

  void wait(Sender& sender, const o80::Burst& burst, Verifier& verifier, std::int64_t stopped) {
    const auto timeout = actor_.some_timeout();
    try {
      const o80::Iteration row =
          actor_.timed("burst.wait", timeout, [&] { return burst.wait_done(timeout); });
      if (row < 0) return;
      sender.entry().burst_row = row;
      const o80::Rows rows = sender.frontend().history(row, row);
      if (rows.count == 1) verifier.verify(rows.row(0).data(), row);
      if (rows.count == 0 && sender.frontend().published() < row)
        actor_.fail(Fault::falsely_told, "a burst ended with row %ld, which is not there",
                    static_cast<long>(row));
    } catch (const o80::TimeoutError&) {
      actor_.judge_timeout(sender.life(), call_began_, stopped);
    } catch (const o80::RowOverwritten&) {
      // forgotten: others did many bursts since
    }
  }

  Actor& actor_;
  std::int64_t call_began_ = 0;
};

/// Bursts two backends at once.
void burst_both(Actor& actor, std::array<std::optional<o80::UntypedFrontend>, 2>& both) {
  std::int64_t call_began = 0;
  std::array<Generation*, 2> lives{};
  for (std::uint32_t i = 0; i < 2; ++i) {
    const auto timeout = actor.some_timeout();
    both[i].emplace(actor.timed("attach", timeout, [&] {
      return o80::UntypedFrontend(segment_name(i), {.timeout = timeout});
    }));
    lives[i] = &actor.life_of(*both[i]);
  }
  std::array verifiers{Verifier(actor, *both[0]), Verifier(actor, *both[1])};
  while (actor.acting()) {
    const std::array<std::pair<o80::UntypedFrontend*, std::int64_t>, 2> wanted{
        {{&*both[0], actor.chance.between(1, 8)}, {&*both[1], actor.chance.between(1, 8)}}};
    const auto timeout = actor.some_timeout();
    const std::int64_t stopped = actor.stopped();
    call_began = o80::monotonic_now();
    try {
      const auto rows =
          actor.timed("burst of two", timeout, [&] { return o80::burst(wanted, timeout); });
      for (std::size_t i = 0; i < 2; ++i) verifiers[i].verify(rows[i]);
    } catch (const o80::TimeoutError&) {
      for (Generation* life : lives) actor.judge_timeout(*life, call_began, stopped);
    } catch (const o80::RowOverwritten&) {
      // others were faster
    } catch (const o80::LaneFull&) {
      // one of them stands still
      actor.pause(kMillisecond);
    } catch (const o80::NoLane&) {
      actor.pause(kMillisecond);
    } catch (const o80::BackendGone& error) {
      const bool second = std::string(error.what()).find(segment_name(1)) != std::string::npos;
      actor.judge_gone(*lives[second ? 1 : 0], error, call_began);
      return;
    } catch (const o80::Error& error) {
      if (std::string(error.what()).find("exclusive") == std::string::npos) throw;
    }
  }
}

}  // namespace

void be_a_burster(Actor& actor) { Burster(actor).run(); }

void be_a_group_burster(Actor& actor) {
  while (actor.acting()) {
    std::array<std::optional<o80::UntypedFrontend>, 2> both;
    try {
      burst_both(actor, both);
    } catch (const o80::TimeoutError&) {
      // one of them is not there yet
    }
  }
}

}  // namespace torture
