#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "control/batch/record.hpp"
#include "control/receiving/ledger.hpp"
#include "control/receiving/pool.hpp"
#include "control/receiving/record_check.hpp"

namespace o80 {

/// The cost of taking a checked batch, and the properties that decide when it may be taken.
struct Effort {
  std::uint32_t work = 0;          // part of the budget of an iteration; copying a block is 1
  std::uint32_t requests : 7 = 0;  // number of requests to the driver
  std::uint32_t express : 1 = 0;   // only purges and control orders
  std::uint32_t releases : 1 = 0;  // releases exclusive control
  std::uint32_t moves : 1 = 0;     // has a command, or a request without `while_halted`
  std::uint32_t free : 1 = 0;      // needs no control: resumes, marks, closed plans; no burst
  std::uint32_t groups : 21 = 0;   // number of commands of several actuators
};

/// The steps that take a checked batch.
struct Plan {
  BlockIndex steps = kNoBlock;        // the first step, linked by Own::kNextStep
  std::uint32_t missing_from = 0;     // index of the first record without blocks
  BlockIndex spare_first = kNoBlock;  // unused blocks, to the end of the batch
  std::uint32_t spare_blocks = 0;
  Effort effort;
};

/// Checks the records of a batch in the pool, and reduces them to the few steps that take it.
///
/// A step is one record, a list of commands for the queue of one actuator, or a list of records
/// with the same end status. Commands that a later record of the same batch overwrites or purges go
/// into such a list and never reach a queue. So the cost of taking a batch depends on its actuators
/// and requests, not on its number of records.
///
/// A request may make a fresh start, so requests split a batch into parts: an overwrite or a purge
/// drops only commands of its own part.
///
/// Realtime: everything but construction.
class BatchPlanner {
 public:
  BatchPlanner(const Schema& schema, const Layouts& layouts, BlockPool& pool, std::uint32_t lanes);
  BatchPlanner(const BatchPlanner&) = delete;
  ~BatchPlanner();

  /// Checks about `budget` more blocks, and reduces `budget` by them. True when all are checked.
  bool check(std::uint32_t lane, BlockIndex batch, std::uint32_t& budget) noexcept;
  /// The cost of taking a checked batch.
  Effort effort(BlockIndex batch) const noexcept;
  /// The plan of a checked batch; call it once. Empty if the batch is invalid.
  std::optional<Plan> plan(BlockIndex batch) noexcept;
  /// Forgets a batch that will not be taken.
  void forget(std::uint32_t lane, BlockIndex batch) noexcept;
  /// The last record of the list of a step.
  BlockIndex tail(BlockIndex step) const noexcept { return shared_.tails[step]; }

 private:
  struct Batch;
  struct Lane;
  enum class Known : std::uint8_t { nothing, plan, garbage };
  /// What all lanes use.
  struct Shared {
    BlockPool& pool;
    RecordCheck check;
    std::vector<BlockIndex> tails;   // one for each block
    std::vector<bool> while_halted;  // one for each request
  };

  Shared shared_;
  std::vector<Lane> lanes_;
  std::vector<Known> known_;  // one for each block
};

}  // namespace o80
