#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <vector>

#include "scripts/script.hpp"

namespace o80::test {

/// What commands with the linear profile mean on a robot without limits, written from the rules
/// (docs/commands.md) a second time, as plainly as can be: it shares no code with the controller.
class LinearReference {
 public:
  explicit LinearReference(const Script& script);

  /// Any step but run.
  void act(const ScriptStep& step, std::size_t place);
  /// One iteration.
  void step();

  /// Desired, as the field holds it, of every actuator and number.
  const std::vector<std::vector<long double>>& desired() const { return desired_; }
  /// How the commands that were pulsed stand, by their place in the script.
  const std::map<std::size_t, CommandEnd>& outcomes() const { return outcomes_; }
  Iteration iteration() const { return next_ - 1; }
  /// True once a command at a speed would take longer than a plan can: that is rejected, and what
  /// comes after it is not followed here.
  bool is_too_long() const { return too_long_; }

 private:
  bool too_long_ = false;
  /// A command of several actuators.
  struct Group {
    std::vector<std::size_t> places;  // of its members
    std::size_t open = 0;             // of them, that have not ended
    std::size_t arrived = 0;          // of them, first in their queues
    CommandEnd end;                   // the first status that is not completed, the last iteration
  };
  struct Queued {
    std::size_t place;
    const ScriptStep* step;
    std::shared_ptr<Group> group;  // or none
  };
  struct Actuator {
    std::deque<Queued> queue;  // the running one first
    bool running = false;
    bool begins = false;  // a command, in this iteration
    std::size_t row = 0;
    Iteration first = 0;  // of the row
    Iteration last = 0;
    std::vector<long double> from;
    std::vector<long double> to;
    std::int64_t exact = 0;    // end of the queue so far [ns]
    bool unbroken = false;     // the queue goes on from the iteration before
    std::int64_t started = 0;  // exact time at which the running command began [ns]
  };

  void restart(const std::vector<double>* states);
  void drop(std::uint16_t actuator, Status status, Iteration iteration);
  void drop_lane(std::uint16_t actuator, std::uint32_t lane);
  void pulse(std::uint32_t lane);
  void end(const Queued& queued, Status status, Iteration iteration);
  void end_late(std::size_t a);
  bool may_begin(std::size_t a) const;
  void agree_on_exact(std::size_t a);
  void agree_on_last(std::size_t a);
  void begin(std::size_t a);
  void move(std::size_t a);
  void begin_row(std::size_t a, bool begins_command);
  Iteration end_of_row(std::size_t a);
  long double observed(std::size_t a, std::size_t n) const;
  long double between(std::size_t a, std::size_t n) const;

  const Script& script_;
  std::vector<Actuator> actuators_;
  std::vector<std::vector<long double>> desired_;
  std::vector<std::vector<const double*>> readings_;      // null: where it is desired
  std::map<std::uint32_t, std::vector<Queued>> batches_;  // of each lane
  std::map<std::size_t, CommandEnd> outcomes_;
  Iteration next_ = 0;
};

}  // namespace o80::test
