#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "o80/control/ledger.hpp"
#include "o80/control/pool.hpp"
#include "o80/control/record.hpp"
#include "o80/control/record_check.hpp"

namespace o80 {

/// A record that could not be followed, once a plan has found it out.
inline constexpr auto kInvalidRecord = static_cast<RecordKind>(0);

/// What taking a checked batch comes to.
struct Plan {
  BlockIndex steps = kNoBlock;     // the first; the others follow by Own::kOther
  std::uint32_t missing_from = 0;  // place of the first record that has no blocks
  BlockChain spare;                // blocks that no record uses
};

/// Turns a batch in the pool into the few steps that take it, checking each of its records.
///
/// A step is one record, or a list of records that go to the end of one actuator's queue together,
/// or the list of all that are invalid. So taking a batch costs no more for its thousands of
/// commands than for its actuators.
///
/// Realtime: everything but construction.
class BatchPlanner {
 public:
  BatchPlanner(const Schema& schema, RecordCheck::Layouts layouts, BlockPool& pool,
               std::uint32_t lanes);

  /// Goes on with a batch; true when all of it is checked.
  bool check(std::uint32_t lane, BlockIndex batch, std::uint32_t budget) noexcept;
  /// The plan of a checked batch, once; none if the batch itself is garbage.
  std::optional<Plan> plan(BlockIndex batch) noexcept;
  /// Forgets a batch that will not be taken.
  void forget(std::uint32_t lane, BlockIndex batch) noexcept;
  /// The last record of a step's list.
  BlockIndex tail(BlockIndex step) const noexcept { return tails_[step]; }

 private:
  enum class Known : std::uint8_t { nothing, plan, garbage };
  /// A list that further commands may join, valid while its epoch is the lane's.
  struct OpenList {
    BlockIndex first = kNoBlock;
    std::uint64_t epoch = 0;
  };
  struct Lane {
    BlockIndex batch = kNoBlock;   // being checked
    BlockIndex cursor = kNoBlock;  // first block of the record being checked
    bool begun = false;            // it has been looked at
    RecordCheck::Verdict verdict = RecordCheck::Verdict::unfinished;
    BlockIndex last = kNoBlock;  // its last one, or as far as an invalid one has been walked
    std::uint32_t to_walk = 0;   // blocks of it behind `last`
    BlockIndex last_step = kNoBlock;
    BlockIndex invalid = kNoBlock;
    std::uint32_t place = 0;
    std::uint32_t record_blocks = 0;
    std::uint32_t blocks = 0;  // seen
    std::uint64_t epoch = 0;
    RecordCheck::Progress progress;
  };

  void begin(Lane& lane, BlockIndex batch) noexcept;
  void begin_record(Lane& lane) noexcept;
  static void stop_reading(Lane& lane) noexcept;
  bool check_record(std::uint32_t lane, std::uint32_t& budget) noexcept;
  void add(std::uint32_t lane, BlockIndex record) noexcept;
  void add_step(Lane& lane, BlockIndex record) noexcept;
  void join(BlockIndex list, BlockIndex record) noexcept;
  void complete(Lane& lane) noexcept;
  OpenList& open(std::uint32_t lane, std::uint32_t actuator) noexcept {
    return open_[lane * actuators_ + actuator];
  }

  BlockPool& pool_;
  RecordCheck check_;
  std::uint32_t actuators_;
  std::vector<Lane> lanes_;
  std::vector<OpenList> open_;
  std::vector<BlockIndex> tails_;  // one for each block
  std::vector<Known> known_;       // one for each block
};

}  // namespace o80
