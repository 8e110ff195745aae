#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "control/command_group.hpp"
#include "control/ledger.hpp"
#include "control/pool.hpp"
#include "control/record.hpp"
#include "control/record_check.hpp"

namespace o80 {

/// What taking a checked batch comes to.
struct Plan {
  BlockIndex steps = kNoBlock;     // the first; the others follow by Own::kNextStep
  std::uint32_t missing_from = 0;  // place of the first record that has no blocks
  BlockChain spare;                // blocks that no record uses
  std::uint32_t groups = 0;        // commands of several actuators
};

/// How much taking a checked batch takes of an iteration.
struct Effort {
  std::uint32_t work = 0;      // in units of the backend's budget: about one block each
  std::uint32_t requests = 0;  // that the driver will serve
  bool express = false;        // nothing but purges and control orders
  bool releases = false;       // some of which let go of control
  bool moves = false;    // has what a halt refuses: a command, a request not marked `while_halted`
  bool resumes = false;  // nothing but orders to resume, and no burst
};

/// Turns a batch in the pool into the few steps that take it, checking each of its records.
///
/// A step is one record, or a list of records that go to the end of one actuator's queue together,
/// or a list of records with the same end. What the batch itself overwrites or purges goes into
/// such a list and never reaches a queue. So taking a batch costs no more for its thousands of
/// records than for its actuators and requests.
///
/// Requests divide a batch into parts, because one may start afresh: a part drops only what the
/// same part has added.
///
/// Realtime: everything but construction.
class BatchPlanner {
 public:
  BatchPlanner(const Schema& schema, RecordCheck::Layouts layouts, BlockPool& pool,
               std::uint32_t lanes);

  /// Goes on with a batch, for about `budget` blocks, which it takes off; true when all of it is
  /// checked.
  bool check(std::uint32_t lane, BlockIndex batch, std::uint32_t& budget) noexcept;
  /// What taking a checked batch takes.
  Effort effort(BlockIndex batch) const noexcept;
  /// The plan of a checked batch, once; none if the batch itself is garbage.
  std::optional<Plan> plan(BlockIndex batch) noexcept;
  /// Forgets a batch that will not be taken.
  void forget(std::uint32_t lane, BlockIndex batch) noexcept;
  /// The last record of a step's list.
  BlockIndex tail(BlockIndex step) const noexcept { return tails_[step]; }

 private:
  static constexpr std::size_t kFirstStep = 0;  // of BatchRecord::own

  enum class Known : std::uint8_t { nothing, plan, garbage };
  /// What a part of a batch has done to a queue so far.
  struct Done {
    bool empty = false;      // nothing is left in it
    bool empty_own = false;  // nothing that this lane sent
    bool at_rest = false;    // what it moved comes to rest
    bool purged = false;     // by a purge of every lane's commands
  };
  /// One actuator in the part of a lane's batch that is being checked.
  struct Target {
    std::uint64_t epoch = 0;      // what else is here is valid while this is the lane's
    BlockIndex list = kNoBlock;   // commands that will be appended, if nothing drops them
    bool list_is_step = false;    // the first of them overwrites: it is a step already
    bool listed = false;          // in `listed_`: has a list, or moves on after an overwrite
    BlockIndex group = kNoBlock;  // the last one that it was a member of
    Done done;
  };
  struct Lane {
    BlockIndex batch = kNoBlock;   // being checked
    BlockIndex cursor = kNoBlock;  // first block of the record being checked
    bool begun = false;            // it has been looked at
    RecordCheck::Verdict verdict = RecordCheck::Verdict::unfinished;
    BlockIndex last = kNoBlock;  // its last one, or as far as an invalid one has been walked
    std::uint32_t to_walk = 0;   // blocks of it behind `last`
    BlockIndex last_step = kNoBlock;
    std::uint32_t place = 0;
    std::uint32_t record_blocks = 0;
    std::uint32_t blocks = 0;  // seen
    std::uint64_t epoch = 0;
    RecordCheck::Progress progress;
    Effort effort;
    std::uint32_t control_orders = 0;
    std::uint32_t resumes = 0;
    // the group whose members are being checked
    BlockIndex group = kNoBlock;
    BlockIndex first_member = kNoBlock;
    BlockIndex last_member = kNoBlock;
    std::uint32_t members_left = 0;
    std::uint32_t group_blocks = 0;
    std::uint32_t groups = 0;  // of the batch, so far
    // of the part under way
    std::array<BlockIndex, 4> ends{};  // first of the lists of records of one end
    Done all;                          // done to every queue
    std::uint32_t listed = 0;
  };
  /// Index into Lane::ends.
  enum class End : std::uint8_t { invalid, overwritten, purged, completed };

  void begin(Lane& lane, BlockIndex batch) noexcept;
  void begin_record(Lane& lane) noexcept;
  static void stop_reading(Lane& lane) noexcept;
  bool check_record(std::uint32_t lane, std::uint32_t& budget) noexcept;
  void go_on_behind(Lane& lane) noexcept;
  bool is_one_too_many(Lane& lane, const RecordHead& head) const noexcept;
  void complete(std::uint32_t lane, std::uint32_t& budget) noexcept;

  // groups
  bool fits_group(std::uint32_t lane, const RecordHead& head) noexcept;
  void begin_group(Lane& lane) noexcept;
  void add_member(Lane& lane) noexcept;
  void complete_group(std::uint32_t lane, std::uint32_t& budget) noexcept;
  void fail_group(std::uint32_t lane, std::uint32_t& budget) noexcept;

  // a checked record => steps
  void add(std::uint32_t lane, BlockIndex record, std::uint32_t& budget) noexcept;
  void add_command(std::uint32_t lane, BlockIndex record) noexcept;
  void add_purge(std::uint32_t lane, BlockIndex record, std::uint32_t& budget) noexcept;
  bool purge_one(std::uint32_t lane, std::uint32_t actuator, bool own) noexcept;
  bool purge_all(std::uint32_t lane, bool own, std::uint32_t& budget) noexcept;
  void end_part(std::uint32_t lane, std::uint32_t& budget) noexcept;
  void begin_part(Lane& lane) noexcept;
  void drop_list(Lane& lane, Target& target, End end) noexcept;
  void add_to_end(Lane& lane, End end, BlockIndex list) noexcept;
  void add_step(Lane& lane, BlockIndex record, std::uint32_t work) noexcept;
  void join(BlockIndex list, BlockIndex first, BlockIndex last) noexcept;

  static void spend(std::uint32_t& budget, std::uint32_t work) noexcept {
    budget -= std::min(budget, work);
  }
  Target& target(std::uint32_t lane, std::uint32_t actuator) noexcept;
  void list(std::uint32_t lane, std::uint32_t actuator) noexcept;
  std::span<std::uint16_t> listed(std::uint32_t lane) noexcept {
    return {listed_.data() + std::size_t{lane} * actuators_, lanes_[lane].listed};
  }

  BlockPool& pool_;
  RecordCheck check_;
  std::uint32_t actuators_;
  std::vector<Lane> lanes_;
  std::vector<Target> targets_;        // of each lane, one for each actuator
  std::vector<std::uint16_t> listed_;  // the same
  std::vector<BlockIndex> tails_;      // one for each block
  std::vector<Known> known_;           // one for each block
  std::vector<bool> while_halted_;     // one for each request
};

}  // namespace o80
