#include <array>
#include <list>
#include <map>
#include <string_view>

#include "runtime/frontend/link.hpp"
#include "torture/actor.hpp"
#include "torture/journal_audit.hpp"

namespace torture {

namespace {

/// One backend whose segment is kept open, however it ended.
struct Kept {
  o80::UntypedFrontend frontend;
  std::uint32_t generation;
};

/// Keeps the segments of all backends of a round, and at its end reads there what became of every
/// command, also of those whose senders are dead.
class Auditor {
 public:
  Auditor(Actor& actor, std::uint32_t segments) : actor_(actor), segments_(segments) {}

  void run() {
    while (static_cast<std::uint32_t>(actor_.phase()) < static_cast<std::uint32_t>(Phase::audit)) {
      for (std::uint32_t i = 0; i < segments_; ++i) audit_segment(i);
      actor_.pause(kMillisecond);
    }
    for (std::uint32_t i = 0; i < segments_; ++i) audit_segment(i);
    for (Kept& kept : kept_) {
      if (kept.frontend.life() == o80::Life::running) drain(kept);
    }
    for (Kept& kept : kept_) {
      audit(kept);
      audit_journal(actor_, kept.frontend, kept.generation);
    }
  }

 private:
  void audit_segment(std::uint32_t segment) {
    try {
      // a peek first: the newest of that name is known already
      const std::uint64_t epoch = epoch_of(segment_name(segment));
      if (epoch == 0 || epoch == epochs_[segment]) return;
      const o80::FrontendOptions options{.timeout = std::chrono::nanoseconds(0), .dead = true};
      o80::UntypedFrontend frontend(segment_name(segment), options);
      epochs_[segment] = frontend.epoch();
      const Generation* life = actor_.life_of(frontend.epoch());
      if (life == nullptr) return;  // killed before it ran
      const auto number = static_cast<std::uint32_t>(life - actor_.round.lives.data());
      kept_.push_back({std::move(frontend), number});
    } catch (const o80::TimeoutError&) {
      // it is still starting
    }
  }

  /// Lets all that was sent come to its end.
  void drain(Kept& kept) {
    Generation& life = actor_.round.lives[kept.generation];
    o80::UntypedFrontend& frontend = kept.frontend;
    try {
      if (frontend.bursting()) {
        burst_until_drained(kept);
      } else {
        be_heard(frontend);
        while (!drained(frontend))
          frontend.wait_for(frontend.published() + 10, std::chrono::seconds(10));
      }
      life.drained = 1;
    } catch (const o80::BackendGone&) {
      if (life.doomed_at == 0 && life.ending_at == 0)
        actor_.fail(Fault::false_death, "generation %u was given up by the auditor",
                    kept.generation);
    } catch (const o80::TimeoutError& error) {
      actor_.fail(Fault::hang, "generation %u could not be drained: %s", kept.generation,
                  error.what());
    } catch (const o80::RowOverwritten&) {
      return drain(kept);
    }
  }

  /// The dead hold nothing for long: neither lanes nor control.
  void be_heard(o80::UntypedFrontend& frontend) {
    actor_.slot.call = "pulse of the auditor";
    const std::int64_t began = o80::monotonic_now();
    std::string refusal;
    while (o80::monotonic_now() - began < 10'000 * kMillisecond) {
      try {
        frontend.add_purge_own();
        frontend.pulse().wait(std::chrono::seconds(10));
        return;
      } catch (const o80::Error& error) {
        if (!is_refusal(error)) throw;
        frontend.forget_added();
        refusal = error.what();
      }
      actor_.pause(kMillisecond);
    }
    actor_.fail(Fault::hang, "nobody is heard after the dead: %s", refusal.c_str());
  }

  /// A lane takes a burst however full it is of what the dead have sent, unless that is bursts, and
  /// these end.
  void burst_until_drained(Kept& kept) {
    actor_.slot.call = "burst of the auditor";
    std::int64_t refused_since = 0;
    while (!drained(kept.frontend)) {
      try {
        kept.frontend.burst(100, std::chrono::seconds(10));
        refused_since = 0;
      } catch (const o80::BackendHalted&) {
        // a commander died meanwhile, say: bursts are served all the same
      } catch (const o80::Error& error) {
        if (!is_refusal(error)) throw;
        if (refused_since == 0) refused_since = o80::monotonic_now();
        if (o80::monotonic_now() - refused_since > 10'000 * kMillisecond)
          actor_.fail(Fault::hang, "nobody is heard after the dead: %s", error.what());
        actor_.pause(kMillisecond);
      }
    }
  }

  /// Nothing is under way for longer than anything is sent ahead of its time.
  bool drained(const o80::UntypedFrontend& frontend) {
    constexpr o80::Iteration kAhead = 120;
    const o80::UntypedObservation row = frontend.latest();
    const bool active = row.active(0) || row.active(1);
    Quiet& quiet = quiet_[&frontend];
    if (active || quiet.since < 0) quiet.since = row.iteration();
    return !active && row.iteration() - quiet.since > kAhead;
  }

  void audit(Kept& kept) {
    for (Slot& slot : actor_.round.slots) {
      for (const SentBatch& batch : slot.sent()) {
        if (batch.generation != kept.generation ||
            batch.sent != static_cast<std::uint32_t>(Sent::sent) || batch.lane == kNoLane)
          continue;
        for (std::uint32_t k = 0; k < batch.commands; ++k)
          audit(kept, batch, k, slot.sent_commands[batch.first_command + k]);
      }
    }
  }

  void audit(Kept& kept, const SentBatch& batch, std::uint32_t place, SentCommand& command) {
    const o80::SegmentView& view = kept.frontend.link()->segment.view();
    const std::uint64_t id = o80::record_id(batch.id, place);
    const o80::StatusSlot& status =
        view.statuses(batch.lane)[id & (2 * std::uint64_t{view.shape.lane_blocks} - 1)];
    const std::uint64_t owner = status.id.load();
    const std::uint64_t packed = status.word.load();
    const o80::StatusWord word = o80::StatusWord::unpack(packed);
    // its backend died before the place had its next id
    const bool announced = word.status == 0 && packed > o80::StatusWord::announcing(id);
    command.found_id = owner;
    if (owner > id || (owner == id && announced)) {
      command.found = static_cast<std::uint32_t>(o80::Status::forgotten);
    } else if (owner == id && word.status != 0) {
      command.found_at = word.iteration;
      command.found_reason = word.reason;
      command.found = word.status;
    } else {
      command.found = static_cast<std::uint32_t>(o80::Status::queued);
    }
  }

  struct Quiet {
    o80::Iteration since = -1;
  };

  Actor& actor_;
  std::uint32_t segments_;
  std::list<Kept> kept_;
  std::map<const void*, Quiet> quiet_;
  std::array<std::uint64_t, 4> epochs_{};
};

}  // namespace

void be_an_auditor(Actor& actor, std::uint32_t segments) { Auditor(actor, segments).run(); }

}  // namespace torture
