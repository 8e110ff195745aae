#pragma once

#include <array>
#include <atomic>
#include <cassert>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string_view>
#include <utility>
#include <vector>

#include "base/short_text.hpp"
#include "control/queue/controller.hpp"
#include "memory/os/fork.hpp"
#include "memory/ring/history.hpp"
#include "memory/ring/lane_receiver.hpp"
#include "memory/segment/halt_word.hpp"
#include "memory/segment/liveness.hpp"
#include "memory/segment/owned_segment.hpp"
#include "memory/segment/queue_word.hpp"
#include "memory/segment/signal.hpp"
#include "memory/segment/verb_word.hpp"
#include "o80/base/time.hpp"
#include "o80/runtime/backend.hpp"
#include "o80/runtime/journal.hpp"
#include "runtime/backend/burst_grant.hpp"
#include "runtime/backend/control_holder.hpp"
#include "runtime/backend/error_watch.hpp"
#include "runtime/backend/overrun_limit.hpp"
#include "runtime/backend/reading_watch.hpp"
#include "runtime/backend/running_requests.hpp"
#include "runtime/backend/schedule.hpp"
#include "runtime/backend/staging.hpp"
#include "runtime/backend/status_outbox.hpp"
#include "runtime/backend/work_share.hpp"
#include "runtime/journal/journal_author.hpp"

namespace o80 {

// budget for staging ahead, so that purges behind other batches are found: of a lane, of all lanes
inline constexpr std::uint32_t kWorkAhead = 64;
inline constexpr std::uint32_t kWorkAheadOfAll = 512;
/// Budget for express batches; in each iteration every lane may have one taken in any case.
inline constexpr std::uint32_t kExpressWork = 512;

/// What a user may do about a reading that cannot be.
inline constexpr std::string_view kToResume =
    "resume with --accept-reading (accept_reading in code)";

/// The phases that may follow each other (src/runtime/README.md#phases).
constexpr bool may_follow(Phase next, Phase now) noexcept {
  switch (next) {
    case Phase::starting:
      return false;
    case Phase::ready:
      return now == Phase::starting || now == Phase::iterating;
    case Phase::iterating:
      return now == Phase::ready;
    case Phase::unreadable:
      return now == Phase::ready || now == Phase::unreadable;
    case Phase::stopping:
      return now == Phase::ready || now == Phase::unreadable || now == Phase::braking;
    case Phase::braking:
      return now == Phase::stopping;
    case Phase::ended:
      return now != Phase::ended;
  }
  return false;
}

/// Progress of the halt in force.
enum class HaltStage : std::uint8_t {
  none,         // none is in force
  unexplained,  // the driver has halted; the requester has not written its reason yet
  explained,    // the driver has halted, the reason is known
  resumed       // the driver has resumed, but another halt was requested meanwhile
};

/// Implementation of UntypedBackend: its parts, and the order in which batches reach the
/// controller.
class UntypedBackend::Body final : public StatusSink, public BatchHandler {
 public:
  Body(Schema&& given, const BackendOptions& options, RequestServer* server,
       RecordedDecisions* recorded);
  Body& operator=(Body&&) = delete;
  virtual ~Body() = default;

  // BatchHandler: requests and orders of a batch to the backend itself
  Iteration iteration() const noexcept override { return current; }
  std::uint64_t epoch() const noexcept override {
    return recorded_ == nullptr ? segment.epoch() : 0;
  }
  Outcome request(std::uint32_t lane, CommandId id, BlockIndex record, std::uint32_t index,
                  Cursor payload) noexcept override;
  Outcome take_control(std::uint32_t lane) noexcept override;
  Outcome release_control(std::uint32_t lane) noexcept override;
  Outcome resume(std::uint32_t lane, CommandId id, std::uint64_t number,
                 bool accepts) noexcept override;

  // StatusSink
  void changed(const StatusChange& change) noexcept override;
  void freed(std::uint32_t lane, std::uint32_t blocks) noexcept override;
  bool may_begin(std::uint32_t actuator, std::uint32_t lane, CommandId id) noexcept override;

  std::byte* row() noexcept { return reinterpret_cast<std::byte*>(row_.data()); }
  bool has_begun() const noexcept { return phase != Phase::starting; }
  bool is_in_forked_child() noexcept;
  bool publish_first() noexcept;
  bool watches_readings() const noexcept { return !readings_.empty(); }
  bool judge_first(bool again) noexcept;
  bool agrees_with_first() noexcept { return !judges_first_ || judge_against_first(); }
  void publish(bool fresh) noexcept;
  Step step(std::int64_t at_most) noexcept;
  bool begin_direct(const DirectBurst& burst) noexcept;
  void stop_burst(BurstEnd end = BurstEnd::done) noexcept;
  void end(BackendState state, std::string_view text) noexcept;
  void ask_to_halt(HaltCause cause, std::string_view text) noexcept;
  void end_request(std::uint32_t request, const Served& how) noexcept;
  Step brake() noexcept;
  void interrupt(std::uint32_t actuator) noexcept;
  /// True if nothing acts, and the row shows all that later desired states depend on.
  bool is_at_rest() noexcept { return !halts.acts() && !running.any() && controller.shows_all(); }
  bool acts() const noexcept { return shown_acts_ != 0 || controller.active() || running.moves(); }
  void set_timing(const Timing& now) noexcept;
  std::int64_t time() const noexcept {
    return schema.head.bursting != 0 ? current * schema.head.period : real_time();
  }

  const Schema schema;
  const RowLayout layout;
  const Provenance provenance;
  OwnedSegment segment;
  HistoryWriter history;
  JournalAuthor journal;
  RowSignal row_signal;
  BellWaiter bell;
  LaneReceivers lanes;
  LaneLiveness liveness;
  BlockPool pool;
  Controller controller;
  Staging staging;
  Schedule schedule;
  HaltLatch halts;
  RunningRequests running;
  VerbWord verbs;
  Timing timing;
  std::atomic<bool> stop{false};
  std::array<char, 248> failure{};
  Phase phase = Phase::starting;
  Iteration current = 0;  // the current iteration; between two iterations, the next one
  const std::byte* begins_with = nullptr;  // first desired states; null: the observed ones

 private:
  // an iteration, in the order of its stages
  void enter(Phase next) noexcept {
    assert(may_follow(next, phase));
    phase = next;
  }
  bool is_under_way() const noexcept {
    return phase == Phase::iterating || phase == Phase::braking;
  }
  bool is_granted() const noexcept { return schema.head.bursting == 0 || burst_.runs(); }
  /// Deaths and halts => ended commands. Then the fresh start that an ended request needs.
  void watch() noexcept {
    poll_liveness();
    watch_halt();
    start_afresh_after_request();
  }
  inline void take_commands() noexcept;
  bool wait_for_burst(std::int64_t give_up, std::uint32_t& scans) noexcept;
  inline void begin_iteration_of_burst(bool first) noexcept;
  void move(Phase under_way) noexcept;
  inline void fill_row(bool fresh) noexcept;
  inline void watch_row(bool fresh) noexcept;
  inline void end_iteration() noexcept;
  std::int64_t real_time() const noexcept;

  // batches => controller
  void take_due() noexcept {
    if (!schedule.empty()) take_all_due();
  }
  void take_all_due() noexcept;
  void take_batches() noexcept;
  bool take_in_order() noexcept;
  void take_express() noexcept;
  void stage_ahead() noexcept;
  bool stage(std::uint32_t lane, std::uint32_t& budget) noexcept;
  bool take_staged(std::uint32_t lane) noexcept;
  void accept(const StagedBatch& sent) noexcept;
  bool admit(const StagedBatch& sent) noexcept;
  bool is_of_dead(const StagedBatch& sent) noexcept;
  void take(const StagedBatch& sent) noexcept;
  void take_checked(const StagedBatch& sent) noexcept;
  bool reject(const StagedBatch& sent, Reason reason, std::uint32_t detail = 0) noexcept;
  void end_batch(const StagedBatch& sent, Reason reason, std::uint8_t detail,
                 Status status) noexcept;
  void reject_all(Reason reason) noexcept;
  void grant(const StagedBatch& sent, const BatchRecord& batch) noexcept;
  bool is_called_off() const noexcept;
  void count_burst() noexcept {
    if (burst_.count()) end_burst(current);
  }
  void end_burst(Iteration row, BurstEnd end = BurstEnd::done) noexcept;

  // direct bursts
  bool is_undisturbed() const noexcept;
  Step step_direct() noexcept;

  // replay
  Step step_recorded() noexcept;
  bool will_start_afresh() const noexcept;
  bool obey_recorded() noexcept;
  void obey(const JournalEntry& entry) noexcept;
  void take_recorded(const JournalEntry& entry) noexcept;

  // halts
  void watch_halt() noexcept {
    if (halts.poll()) {
      begin_halt();
    } else if (halt_stage_ == HaltStage::unexplained) {
      complete_reason();
    }
    if (schedule.has_aside()) end_scheduled();
  }
  void complete_reason() noexcept;
  void purge_to_stop() noexcept;
  void show_acts() noexcept;
  void watch_errors() noexcept;
  void watch_gaps(bool fresh) noexcept;
  void count_missed() noexcept;
  void begin_halt() noexcept;
  void end_scheduled() noexcept;
  bool admitted_during_halt(const StagedBatch& sent) noexcept;
  bool ends_for_silence(const StagedBatch& sent) noexcept;

  // requests
  Outcome reject_request(std::uint32_t lane, CommandId id, std::string_view why) noexcept;
  Outcome start_afresh(std::uint32_t lane, CommandId id) noexcept;
  void start_afresh_after_request() noexcept;
  void end_running(RunningRequests::Entry& entry, const Outcome& outcome) noexcept;
  void report_ended_requests(bool fresh) noexcept;
  void drop_running(const Outcome& outcome) noexcept;

  // deaths and silence of commanders
  void poll_liveness() noexcept;
  void on_owner_death(std::uint32_t lane, std::uint64_t incarnation) noexcept;
  void watch_holder() noexcept;
  void halt_nameless() noexcept;
  void watch_silence() noexcept;
  void note_life(std::uint32_t lane) noexcept;
  void stale(std::uint32_t lane, Reason reason) noexcept;
  void fail(std::string_view text) noexcept;
  void note_failure(std::string_view text) noexcept;

  // readings
  bool name_not_finite(const std::byte* states, std::string_view what,
                       ShortText<248>& why) const noexcept;
  bool can_begin(const std::byte* states, std::string_view what) noexcept;
  void keep_reading() noexcept;
  void put_back_reading() noexcept;
  void begin_to_watch() noexcept;
  void watch_readings() noexcept;
  void watch_followers(bool fresh) noexcept;
  bool admitted_by_followers(const StagedBatch& sent) noexcept;
  double since_reading() const noexcept;
  bool judge_against_first() noexcept;
  bool is_misread(const std::byte* observed, std::string_view cure,
                  ShortText<248>& why) const noexcept;
  enum class Judged : std::uint8_t { none, readings, all };  // of a fresh start
  bool read_again(FreshReading& reading, Judged judged, ShortText<248>& why) noexcept;
  Outcome begin_afresh(std::uint32_t lane, const FreshReading& reading) noexcept;

  /// Calls a function of the program that serves this backend, which may fork.
  template <class Call>
  auto asks(std::string_view function, Call&& call) const noexcept {
    const auto answer = std::invoke(call, *server_);
    if (guard_.forked()) end_forked_child(schema.head.robot.view(), function);
    return answer;
  }

  bool reads_fresh(FreshReading& reading) const noexcept {
    return asks("the reading of a fresh start",
                [&](RequestServer& server) { return server.read_fresh(reading); });
  }

  ForkGuard guard_;
  RequestServer* server_;
  RecordedDecisions* recorded_;  // a replay obeys them; else null
  std::vector<LaneLife> lives_;
  std::vector<std::uint64_t> handled_deaths_;  // of each lane: the last one handled
  std::vector<std::uint64_t> row_;             // 8-byte words: the current row
  std::vector<std::byte> payload_;
  std::vector<std::uint64_t> fresh_desired_;
  Stale stale_;
  std::int64_t silence_;              // [iterations], 0: no watchdog
  std::vector<Iteration> last_life_;  // of each lane: last sign of life of its owner
  std::uint32_t seen_changes_ = 0;
  std::uint32_t seen_rounds_ = 0;
  bool is_nameless_ = false;  // its files were removed, which has halted it
  StatusOutbox outbox_;

  WorkShare share_;
  QueueWord queue_;
  std::uint32_t ahead_from_ = 0;              // last lane that was staged ahead
  std::vector<std::uint32_t> express_lanes_;  // by ticket

  ControlHolder holder_;
  std::uint64_t taking_owner_ = 0;         // incarnation that sent the batch being taken
  const StagedBatch* deciding_ = nullptr;  // the batch that is being taken or rejected

  // for each cause: hash of the text of the last halt that this process requested; 0: none since
  // a resume
  std::array<std::atomic<std::uint64_t>, kHaltCauses> own_halts_{};
  std::uint64_t halted_below_ = 0;  // batches with lower tickets were sent before the last halt
  std::uint32_t shown_acts_ = 0;    // as in Counters::acts
  HaltStage halt_stage_ = HaltStage::none;
  ErrorWatch errors_;
  ReadingWatch readings_;
  ReadingWatch followed_;  // of actuators that follow
  std::int64_t followed_at_ = 0;
  bool judges_first_;                    // an embedded backend, until the second reading
  const bool judges_fresh_;              // the readings of fresh starts
  std::int64_t read_at_ = 0;             // time of the last row whose reading was not missed
  std::vector<std::uint64_t> last_row_;  // or observed states, while a fresh reading is judged
  OverrunLimit overruns_;
  GapLimit gaps_;
  std::uint32_t seen_skipped_ = 0;  // periods that the loop missed
  Iteration missed_periods_ = 0;    // of these, not yet counted by the watchdog
  Iteration missed_at_ = 0;         // row behind the first of them
  Iteration counted_periods_ = 0;   // those counted last

  BurstGrant burst_;
};

}  // namespace o80
