#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "control/rig.hpp"
#include "scripts/script.hpp"

namespace o80::test {

inline constexpr Iteration kNever = -1;

/// A promise that a script broke.
struct Failure {
  std::string property;  // the same for all failures of one kind
  std::string text;
};

/// A command that was sent, and what was told of it. Of a member of a group nothing is told, so
/// `status` and `ended_at` follow from what ended it, or else from the end of all.
struct SentCommand {
  std::size_t step = 0;  // of the script
  std::uint32_t lane = 0;
  CommandId id = 0;
  Status status = Status::queued;
  Iteration active_since = kNever;
  Iteration ended_at = kNever;
  bool is_member = false;        // of a command of several actuators
  CommandEnd told;               // the end that was told; of a member, that of all
  Reason reason = Reason::none;  // of that end

  /// It gave the desired state of this iteration.
  bool drove(Iteration iteration) const {
    if (active_since == kNever || active_since > iteration) return false;
    if (ended_at == kNever) return true;
    const bool until_its_end = status == Status::completed || status == Status::interrupted;
    return until_its_end ? iteration <= ended_at : iteration < ended_at;
  }
};

/// Where one number of an actuator is and was.
struct NumberTrack {
  std::uint32_t offset = 0;  // in the block [bytes]
  long double now = 0.0L;
  long double before = 0.0L;      // desired in the iteration before
  std::optional<double> reading;  // observed there; else where it is desired
};

struct ActuatorTrack {
  std::vector<NumberTrack> numbers;
  SentCommand* driver = nullptr;        // gave the desired state of this iteration
  SentCommand* previous = nullptr;      // of the iteration before
  SentCommand* last = nullptr;          // the last that did, since the last fresh start
  Iteration dropped_at = kNever;        // all its commands were dropped before this iteration
  Iteration maybe_dropped_at = kNever;  // some of them, or none
  bool active = false;
  bool clamped = false;
  bool braking = false;
};

/// A script's robot while it plays: the controller, and all that can be seen from outside.
class ScriptWorld {
 public:
  explicit ScriptWorld(const Script& played);

  /// Any step but run and resume.
  void act(const ScriptStep& step, std::size_t place);
  void purge(std::uint16_t actuator);
  /// A fresh start: its row takes an iteration.
  void restart(const std::vector<double>* desired);
  /// One iteration; the failure is of what was told, not of motion.
  std::optional<Failure> step();

  const ScriptStep& step_of(const SentCommand& command) const { return script.steps[command.step]; }
  /// Whether a command names this number.
  bool names(const SentCommand& command, std::size_t number) const {
    const std::uint64_t mask = step_of(command).mask;
    return mask == 0 || (mask >> number & 1) != 0;
  }
  std::size_t rows_of(const SentCommand& command) const;
  /// A number of the target in a row of a command, as its field holds it.
  long double target(const SentCommand& command, std::size_t row, std::size_t number) const;
  std::string where(std::size_t actuator, std::size_t number) const;

  const Script& script;
  Rig rig;
  std::vector<ActuatorTrack> actuators;
  std::vector<SentCommand*> sent;         // in order; of all lanes
  std::vector<const SentCommand*> ended;  // in this iteration
  std::vector<SentCommand*> members;      // of groups, that have not ended
  Iteration iteration = 0;                // of the last row
  std::uint64_t blocks_sent = 0;

 private:
  struct Pending {
    std::size_t step;
    std::uint32_t place;  // of its record
    bool is_member;
  };
  struct Member {
    RecordHead head;
    std::vector<std::uint64_t> mask;
    std::vector<std::byte> states;
  };
  struct LaneBatch {
    BatchBuilder builder;
    std::vector<Pending> commands;
    std::vector<Member> group;  // that is being added
    const ScriptStep* first = nullptr;
    std::uint32_t rows = 1;
  };

  void add(const ScriptStep& step, std::size_t place);
  static void add_group(LaneBatch& batch);
  void pulse(std::uint32_t lane);
  void note_drop(std::uint16_t actuator, bool surely = true);
  void end_members(std::uint16_t actuator, std::uint32_t lane, Status status, Iteration at);
  void observe();
  void look();
  std::optional<Failure> hear();
  std::optional<Failure> hear_end(SentCommand& command, const StatusChange& change);
  std::optional<Failure> find_drivers();
  std::optional<Failure> arrived(const SentCommand& member) const;
  bool may_arrive_before_others(const SentCommand& command) const;
  bool gives_way(const SentCommand& command, const SentCommand& next) const;

  std::map<std::uint32_t, LaneBatch> batches_;
  std::deque<SentCommand> commands_;
  std::map<std::pair<std::uint32_t, CommandId>, std::vector<SentCommand*>> records_;
  std::map<std::pair<std::uint32_t, CommandId>, Status> first_ends_;  // of groups, if not completed
  std::vector<std::vector<SentCommand*>> running_;                    // of each actuator
  std::size_t heard_ = 0;
};

}  // namespace o80::test
