#include "torture/journal_audit.hpp"

#include <map>
#include <utility>

#include "control/batch/record.hpp"
#include "o80/runtime/journal.hpp"

namespace torture {

namespace {

using o80::JournalEntry;
using o80::JournalKind;
using o80::Status;

class JournalAudit {
 public:
  JournalAudit(Actor& actor, std::uint32_t generation) : actor_(actor), generation_(generation) {}

  void read(const o80::UntypedFrontend& frontend) {
    o80::Journal journal(frontend);
    for (JournalEntry entry; journal.next(entry);) {
      missed_ = missed_ || entry.missed > 0;
      note(entry);
    }
  }

  void compare(const Slot& slot) {
    for (const SentBatch& batch : slot.sent()) {
      if (batch.generation != generation_ || batch.lane == kNoLane ||
          batch.sent != static_cast<std::uint32_t>(Sent::sent))
        continue;
      compare(batch);
      for (std::uint32_t k = 0; k < batch.commands; ++k)
        compare(batch, k, slot.sent_commands[batch.first_command + k]);
    }
  }

 private:
  using Key = std::pair<std::uint32_t, std::uint64_t>;  // lane and id
  struct End {
    Status status;
    std::int64_t iteration;
  };

  void fail(Fault fault, const Key& key, const char* what) {
    actor_.fail(fault, "journal of generation %u, id %llu of lane %u: %s", generation_,
                static_cast<unsigned long long>(key.second), key.first, what);
  }

  void note(const JournalEntry& entry) {
    const Key key{entry.lane, entry.id};
    const bool taken = entry.kind == JournalKind::taken;
    if (taken || entry.kind == JournalKind::rejected) {
      if (!decided_.emplace(key, taken ? entry.iteration : -1).second)
        fail(Fault::doubled, key, "the batch was decided on twice");
      if (!missed_ && entry.records_lost) fail(Fault::lost, key, "its records are not there");
      if (!entry.records_lost) seen_[key] = entry.seen ? entry.seen->iteration + 1 : 0;
    }
    if (entry.kind == JournalKind::status && o80::is_end(entry.status)) {
      if (!ends_.emplace(key, End{entry.status, entry.iteration}).second)
        fail(Fault::doubled, key, "it ended twice");
    }
  }

  void compare(const SentBatch& batch) {
    const Key key{batch.lane, batch.id};
    const auto seen = seen_.find(key);
    if (seen != seen_.end() && seen->second != batch.seen)
      fail(Fault::falsely_told, key, "it was decided by another row");
    if (batch.taken < 0) return;
    const auto found = decided_.find(key);
    if (found == decided_.end()) {
      if (!missed_) fail(Fault::lost, key, "it was taken, and the journal does not say so");
    } else if (found->second != batch.taken) {
      fail(Fault::falsely_told, key, "its sender was told of another iteration");
    }
  }

  void compare(const SentBatch& batch, std::uint32_t place, const SentCommand& command) {
    const auto status = static_cast<Status>(command.found);
    // an end of a whole batch has no entry of its own
    if (status != Status::completed) return;
    const Key key{batch.lane, o80::record_id(batch.id, place)};
    const auto found = ends_.find(key);
    if (found == ends_.end()) {
      // of requests and purges the feedback is written first: a kill may come between
      const bool moves = command.kind == SentKind::command || command.kind == SentKind::group;
      const bool was_killed = actor_.round.lives[generation_].doomed_at != 0;
      if (!missed_ && (moves || !was_killed))
        fail(Fault::lost, key, "it ended, and the journal does not say so");
    } else if (found->second.status != status || found->second.iteration != command.found_at) {
      fail(Fault::falsely_told, key, "it ended otherwise than the feedback says");
    }
  }

  Actor& actor_;
  std::uint32_t generation_;
  bool missed_ = false;
  std::map<Key, std::int64_t> decided_;  // the iteration; -1: rejected
  std::map<Key, End> ends_;
  std::map<Key, std::int64_t> seen_;  // one more than the row; 0: none
};

}  // namespace

void audit_journal(Actor& actor, const o80::UntypedFrontend& frontend, std::uint32_t generation) {
  JournalAudit audit(actor, generation);
  audit.read(frontend);
  for (const Slot& slot : actor.round.slots) audit.compare(slot);
}

}  // namespace torture
