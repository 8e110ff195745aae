#include "torture/judge.hpp"

#include <algorithm>
#include <bit>
#include <cstdio>
#include <map>

#include "control/batch/record.hpp"
#include "control/receiving/status_sink.hpp"

namespace torture {

namespace {

using o80::Status;

/// A straight line takes up to 20 iterations.
constexpr std::int64_t kLongestStop = 40;
constexpr std::int64_t kShortStop = 4;

struct Done {
  std::uint64_t value;
  std::int64_t iteration;  // the last one, if it stood there
  std::uint32_t actuator;
  std::int64_t first;
};

/// Of several visits to a place, the one at this iteration: within limits of acceleration, places
/// of the way there and back may be the same.
void keep_at(std::int64_t iteration, std::vector<Done>& done) {
  std::erase_if(
      done, [&](const Done& each) { return iteration < each.first || iteration > each.iteration; });
  for (Done& each : done) each.iteration = iteration;
}

/// What a driver did, by value.
class Deeds {
 public:
  explicit Deeds(const Generation& life) {
    for (std::int64_t k = 0; const JournalRow& row : life.seen()) {
      for (std::uint32_t i = 0; i < kActuators; ++i)
        if ((row.active >> i & 1) != 0)
          done_.push_back({std::bit_cast<std::uint64_t>(row.desired[i]), k, i, k});
      ++k;
    }
    for (std::uint32_t i = 0; i < life.served; ++i) {
      const ServedRequest& request = life.requests[i];
      done_.push_back({request.mark, request.iteration, 0, request.iteration});
      fresh_start_ = fresh_start_ || request.mark >> 63 != 0;
    }
    std::stable_sort(done_.begin(), done_.end(),
                     [](const Done& a, const Done& b) { return a.value < b.value; });
  }
  std::vector<Done> of(const SentCommand& command) const {
    std::vector<Done> found;
    auto i =
        std::lower_bound(done_.begin(), done_.end(), command.value,
                         [](const Done& done, std::uint64_t value) { return done.value < value; });
    for (; i != done_.end() && i->value == command.value; ++i) {
      if (i->actuator != command.actuator) continue;
      // a minimum jerk that fades out on its target stands there until its last iteration
      if (!found.empty() && found.back().iteration + 1 == i->iteration) {
        found.back().iteration = i->iteration;
      } else {
        found.push_back(*i);
      }
    }
    return found;
  }
  bool fresh_start() const { return fresh_start_; }

 private:
  std::vector<Done> done_;  // by value
  bool fresh_start_ = false;
};

bool has_ended(std::uint32_t status) {
  const auto known = static_cast<Status>(status);
  return known != Status::forgotten && o80::is_end(known);
}

std::string name_of(Status status) { return std::string(o80::to_text(status)); }

class Judge {
 public:
  explicit Judge(const Round& round) : round_(round) {}

  std::vector<Failure> judge() {
    for (const Slot& slot : round_.slots)
      for (const SentBatch& batch : slot.sent()) judge(slot, batch);
    for (const Slot& slot : round_.slots) {
      judge_order(slot);
      judge_control(slot);
      judge_stop(slot);
    }
    for (const Generation& life : round_.lives) judge_limits(life);
    for (auto& [generation, bursts] : bursts_) judge_bursts(generation, bursts);
    judge_halts(round_, failures_);
    return std::move(failures_);
  }

 private:
  const Deeds& deeds(std::uint32_t generation) {
    const auto known = deeds_.find(generation);
    if (known != deeds_.end()) return known->second;
    return deeds_.emplace(generation, Deeds(round_.lives[generation])).first->second;
  }

  void add(Fault fault, const Slot& slot, const SentBatch& batch, const SentCommand& command,
           const std::string& what) {
    const auto number = &slot - round_.slots.data();
    failures_.push_back(
        {fault, "command " + std::to_string(&command - slot.sent_commands.data()) + " of actor " +
                    std::to_string(number) + " (" + torture::name_of(slot.role) + "), batch " +
                    std::to_string(batch.id) + " in lane " + std::to_string(batch.lane) +
                    " of generation " + std::to_string(batch.generation) + ", told " +
                    name_of(static_cast<Status>(command.told)) + " at " +
                    std::to_string(command.told_at) + ", found " +
                    name_of(static_cast<Status>(command.found)) + " at " +
                    std::to_string(command.found_at) + ": " + what});
  }

  void judge(const Slot& slot, const SentBatch& batch) {
    for (const SentCommand& command : slot.sent_in(batch)) judge(slot, batch, command);
    if (batch.burst > 0 && batch.burst_row >= 0) {
      const std::int64_t begun = batch.burst_row - batch.burst + 1;
      bursts_[batch.generation].emplace_back(begun, batch.burst_row);
      if (batch.commands > 0 && batch.taken >= 0 && batch.taken != begun &&
          !deeds(batch.generation).fresh_start())
        add(Fault::falsely_told, slot, batch, slot.sent_commands[batch.first_command],
            "its burst began at " + std::to_string(begun) + ", taken at " +
                std::to_string(batch.taken));
    }
    if (batch.at < 0 || batch.taken < 0 || batch.commands == 0) return;
    const SentCommand& first = slot.sent_commands[batch.first_command];
    if (static_cast<Status>(first.told) == Status::rejected) return;
    const bool late =
        batch.taken > batch.at && batch.late_now == 0 && !deeds(batch.generation).fresh_start();
    if (batch.taken < batch.at || late)
      add(Fault::falsely_told, slot, batch, first,
          "sent for iteration " + std::to_string(batch.at) + ", taken at " +
              std::to_string(batch.taken));
  }

  void judge(const Slot& slot, const SentBatch& batch, const SentCommand& command) {
    const SentKind kind = command.kind;
    if (kind == SentKind::group) return judge_group(slot, batch, command);
    if (kind != SentKind::command && kind != SentKind::mark && kind != SentKind::look) return;
    const Generation& life = round_.lives[batch.generation];
    std::vector<Done> done = deeds(batch.generation).of(command);
    const std::int64_t end = has_ended(command.told) ? command.told_at : command.found_at;
    if (is_limited(batch, command)) keep_at(end, done);
    const auto sent = static_cast<Sent>(batch.sent.load());
    if (done.size() > 1)
      return add(Fault::doubled, slot, batch, command,
                 "done at " + std::to_string(done[0].iteration) + " and " +
                     std::to_string(done[1].iteration) + around(life, done[1]));
    if (sent == Sent::refused && !done.empty())
      return add(Fault::falsely_told, slot, batch, command, "refused, and done all the same");
    if (sent != Sent::sent) return;
    if (has_ended(command.told) && has_ended(command.found) &&
        (command.told != command.found || command.told_at != command.found_at))
      return add(Fault::falsely_told, slot, batch, command, "its end changed");

    const bool told = has_ended(command.told);
    if (told || has_ended(command.found)) {
      const auto status = static_cast<Status>(told ? command.told : command.found);
      const std::int64_t at = told ? command.told_at : command.found_at;
      return judge_end(slot, batch, command, status, at, done);
    }
    if (static_cast<Status>(command.found) == Status::forgotten || batch.lane == kNoLane) return;
    if (life.drained != 0) return add(Fault::lost, slot, batch, command, "it never ended");
    if (command.found != 0 && done.size() == 1 && done[0].iteration + 1 < life.rows)
      add(Fault::falsely_told, slot, batch, command,
          "done at " + std::to_string(done[0].iteration) + ", and nobody was told" +
              told_of(slot, batch));
  }

  /// One member of a group, as if it had been sent by itself.
  static SentCommand member_of(const SentCommand& group, std::uint32_t actuator) {
    SentCommand member = group;
    member.kind = SentKind::command;
    member.value = group.targets[actuator];
    member.actuator = actuator;
    return member;
  }

  /// Members that the driver saw do not come twice, and a group that is completed is completed as a
  /// whole, in one iteration. Where it ended otherwise, some members may have arrived before.
  void judge_group(const Slot& slot, const SentBatch& batch, const SentCommand& group) {
    const auto sent = static_cast<Sent>(batch.sent.load());
    const bool told = has_ended(group.told);
    const auto status = static_cast<Status>(told ? group.told : group.found);
    const std::int64_t at = told ? group.told_at : group.found_at;
    if (sent == Sent::sent && told && has_ended(group.found) &&
        (group.told != group.found || group.told_at != group.found_at))
      return add(Fault::falsely_told, slot, batch, group, "its end changed");
    const bool ended = told || has_ended(group.found);
    for (std::uint32_t i = 0; i < kActuators; ++i) {
      const SentCommand member = member_of(group, i);
      std::vector<Done> done = deeds(batch.generation).of(member);
      if (is_limited(batch, member)) keep_at(at, done);
      const std::string name = "member " + std::to_string(i) + " of a group: ";
      if (done.size() > 1)
        return add(Fault::doubled, slot, batch, group,
                   name + "done at " + std::to_string(done[0].iteration) + " and " +
                       std::to_string(done[1].iteration));
      if (!done.empty() && (sent == Sent::refused || (ended && status == Status::rejected)))
        return add(Fault::falsely_told, slot, batch, group, name + "refused, and done");
      if (sent != Sent::sent || !ended) continue;
      if (status == Status::completed && (done.empty() || done[0].iteration != at))
        return add(
            Fault::falsely_told, slot, batch, group,
            name + (done.empty() ? "never done" : "done at " + std::to_string(done[0].iteration)));
      // a smooth successor may stop where a straight line would have ended (judge_end)
      if (!done.empty() &&
          done[0].iteration > at + (status == Status::overwritten ? kLongestStop : 0))
        return add(Fault::falsely_told, slot, batch, group,
                   name + "done at " + std::to_string(done[0].iteration) + ", after the end");
    }
    const Generation& life = round_.lives[batch.generation];
    const bool forgotten = static_cast<Status>(group.found) == Status::forgotten;
    if (sent == Sent::sent && !ended && !forgotten && batch.lane != kNoLane && life.drained != 0)
      add(Fault::lost, slot, batch, group, "it never ended");
  }

  bool is_limited(const SentBatch& batch, const SentCommand& command) const {
    return round_.lives[batch.generation].limited != 0 && command.actuator == kLimited &&
           command.kind == SentKind::command;
  }

  /// The actuator in the rows around, for who wonders.
  static std::string around(const Generation& life, const Done& done) {
    std::string text;
    const std::int64_t last =
        std::min<std::int64_t>({life.rows - 1, kMaxRows - 1, done.iteration + 2});
    for (std::int64_t k = std::max<std::int64_t>(0, done.iteration - 4); k <= last; ++k) {
      const JournalRow& row = life.journal[static_cast<std::size_t>(k)];
      char line[80];
      std::snprintf(line, sizeof line, "\n    row %ld: %s, %a", static_cast<long>(k),
                    (row.active >> done.actuator & 1) != 0 ? "active" : "idle",
                    row.desired[done.actuator]);
      text += line;
    }
    return text;
  }

  /// What became of all of a batch, for who wonders.
  std::string told_of(const Slot& slot, const SentBatch& batch) {
    std::string text = "; taken at " + std::to_string(batch.taken) + ", sent at " +
                       std::to_string(batch.sent_at) + ", sender doomed at " +
                       std::to_string(slot.doomed_at.load()) + ":";
    for (std::uint32_t i = 0; i < batch.commands; ++i) {
      const SentCommand& command = slot.sent_commands[batch.first_command + i];
      text += "\n    record " + std::to_string(o80::record_id(batch.id, i)) + ", kind " +
              std::to_string(static_cast<int>(command.kind)) + ": found " +
              name_of(static_cast<Status>(command.found)) + " at " +
              std::to_string(command.found_at) + ", in the place of " +
              std::to_string(command.found_id) + "; done at";
      for (const Done& done : deeds(batch.generation).of(command))
        text += " " + std::to_string(done.iteration);
    }
    return text;
  }

  void judge_end(const Slot& slot, const SentBatch& batch, const SentCommand& command,
                 Status status, std::int64_t at, const std::vector<Done>& done) {
    if (status == Status::completed) {
      if (done.empty())
        return add(Fault::falsely_told, slot, batch, command,
                   "never done; the driver saw " +
                       std::to_string(round_.lives[batch.generation].rows) + " rows" +
                       around(round_.lives[batch.generation], {0, at, command.actuator, at}) +
                       told_of(slot, batch));
      if (command.kind == SentKind::command && done[0].iteration != at)
        add(Fault::falsely_told, slot, batch, command,
            "done at " + std::to_string(done[0].iteration));
      return;
    }
    // within limits of acceleration a motion may rest on its target before its last iteration; a
    // smooth motion that overwrites a straight line may stop where that would have ended: in twice
    // as many iterations as it had left. So may one that begins where a line was purged, which is
    // told apart from a purge that did nothing only shortly before the line's end
    const std::int64_t longest = status == Status::overwritten ? kLongestStop
                                 : status == Status::purged    ? kShortStop
                                                               : 0;
    const bool stops_there = !done.empty() && done[0].iteration < at + longest;
    const bool early = command.arrives_early != 0 || is_limited(batch, command) || stops_there;
    if (!done.empty() && !early)
      add(Fault::falsely_told, slot, batch, command,
          "done at " + std::to_string(done[0].iteration) + " all the same" +
              around(round_.lives[batch.generation], done[0]) + told_of(slot, batch));
  }

  /// What one sender sent for one actuator is done in the order in which it was sent.
  void judge_order(const Slot& slot) {
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::int64_t> last;
    for (const SentBatch& batch : slot.sent()) {
      if (batch.at >= 0) continue;
      for (const SentCommand& command : slot.sent_in(batch)) {
        const bool is_group = command.kind == SentKind::group;
        if ((command.kind != SentKind::command && !is_group) ||
            static_cast<Status>(command.told) != Status::completed)
          continue;
        for (std::uint32_t actuator = 0; actuator < kActuators; ++actuator) {
          if (!is_group && actuator != command.actuator) continue;
          const auto place = std::pair(batch.generation, actuator);
          const auto before = last.find(place);
          if (before != last.end() && before->second >= command.told_at)
            add(Fault::doubled, slot, batch, command,
                "the one before it ended at " + std::to_string(before->second));
          last[place] = command.told_at;
        }
      }
    }
  }

  // -------------------------------------------------------------------------- control and policy

  std::uint32_t number(const Slot& slot) const {
    return static_cast<std::uint32_t>(&slot - round_.slots.data());
  }
  static const SentBatch* last_batch(const Slot& slot) {
    return slot.batches == 0 ? nullptr : &slot.sent_batches[slot.batches - 1];
  }
  /// All that may have been sent through one attachment.
  template <class Visit>
  static void for_each(const Slot& slot, std::uint32_t attachment, SentKind kind, Visit&& visit) {
    for (const SentBatch& batch : slot.sent()) {
      if (batch.attachment != attachment || batch.sent == static_cast<std::uint32_t>(Sent::refused))
        continue;
      for (const SentCommand& command : slot.sent_in(batch))
        if (command.kind == kind) visit(batch, command);
    }
  }
  /// The iteration in which it was done; -1: it was not, `unknown` if nobody knows.
  static std::int64_t done_at(const SentCommand& command, std::int64_t unknown) {
    const bool told = has_ended(command.told);
    if (!told && !has_ended(command.found)) return unknown;
    const auto status = static_cast<Status>(told ? command.told : command.found);
    return status == Status::completed ? (told ? command.told_at : command.found_at) : -1;
  }
  /// The last iteration of which it is known that the sender of a batch lived and held its lane.
  std::int64_t lived_until(const Slot& slot, const SentBatch& sent) const {
    std::int64_t seen_at = 0;
    for (const SentBatch& batch : slot.sent())
      if (batch.attachment == sent.attachment) seen_at = std::max(seen_at, batch.sent_at);
    const bool killed = slot.doomed_at != 0 && slot.commanding != 0;
    if (killed && sent.attachment > slot.closed) seen_at = slot.doomed_at;
    const auto rows = round_.lives[sent.generation].seen();
    const auto later =
        std::ranges::find_if(rows, [&](const JournalRow& row) { return row.at >= seen_at; });
    return later - rows.begin() - 1;
  }

  /// From when it takes control until it lets go or dies, nobody else's batch is taken.
  void judge_control(const Slot& slot) {
    for (std::uint32_t attachment = 1; attachment <= slot.attachments; ++attachment)
      for_each(slot, attachment, SentKind::take_control,
               [&](const SentBatch& batch, const SentCommand& take) {
                 const std::int64_t from = done_at(take, -1);
                 if (from < 0 || round_.lives[batch.generation].watches != 0) return;
                 std::int64_t until = lived_until(slot, batch);
                 for_each(slot, attachment, SentKind::release_control,
                          [&](const SentBatch&, const SentCommand& release) {
                            const std::int64_t let_go = done_at(release, from);
                            if (let_go >= from) until = std::min(until, let_go - 1);
                          });
                 judge_others(slot, batch.generation, from, until);
               });
  }
  void judge_others(const Slot& holder, std::uint32_t generation, std::int64_t from,
                    std::int64_t until) {
    for (const Slot& slot : round_.slots) {
      if (&slot == &holder) continue;
      for (const SentBatch& batch : slot.sent()) {
        if (batch.generation != generation || batch.commands == 0 || batch.taken <= from ||
            batch.taken > until)
          continue;
        add(Fault::taken_alive, slot, batch, slot.sent_commands[batch.first_command],
            "taken at " + std::to_string(batch.taken) + ", when actor " +
                std::to_string(number(holder)) + " had control, from " + std::to_string(from) +
                " to " + std::to_string(until) + " at least");
      }
    }
  }

  /// Whose policy is to stop does not outlive a sender.
  void judge_stop(const Slot& slot) {
    const SentBatch* batch = last_batch(slot);
    if (slot.doomed_at == 0 || slot.commanding == 0 || batch == nullptr) return;
    const Generation& life = round_.lives[batch->generation];
    if (life.stops_stale != 0 && life.drained != 0 && batch->commands > 0 &&
        batch->sent == static_cast<std::uint32_t>(Sent::sent))
      add(Fault::unnoticed_death, slot, *batch, slot.sent_commands[batch->first_command],
          "its sender died, and the backend did not stop");
  }

  /// Whatever quintics overshoot, no desired state does.
  void judge_limits(const Generation& life) {
    for (std::int64_t k = -1; const JournalRow& row : life.seen()) {
      ++k;
      for (const double desired : row.desired)
        if (!(desired >= kLowest && desired <= kHighest))
          return failures_.push_back(
              {Fault::wrong_row, "row " + std::to_string(k) + " of generation " +
                                     std::to_string(&life - round_.lives.data()) + " desires " +
                                     std::to_string(desired) + ", outside of the limits"});
    }
  }

  /// No iteration was granted twice.
  void judge_bursts(std::uint32_t generation,
                    std::vector<std::pair<std::int64_t, std::int64_t>>& bursts) {
    std::sort(bursts.begin(), bursts.end());
    for (std::size_t i = 1; i < bursts.size(); ++i)
      if (bursts[i].first <= bursts[i - 1].second)
        failures_.push_back({Fault::doubled, "generation " + std::to_string(generation) +
                                                 ": the bursts that ended with rows " +
                                                 std::to_string(bursts[i - 1].second) + " and " +
                                                 std::to_string(bursts[i].second) + " overlap"});
  }

  const Round& round_;
  std::map<std::uint32_t, Deeds> deeds_;
  std::map<std::uint32_t, std::vector<std::pair<std::int64_t, std::int64_t>>> bursts_;
  std::vector<Failure> failures_;
};

}  // namespace

std::vector<Failure> judge(const Round& round) { return Judge(round).judge(); }

std::uint64_t commands_of(const Round& round) {
  std::uint64_t count = 0;
  for (const Slot& slot : round.slots) count += slot.commands;
  return count;
}

}  // namespace torture
