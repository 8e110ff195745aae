#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "control/command_group.hpp"
#include "control/ledger.hpp"
#include "control/pool.hpp"
#include "control/record.hpp"
#include "control/record_check.hpp"

namespace o80 {

/// The steps that take a checked batch.
struct Plan {
  BlockIndex steps = kNoBlock;        // the first step, linked by Own::kNextStep
  std::uint32_t missing_from = 0;     // index of the first record without blocks
  BlockIndex spare_first = kNoBlock;  // unused blocks, to the end of the batch
  std::uint32_t spare_blocks = 0;
  // as in Effort
  std::uint32_t requests : 7 = 0;
  std::uint32_t express : 1 = 1;
  std::uint32_t releases : 1 = 0;
  std::uint32_t moves : 1 = 0;
  std::uint32_t resumes : 1 = 0;
  std::uint32_t groups : 21 = 0;  // number of commands of several actuators
};

/// The cost of taking a checked batch, and the properties that decide when it may be taken.
struct Effort {
  std::uint32_t work = 0;      // part of the budget of an iteration; copying a block is 1
  std::uint32_t requests = 0;  // number of requests to the driver
  bool express = false;        // only purges and control orders
  bool releases = false;       // releases exclusive control
  bool moves = false;          // has a command, or a request without `while_halted`
  bool resumes = false;        // only resumes, and no burst
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

  /// Continues the check of a batch for about `budget` blocks, and reduces `budget` by them. True
  /// when the whole batch is checked.
  bool check(std::uint32_t lane, BlockIndex batch, std::uint32_t& budget) noexcept;
  /// The cost of taking a checked batch.
  Effort effort(BlockIndex batch) const noexcept;
  /// The plan of a checked batch; call it once. Empty if the batch is invalid.
  std::optional<Plan> plan(BlockIndex batch) noexcept;
  /// Forgets a batch that will not be taken.
  void forget(std::uint32_t lane, BlockIndex batch) noexcept;
  /// The last record of the list of a step.
  BlockIndex tail(BlockIndex step) const noexcept { return tails_[step]; }

 private:
  using Verdict = RecordCheck::Verdict;
  enum class Known : std::uint8_t { nothing, plan, garbage };
  /// Effect of the present part of a batch on one queue, before its own commands are appended.
  struct Done {
    bool empty = false;      // all commands are dropped
    bool empty_own = false;  // all commands of this lane are dropped
    bool at_rest = false;    // the actuator brakes
    bool purged = false;     // all commands are purged
  };
  /// One actuator in the present part of the batch of a lane.
  struct Target {
    std::uint64_t epoch = 0;      // valid while it equals Lane::epoch
    BlockIndex list = kNoBlock;   // commands that will be appended, unless they are dropped
    bool list_is_step = false;    // its first command overwrites, and is a step already
    bool listed = false;          // is in Lane::listed
    BlockIndex group = kNoBlock;  // the last group with a member of this actuator
    Done done;
  };
  /// The batch of a lane that is being checked.
  struct Batch {
    BlockIndex batch = kNoBlock;
    BlockIndex cursor = kNoBlock;  // first block of the record being checked
    bool begun = false;            // the check of the record has begun
    Verdict verdict = Verdict::unfinished;
    BlockIndex last = kNoBlock;  // last block of the record that was reached
    std::uint32_t to_walk = 0;   // blocks from `last` to the end of the record
    BlockIndex last_step = kNoBlock;
    std::uint32_t place = 0;
    std::uint32_t record_blocks = 0;
    std::uint32_t blocks = 1;  // blocks of the batch that are checked
    Plan plan;
    std::uint32_t work = 0;
    std::uint32_t control_orders = 0;
    std::uint32_t resumes = 0;
    // the group whose members are being checked
    BlockIndex group = kNoBlock;
    BlockIndex first_member = kNoBlock;
    BlockIndex last_member = kNoBlock;
    std::uint32_t members_left = 0;
    std::uint32_t group_blocks = 0;
  };
  struct Lane : Batch {
    RecordCheck::Progress progress;
    std::uint32_t budget = 0;
    // the present part
    std::uint64_t epoch = 0;
    std::array<BlockIndex, 4> ends{};   // for each End the first record of its list
    Done all;                           // effect on every queue
    std::vector<std::uint16_t> listed;  // actuators with a list
    std::vector<Target> targets;        // one for each actuator
  };
  /// Index into Lane::ends.
  enum class End : std::uint8_t { invalid, overwritten, purged, completed };

  void begin_record(Lane& lane) noexcept;
  static void stop_reading(Lane& lane) noexcept;
  bool check_record(Lane& lane) noexcept;
  void enter(const Lane& lane, RecordHead& head) noexcept;
  void reject(const Lane& lane, RecordHead& head, std::uint32_t blocks) noexcept;
  static bool is_one_too_many(Lane& lane, const RecordHead& head) noexcept;
  void complete(Lane& lane, BatchRecord& record) noexcept;

  // groups
  bool fits_group(Lane& lane, const RecordHead& head) noexcept;
  void add_member(Lane& lane, RecordHead& head) noexcept;
  void complete_group(Lane& lane) noexcept;
  void fail_group(Lane& lane) noexcept;

  // a checked record => steps
  void add(Lane& lane, BlockIndex record) noexcept;
  void add_command(Lane& lane, BlockIndex record) noexcept;
  void add_purge(Lane& lane, BlockIndex record) noexcept;
  bool purge_one(Lane& lane, std::uint32_t actuator, bool own) noexcept;
  bool purge_all(Lane& lane, bool own) noexcept;
  void end_part(Lane& lane) noexcept;
  static void begin_part(Lane& lane) noexcept;
  void drop_list(Lane& lane, Target& target, End end) noexcept;
  void add_to_end(Lane& lane, End end, BlockIndex list) noexcept;
  void add_step(Lane& lane, BlockIndex record, std::uint32_t work) noexcept;
  void join(BlockIndex list, BlockIndex first, BlockIndex last) noexcept;
  static Target& target(Lane& lane, std::uint32_t actuator) noexcept;
  static void spend(Lane& lane, std::uint32_t work) noexcept {
    lane.budget -= std::min(lane.budget, work);
  }

  BlockPool& pool_;
  RecordCheck check_;
  std::vector<Lane> lanes_;
  std::vector<BlockIndex> tails_;   // one for each block
  std::vector<Known> known_;        // one for each block
  std::vector<bool> while_halted_;  // one for each request
};

}  // namespace o80
