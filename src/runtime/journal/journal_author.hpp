#pragma once

#include <array>
#include <cstdint>
#include <string_view>
#include <vector>

#include "control/batch/record.hpp"
#include "control/receiving/status_sink.hpp"
#include "memory/ring/journal.hpp"
#include "memory/ring/status_word.hpp"
#include "o80/describe/rows.hpp"
#include "o80/memory/halt.hpp"
#include "o80/memory/life.hpp"
#include "o80/runtime/request_server.hpp"
#include "runtime/journal/staged_batch.hpp"

namespace o80 {

/// Payload of `taken`, `scheduled` and `rejected`.
struct JournalBatch {
  std::uint64_t ticket = 0;
  std::uint64_t sender = 0;  // incarnation of the owner of the lane; 0: it had left
  Iteration at = kNow;       // the iteration that the batch was sent for
};
static_assert(sizeof(JournalBatch) == 24);

/// Payload of `halt` and `halt_reason`.
struct JournalHalt {
  std::uint64_t cause = 0;
  std::array<char, 64> who{};
  std::array<char, 248> text{};
};
static_assert(sizeof(JournalHalt) == 320);

/// Payload of `owner`: its process, as text.
using JournalOwner = std::array<std::uint64_t, 8>;
/// Payload of `statuses`: runs of consecutive ids of one lane with the same status.
struct JournalStatusRun {
  std::uint64_t first_id = 0;
  std::uint64_t count = 0;
  std::uint64_t word = 0;  // a StatusWord
};
static_assert(sizeof(JournalStatusRun) == 24);
/// Most statuses of an entry.
inline constexpr std::uint32_t kMaxStatuses = 64;

/// Payload of `burst`.
struct JournalBurst {
  std::int64_t iterations = 0;  // -1 until the batch has ended
  std::uint64_t sender = 0;     // incarnation
};
static_assert(sizeof(JournalBurst) == 16);
/// Payload of `burst_ended` and `resume`.
struct JournalSender {
  std::uint64_t sender = 0;  // incarnation; 0: it had left
};
static_assert(sizeof(JournalSender) == 8);

/// Payload of `ended`: the reason, as text.
using JournalText = std::array<char, 248>;

/// Writes the decisions of a backend into the journal of its segment
/// (src/runtime/README.md#journal). Each is one entry with its iteration.
///
/// The blocks of a batch are entries of the iteration in which they are staged, the decision on the
/// batch one of the iteration in which it acts; readers join them by lane and id. A rejected batch
/// is one entry, its commands get none. The owner of a lane is named before its first batch, and
/// again before an entry that it causes if half a ring was written since.
///
/// Writer:   the backend's thread.
/// Realtime: everything but construction.
class JournalAuthor {
 public:
  explicit JournalAuthor(const SegmentView& view);

  // rows in which nothing acts
  /// Something acts from now on; another entry says what.
  void acts() noexcept { acts_ = is_on(); }
  /// True if something has acted since the last at_rest(), or half a ring was written since.
  bool lacks_rest() const noexcept { return acts_ || writer_.position() - rest_ > half_; }
  /// Nothing acts now, and the row of this iteration shows the whole state of the controller.
  void at_rest() noexcept {
    acts_ = false;
    rest_ = writer_.position();
    note(JournalKind::at_rest, 0, 0);
  }

  // batches
  /// The blocks of a batch, while they are copied: begin, add each, end. `first`: index of the
  /// first of them. `sender`: incarnation that sends, 0 if it has left.
  void begin_blocks(std::uint32_t lane, std::uint64_t sender, std::uint32_t most) noexcept;
  void add_block(const std::byte* block) noexcept { writer_.add(block, kBlockBytes); }
  void end_blocks(std::uint32_t lane, CommandId batch, std::uint32_t first) noexcept;
  void dropped(std::uint32_t lane, CommandId batch) noexcept;
  void scheduled(const StagedBatch& sent, CommandId batch) noexcept;
  /// The batch was taken or rejected.
  void decided(const StagedBatch& sent, const StatusChange& change) noexcept;
  void begun(const ChunkBegin& chunk) noexcept;
  void order_lost() noexcept { note(JournalKind::order_lost, 0, 0); }

  /// Statuses of one lane are gathered in one entry, which ends with the next other entry, or with
  /// flush().
  void statuses(std::uint32_t lane, JournalStatusRun run) noexcept;
  void flush() noexcept {
    if (statuses_ != 0) write_statuses();
  }

  // halts
  void halt(JournalKind halt_or_reason, const Halt& halt) noexcept;
  void resume(std::uint32_t lane, std::uint64_t sender, std::uint64_t halt) noexcept;
  /// `follows`: actuators without a command follow from now on.
  void fresh_start(std::uint32_t lane, bool follows = false) noexcept {
    acts();
    note(JournalKind::fresh_start, lane, 0, follows ? 1 : 0);
  }
  /// A snapshot of the driver; left out if it is larger than an entry may be.
  void kept(const KeptState& state) noexcept;
  bool is_on() const noexcept { return writer_.is_on(); }
  /// `before_step`: before the desired states of this iteration were computed.
  void interrupted(std::uint32_t actuator, bool before_step) noexcept {
    acts();
    note(JournalKind::interrupted, 0, actuator, before_step ? 1 : 0);
  }

  // commanders; `owner`: their incarnation
  void control(JournalKind kind, std::uint32_t lane, std::uint64_t owner) noexcept {
    name_again(lane, owner);
    note(kind, lane, owner);
  }
  /// `stale`: the policy that applies now.
  void died(std::uint32_t lane, std::uint64_t owner, Stale stale) noexcept;
  void silent(std::uint32_t lane, std::uint64_t owner, Stale stale) noexcept;

  // bursts
  void burst(std::uint32_t lane, CommandId batch, const JournalBurst& burst) noexcept;
  void burst_ended(std::uint32_t lane, std::uint64_t sender, CommandId batch, Iteration row,
                   BurstEnd how) noexcept;

  // ends
  void stopping() noexcept {
    acts();
    note(JournalKind::stopping, 0, 0);
  }
  void ended(BackendState state, std::string_view text) noexcept;

  /// Sets the iteration of the following entries.
  void set_iteration(Iteration iteration) noexcept { iteration_ = iteration; }

 private:
  /// The newest entry with the name of a lane's owner.
  struct Named {
    std::uint64_t incarnation = 0;
    std::uint64_t position = 0;
    JournalOwner name{};
  };

  JournalHead head(JournalKind kind, std::uint32_t lane, std::uint64_t id,
                   std::uint32_t what = 0) const noexcept {
    JournalHead head;
    head.kind = kind;
    head.lane = static_cast<std::uint8_t>(lane);
    head.what = what;
    head.iteration = iteration_;
    head.id = id;
    return head;
  }
  void note(JournalKind kind, std::uint32_t lane, std::uint64_t id,
            std::uint32_t what = 0) noexcept {
    write(head(kind, lane, id, what));
  }
  void write(const JournalHead& head, const void* payload = nullptr,
             std::size_t bytes = 0) noexcept {
    flush();
    writer_.write(head, payload, bytes);
  }
  void write_statuses() noexcept;
  void name_owner(std::uint32_t lane, std::uint64_t incarnation) noexcept;
  void name_again(std::uint32_t lane, std::uint64_t incarnation) noexcept;
  bool is_far(const Named& named) const noexcept {
    return writer_.position() - named.position > half_;
  }

  JournalWriter writer_;
  SegmentView view_;
  std::vector<Named> named_;  // one for each lane
  // the next entry of statuses
  std::array<JournalStatusRun, kMaxStatuses> runs_;
  std::uint32_t runs_used_ = 0;
  std::uint32_t statuses_ = 0;
  std::uint32_t status_lane_ = 0;
  Iteration iteration_ = 0;
  bool acts_;
  std::uint64_t rest_ = 0;  // position of the newest entry at_rest
  std::uint64_t half_;      // of the ring
};

}  // namespace o80
