#include "runtime/journal/recorded_decisions.hpp"

#include <algorithm>

#include "base/printable.hpp"
#include "control/batch/record.hpp"
#include "o80/base/error.hpp"
#include "o80/describe/describe.hpp"

namespace o80 {

namespace {

/// True for the entries that a replay obeys or compares. The others follow from them.
bool is_obeyed(JournalKind kind) {
  switch (kind) {
    case JournalKind::taken:
    case JournalKind::rejected:
    case JournalKind::halt:
    case JournalKind::resume:
    case JournalKind::burst:
    case JournalKind::died:
    case JournalKind::silent:
    case JournalKind::interrupted:
    case JournalKind::fresh_start:
    case JournalKind::order_lost:
    case JournalKind::stopping:
      return true;
    default:
      return false;
  }
}

std::string halt_text(HaltCause cause, std::string_view text) {
  return std::string(to_text(cause)) + ": " + std::string(text);
}

/// True for halts that a replay repeats by itself.
bool is_repeated(HaltCause cause) {
  return cause == HaltCause::driver || cause == HaltCause::error;
}

[[noreturn]] void refuse_entry(const JournalEntry& entry, const std::string& why) {
  throw InvalidArgument("entry " + std::to_string(entry.number) + " of the journal " + why);
}

/// Throws if these are not the blocks of a whole batch.
void check_blocks(const JournalEntry& entry) {
  if (entry.blocks.size() < kBlockBytes) refuse_entry(entry, "lacks the blocks of its batch");
  const auto batch = unpack<BatchRecord>(entry.blocks.data());
  const bool is_whole = batch.kind == RecordKind::batch &&
                        std::uint64_t{batch.blocks} * kBlockBytes == entry.blocks.size();
  if (!is_whole) refuse_entry(entry, "holds a damaged batch");
}

/// Throws for an entry that no backend of this robot, with so many lanes, writes.
void check_recorded(const JournalEntry& entry, const Schema& schema, std::uint32_t lanes) {
  const bool is_batch = entry.kind == JournalKind::taken || entry.kind == JournalKind::rejected;
  const bool is_of_lane = is_batch || entry.kind == JournalKind::died ||
                          entry.kind == JournalKind::silent ||
                          entry.kind == JournalKind::fresh_start;
  if (is_of_lane && entry.lane >= lanes) {
    refuse_entry(entry, "is of lane " + std::to_string(entry.lane) + ", but the robot has " +
                            std::to_string(lanes) +
                            " lanes: give the option lanes of the recorded run");
  }
  if (is_batch) check_blocks(entry);
  if (entry.kind == JournalKind::interrupted && entry.actuator >= schema.actuators.size()) {
    refuse_entry(entry, "interrupts an actuator that the robot does not have");
  }
}

}  // namespace

void RecordedDecisions::add(const JournalEntry& entry, const Schema& schema, std::uint32_t lanes) {
  check_recorded(entry, schema, lanes);
  if (!has_driver()) note_requests(entry);
  if (is_obeyed(entry.kind)) entries_.push_back(entry);
}

/// Keeps the iterations in which requests were served.
void RecordedDecisions::note_requests(const JournalEntry& entry) {
  if (entry.kind == JournalKind::status) {
    const auto sent = requests_.find({entry.lane, entry.id});
    if (sent != requests_.end() && sent->second.iteration < 0)
      sent->second.iteration = entry.iteration;
  } else if (entry.kind == JournalKind::taken) {
    CommandId next = 0;
    for (auto record = entry.records.rbegin(); record != entry.records.rend(); ++record) {
      if (record->kind != JournalRecord::Kind::request) continue;
      requests_[{entry.lane, record->id}] = {.next = next};
      next = record->id;
    }
  }
}

void RecordedDecisions::set_times(Iteration first, std::span<const std::int64_t> times) {
  first_time_ = first;
  times_.assign(times.begin(), times.end());
}

std::int64_t RecordedDecisions::time(Iteration iteration) const noexcept {
  if (times_.empty()) return 0;
  const auto last = static_cast<Iteration>(times_.size()) - 1;
  return times_[static_cast<std::size_t>(std::clamp<Iteration>(iteration - first_time_, 0, last))];
}

const JournalEntry* RecordedDecisions::next(Iteration iteration) const noexcept {
  const bool is_due = !entries_.empty() && entries_.front().iteration <= iteration;
  return is_due ? &entries_.front() : nullptr;
}

JournalEntry RecordedDecisions::take() {
  JournalEntry entry = std::move(entries_.front());
  entries_.pop_front();
  stops_ = stops_ || entry.kind == JournalKind::stopping;
  return entry;
}

bool RecordedDecisions::confirms(JournalKind kind) {
  if (entries_.empty() || entries_.front().kind != kind) return false;
  entries_.pop_front();
  return true;
}

bool RecordedDecisions::made_fresh_start(Iteration iteration, std::uint32_t lane,
                                         CommandId request) noexcept {
  const auto found = requests_.find({lane, request});
  const CommandId following = found == requests_.end() ? 0 : found->second.next;
  if (found != requests_.end()) requests_.erase(found);
  const JournalEntry* entry = next(iteration);
  const bool is_due = entry != nullptr && entry->kind == JournalKind::fresh_start &&
                      entry->iteration == iteration && entry->lane == lane;
  if (!is_due) return false;
  // a fresh start increases the iteration: with several requests in the batch, it is of the last
  // one that was served in this iteration
  const auto after = requests_.find({lane, following});
  return after == requests_.end() || after->second.iteration != iteration;
}

bool RecordedDecisions::begins_with_fresh_start(Iteration iteration) const noexcept {
  for (const JournalEntry& entry : entries_) {
    if (entry.iteration > iteration) return false;
    if (entry.kind == JournalKind::fresh_start) return true;
    if (entry.kind == JournalKind::taken || entry.kind == JournalKind::rejected) return false;
  }
  return false;
}

std::optional<std::uint16_t> RecordedDecisions::interrupt_due(Iteration iteration,
                                                              bool before_step) const noexcept {
  const JournalEntry* entry = next(iteration);
  const bool is_due = entry != nullptr && entry->kind == JournalKind::interrupted &&
                      entry->iteration == iteration && entry->before_step == before_step;
  return is_due ? std::optional(entry->actuator) : std::nullopt;
}

void RecordedDecisions::fresh_start(Iteration iteration) {
  if (!confirms(JournalKind::fresh_start)) note(iteration, "fresh start", "no", "yes");
}

void RecordedDecisions::interrupt(Iteration iteration, std::uint16_t actuator,
                                  std::string_view name) {
  const JournalEntry* entry = next(iteration);
  const bool same = entry != nullptr && entry->kind == JournalKind::interrupted &&
                    entry->iteration == iteration && entry->actuator == actuator;
  if (same) {
    entries_.pop_front();
  } else {
    note(iteration, "interrupt of " + std::string(name), "no", "yes");
  }
}

void RecordedDecisions::ask_to_halt(HaltCause cause, std::string_view text) {
  std::string kept(sizeof(Halt::text) - 1, '\0');  // as much as a segment keeps of it
  kept.resize(printable(text, kept.data(), kept.size()));
  requested_.push_back({cause, std::move(kept)});
}

void RecordedDecisions::compare_halt(const JournalEntry& halt) {
  const auto same = [&](const RequestedHalt& requested) {
    return requested.cause == halt.cause && requested.text == halt.text;
  };
  const bool repeats = is_repeated(halt.cause) && (has_driver() || halt.cause != HaltCause::driver);
  if (repeats && std::ranges::none_of(requested_, same)) {
    note(halt.iteration, "halt", halt_text(halt.cause, halt.text),
         requested_.empty() ? "none" : halt_text(requested_[0].cause, requested_[0].text));
  }
  requested_.clear();
}

void RecordedDecisions::end_decisions(Iteration iteration) {
  if (stops_) requested_.clear();  // the recorded backend did not poll halts any more
  if (requested_.empty()) return;
  note(iteration, "halt", "none", halt_text(requested_[0].cause, requested_[0].text));
  requested_.clear();
}

void RecordedDecisions::not_repeated(const JournalEntry& entry) {
  note(entry.iteration, std::string(to_text(entry.kind)), "yes", "no");
}

void RecordedDecisions::note(Iteration iteration, std::string decision, std::string recorded,
                             std::string replayed) {
  if (mismatch_) return;
  mismatch_ = {iteration, std::move(decision), std::move(recorded), std::move(replayed)};
}

}  // namespace o80
