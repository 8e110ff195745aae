#pragma once

#include <string>
#include <vector>

#include "torture/board.hpp"

namespace torture {

struct Failure {
  Fault fault;
  std::string text;
};

/// Compares what senders were told and what stands in the segments with what drivers did.
std::vector<Failure> judge(const Round& round);

/// The same of halts: every one is obeyed at once, and none is cleared by whoever has not seen it.
void judge_halts(const Round& round, std::vector<Failure>& failures);

/// What was asked for and what came of it.
struct HaltCount {
  std::uint64_t requested = 0;    // and answered
  std::uint64_t interrupted = 0;  // their asker was killed in the middle
  std::uint64_t controlled = 0;   // asked for by who has taken control
  std::uint64_t begun = 0;        // seen by a driver
  std::uint64_t moving = 0;       // of these, while an actuator moved
  std::uint64_t inherited = 0;    // by the successor of a killed backend
  std::uint64_t bursts = 0;       // ended by them
  std::uint64_t commands = 0;     // the same
  std::uint64_t resumed = 0;
};
void count_halts(const Round& round, HaltCount& count);

/// Commands that were compared.
std::uint64_t commands_of(const Round& round);

}  // namespace torture
