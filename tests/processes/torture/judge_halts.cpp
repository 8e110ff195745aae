// Compares the halts and resumes that actors asked for with what drivers saw.

#include <algorithm>
#include <cmath>
#include <set>

#include "control/receiving/status_sink.hpp"
#include "torture/judge.hpp"

namespace torture {

namespace {

using o80::Status;

constexpr double kPeriod = 1e-3;                                  // [s]
constexpr double kSpeedStep = kAcceleration * kPeriod * kPeriod;  // of the state, an iteration
constexpr double kFastest = kSpeed * kPeriod;                     // the same
constexpr double kRounding = 1e-9;

bool is_sent(std::uint32_t sent) { return sent == static_cast<std::uint32_t>(Sent::sent); }

/// One generation: its rows, its halts.
class HaltedLife {
 public:
  HaltedLife(const Round& round, const Generation& life)
      : round_(round),
        life_(life),
        number_(static_cast<std::uint32_t>(&life - round.lives.data())),
        rows_(std::min<std::int64_t>(life.rows, kMaxRows)),
        resumes_(std::min(life.resumed.load(), kMaxResumes)) {}

  void judge(std::vector<Failure>& failures) {
    failures_ = &failures;
    judge_rows();
    judge_motion();
    judge_asked();
    judge_resumed();
    judge_commands();
  }

  std::int64_t rows() const { return rows_; }
  const JournalRow& row(std::int64_t k) const { return life_.journal[static_cast<std::size_t>(k)]; }
  /// The first row, after row 0, in which halt n or a later one acted; -1: there is none.
  std::int64_t first_halted(std::uint64_t n) const {
    for (std::int64_t k = 1; k < rows_; ++k)
      if (row(k).halted >= n) return k;
    return -1;
  }
  /// A resume that the driver granted, of halt n or a later one, in an iteration up to k.
  bool may_be_cleared(std::uint64_t n, std::int64_t k) const {
    return std::any_of(life_.resumes.begin(), life_.resumes.begin() + resumes_,
                       [&](const ServedResume& resume) {
                         return resume.granted != 0 && resume.number >= n && resume.iteration <= k;
                       });
  }
  /// The first row, after row 0, whose step was begun after a time.
  std::int64_t first_begun(std::int64_t time) const {
    std::int64_t k = 1;
    while (k < rows_ && row(k).stepped_at < time) ++k;
    return k;
  }
  /// Some halt was asked for, answered, and not resumed.
  bool may_act() const {
    std::uint64_t last = rows_ == 0 ? 0 : row(rows_ - 1).halted;
    for_each_asked(
        [&](const RequestedHalt& requested) { last = std::max(last, requested.number); });
    return last != 0 && !may_be_cleared(last, rows_);
  }
  bool is_resumed(std::int64_t k) const {
    return std::any_of(
        life_.resumes.begin(), life_.resumes.begin() + resumes_,
        [&](const ServedResume& resume) { return resume.granted != 0 && resume.iteration == k; });
  }
  double speed(std::int64_t k, std::uint32_t actuator) const {
    return k < 1 ? 0.0 : row(k).desired[actuator] - row(k - 1).desired[actuator];
  }
  bool moves(std::int64_t k) const {
    for (std::uint32_t i = 0; i < kActuators; ++i)
      if (speed(k, i) != 0.0) return true;
    return false;
  }

 private:
  void fail(const std::string& text) {
    failures_->push_back(
        {Fault::halt_broken, "generation " + std::to_string(number_) + ": " + text});
  }
  static std::string text_of(std::int64_t value) { return std::to_string(value); }

  /// What the rows around one were, for who wonders.
  std::string around(std::int64_t k) const {
    std::string text;
    for (std::int64_t i = std::max<std::int64_t>(0, k - 4); i < std::min(rows_, k + 4); ++i) {
      text += "\n    row " + text_of(i) + ": halted " + std::to_string(row(i).halted) +
              ", active " + std::to_string(row(i).active) + (row(i).fresh != 0 ? ", fresh" : "");
      for (const double desired : row(i).desired) text += ", " + std::to_string(desired);
    }
    return text;
  }

  /// A halt stands until it is resumed, and no command acts meanwhile.
  void judge_rows() {
    for (std::int64_t k = 1; k < rows_; ++k) {
      const std::uint64_t before = k > 1 ? row(k - 1).halted : 0;
      const std::uint64_t now = row(k).halted;
      if (now < before && (now != 0 || row(k).fresh == 0 || !may_be_cleared(before, k)))
        fail("halt " + std::to_string(before) + " acted in row " + text_of(k - 1) + ", halt " +
             std::to_string(now) + " in the next one, and nobody resumed");
      if (now != 0 && row(k).active != 0)
        return fail("a command acts in row " + text_of(k) + ", under halt " + std::to_string(now) +
                    around(k));
    }
  }

  /// What is limited brakes at its limit, what is not stops at once, and nothing jumps at a resume.
  void judge_motion() {
    for (std::uint32_t i = 0; i < kActuators; ++i) {
      const bool limited = life_.limited != 0 && i == kLimited;
      for (std::int64_t k = 1; k < rows_; ++k) {
        // after a fresh start it is at rest
        const double before = row(k - 1).fresh != 0 ? 0.0 : speed(k - 1, i);
        const double now = speed(k, i);
        const bool resumed = row(k).fresh != 0 && is_resumed(k);
        const bool halted = row(k).halted != 0;
        if (resumed && (now != 0.0 || (limited && std::abs(before) > kRounding)))
          return fail("actuator " + std::to_string(i) + " moves by " + std::to_string(before) +
                      ", then " + std::to_string(now) + " in row " + text_of(k) + ", of a resume" +
                      around(k));
        if (row(k).fresh != 0) continue;
        if (halted && !limited && now != 0.0)
          return fail("actuator " + std::to_string(i) + " moves in row " + text_of(k) +
                      ", under a halt");
        if (!limited) continue;
        if (std::abs(now) > kFastest + kRounding || std::abs(now - before) > kSpeedStep + kRounding)
          return fail("the limited actuator moves by " + std::to_string(before) + ", then by " +
                      std::to_string(now) + " in row " + text_of(k) + ", beyond its limits");
        if (halted && (now * before < 0.0 ||
                       std::abs(now) > std::max(0.0, std::abs(before) - kSpeedStep) + kRounding))
          return fail("the limited actuator moves by " + std::to_string(before) + ", then by " +
                      std::to_string(now) + " in row " + text_of(k) + ", and ought to brake");
      }
    }
  }

  template <class Visit>
  void for_each_asked(Visit&& visit) const {
    for (const Slot& slot : round_.slots)
      for (std::uint32_t i = 0; i < slot.halts; ++i) {
        const RequestedHalt& requested = slot.requested_halts[i];
        if (requested.generation == number_ && is_sent(requested.requested)) visit(requested);
      }
  }

  /// What was answered acts in the first iteration begun after the answer.
  void judge_asked() {
    std::set<std::uint64_t> numbers;
    for_each_asked([&](const RequestedHalt& requested) {
      const std::string name = "halt " + std::to_string(requested.number);
      if (requested.number == 0 || !numbers.insert(requested.number).second)
        return fail(name + " was asked for twice");
      const std::int64_t k = first_begun(requested.returned_at);
      if (k < rows_ && row(k).halted < requested.number && !may_be_cleared(requested.number, k))
        fail(name + " does not act in row " + text_of(k) + ", begun after it; there acts " +
             std::to_string(row(k).halted));
    });
  }

  /// Only the number that acted clears it.
  void judge_resumed() {
    std::set<std::uint64_t> requested;
    std::set<std::uint64_t> granted;
    for (std::uint32_t i = 0; i < resumes_; ++i)
      if (life_.resumes[i].granted != 0) granted.insert(life_.resumes[i].number);
    for (const Slot& slot : round_.slots)
      for (std::uint32_t i = 0; i < slot.resumes; ++i) {
        const AskedResume& resume = slot.requested_resumes[i];
        if (resume.generation != number_) continue;
        requested.insert(resume.number);
        if (resume.resumed != static_cast<std::uint32_t>(Resumed::done) || resume.returned_at == 0)
          continue;
        const std::int64_t k = first_begun(resume.returned_at);
        if (k < rows_ && row(k).halted != 0 && row(k).halted <= resume.number)
          fail("resume " + std::to_string(resume.number) + " was told as done, and halt " +
               std::to_string(row(k).halted) + " acts in row " + text_of(k) + ", begun after it");
      }
    for (const std::uint64_t number : granted)
      if (!requested.contains(number))
        fail("halt " + std::to_string(number) + " was resumed, and nobody asked for that");
  }

  /// What was sent before a halt was asked for does not act after it has begun.
  void judge_commands() {
    std::vector<std::pair<std::int64_t, std::int64_t>> begun;  // asked at [ns] => row
    for_each_asked([&](const RequestedHalt& requested) {
      const std::int64_t first = first_halted(requested.number);
      if (first >= 0) begun.emplace_back(requested.began_at, first);
    });
    std::sort(begun.begin(), begun.end());
    // of all that were asked for then or later, the first row
    for (std::size_t i = begun.size(); i-- > 1;)
      begun[i - 1].second = std::min(begun[i - 1].second, begun[i].second);
    const bool ever = first_halted(1) >= 0 || resumes_ > 0 || rows_ < 2;
    for (const Slot& slot : round_.slots)
      for (const SentBatch& batch : slot.sent()) {
        if (batch.generation != number_) continue;
        const auto halt = std::upper_bound(begun.begin(), begun.end(),
                                           std::pair(batch.sent_at, std::int64_t{1} << 62));
        const bool before = batch.sent_at > 0 && halt != begun.end();
        for (const SentCommand& command : slot.sent_in(batch))
          judge(slot, batch, command, before ? halt->second : std::int64_t{1} << 62, ever);
      }
  }
  void judge(const Slot& slot, const SentBatch& batch, const SentCommand& command,
             std::int64_t halted_from, bool ever) {
    const auto told = static_cast<Status>(command.told);
    if (told == Status::halted && !ever && command.told_at + 1 < rows_)
      fail("a command of actor " + text_of(&slot - round_.slots.data()) + ", batch " +
           std::to_string(batch.id) + ", ended as halted, and nothing was");
    if (told != Status::completed) return;
    // requests are served early in a step; a halt may come later in the same one
    const bool moves = command.kind == SentKind::command || command.kind == SentKind::group;
    const bool late = moves && command.told_at >= halted_from;
    if (late || (command.kind == SentKind::mark && command.told_at > halted_from))
      fail("a command of actor " + text_of(&slot - round_.slots.data()) + ", batch " +
           std::to_string(batch.id) + ", completed in iteration " + text_of(command.told_at) +
           "; a halt asked for after it was sent acted from " + text_of(halted_from));
  }

  const Round& round_;
  const Generation& life_;
  std::uint32_t number_;
  std::int64_t rows_;
  std::uint32_t resumes_;
  std::vector<Failure>* failures_ = nullptr;
};

/// Whether it is certain that a backend was killed while halted, or while a command acted.
bool died_halted(const Round& round, const Generation& life) {
  if (life.doomed_at == 0 || life.ending_at != 0 || life.usurped != 0) return false;
  const HaltedLife halts(round, life);
  if (halts.rows() < 2) return false;
  const JournalRow& last = halts.row(halts.rows() - 1);
  // in the middle of the next step nobody can tell
  if (last.active != 0 && life.steps < life.rows) return true;
  return halts.may_act();
}

bool starts_halted(const Round& round, const Generation& life) {
  const HaltedLife halts(round, life);
  return halts.first_halted(1) == 1 || halts.is_resumed(1);
}

/// Calls visit(predecessor, successor) where the second has to start halted.
template <class Visit>
void for_each_successor(const Round& round, Visit&& visit) {
  std::array<const Generation*, 4> halted{};  // of each segment
  for (std::uint32_t i = 0; i < round.generations; ++i) {
    const Generation& life = round.lives[i];
    const Generation*& former = halted[round.slots[life.actor].segment];
    if (life.rows >= 2) {
      if (former != nullptr && life.ignores_halts == 0) visit(*former, life);
      former = nullptr;
    }
    // one that was killed while it started has taken over what the one before left, or not
    if (life.ignores_halts != 0) former = nullptr;
    if (died_halted(round, life)) former = &life;
  }
}

}  // namespace

void judge_halts(const Round& round, std::vector<Failure>& failures) {
  for (std::uint32_t i = 0; i < round.generations; ++i)
    HaltedLife(round, round.lives[i]).judge(failures);
  for_each_successor(round, [&](const Generation& former, const Generation& life) {
    if (starts_halted(round, life)) return;
    failures.push_back({Fault::halt_broken,
                        "generation " + std::to_string(&former - round.lives.data()) +
                            " was killed while it was halted or moved, and generation " +
                            std::to_string(&life - round.lives.data()) + " does not start halted"});
  });
}

void count_halts(const Round& round, HaltCount& count) {
  for (const Slot& slot : round.slots) {
    for (std::uint32_t i = 0; i < slot.halts; ++i) {
      const std::uint32_t requested = slot.requested_halts[i].requested;
      count.requested += is_sent(requested) ? 1 : 0;
      count.interrupted += requested == static_cast<std::uint32_t>(Sent::under_way) ? 1 : 0;
    }
    for (std::uint32_t i = 0; i < slot.resumes; ++i)
      count.resumed +=
          slot.requested_resumes[i].resumed == static_cast<std::uint32_t>(Resumed::done) ? 1 : 0;
    for (std::uint32_t i = 0; i < slot.commands; ++i) {
      const SentCommand& command = slot.sent_commands[i];
      const bool told = static_cast<Status>(command.told) == Status::halted;
      count.commands += told || static_cast<Status>(command.found) == Status::halted ? 1 : 0;
    }
    count.bursts += slot.bursts_halted;
    count.controlled += slot.halted_in_control;
  }
  for (std::uint32_t i = 0; i < round.generations; ++i) {
    const HaltedLife life(round, round.lives[i]);
    for (std::int64_t k = 1; k < life.rows(); ++k) {
      if (life.row(k).halted == 0 || (k > 1 && life.row(k - 1).halted == life.row(k).halted))
        continue;
      ++count.begun;
      if (life.moves(k - 1)) ++count.moving;
    }
  }
  for_each_successor(round, [&](const Generation&, const Generation&) { ++count.inherited; });
}

}  // namespace torture
