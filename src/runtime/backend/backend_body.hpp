#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

#include "memory/segment/verb_word.hpp"
#include "o80/runtime/journal.hpp"
#include "runtime/backend/backend_core.hpp"
#include "runtime/backend/bursts.hpp"
#include "runtime/backend/commanders.hpp"
#include "runtime/backend/halts.hpp"
#include "runtime/backend/intake.hpp"
#include "runtime/backend/readings.hpp"
#include "runtime/backend/status_outbox.hpp"

namespace o80 {

/// Implementation of UntypedBackend: its parts, the order in which an iteration calls them
/// (backend.cpp), requests and fresh starts (backend_requests.cpp), and what a replay does instead
/// (backend_replay.cpp).
class UntypedBackend::Body final : public StatusSink, public BatchHandler, public BackendCore {
 public:
  Body(Schema&& given, const BackendOptions& options, RequestServer* server_or_null,
       RecordedDecisions* recorded_or_null);
  Body& operator=(Body&&) = delete;
  virtual ~Body() = default;

  // BatchHandler: requests and orders of a batch to the backend itself
  Iteration iteration() const noexcept override { return current; }
  std::uint64_t epoch() const noexcept override {
    return recorded == nullptr ? segment.epoch() : 0;
  }
  Outcome request(std::uint32_t lane, CommandId id, BlockIndex record, std::uint32_t index,
                  Cursor payload) noexcept override;
  Outcome take_control(std::uint32_t lane) noexcept override {
    commanders.take_control(lane, intake.owner());
    return {};
  }
  Outcome release_control(std::uint32_t lane) noexcept override {
    commanders.release_control(lane, intake.owner());
    return {};
  }
  Outcome resume(std::uint32_t lane, CommandId id, std::uint64_t number,
                 bool accepts) noexcept override;

  // StatusSink
  void changed(const StatusChange& change) noexcept override;
  void begun(const ChunkBegin& chunk) noexcept override { journal.begun(chunk); }
  void freed(std::uint32_t lane, std::uint32_t blocks) noexcept override {
    lanes[lane].free(blocks);
  }
  bool may_begin(std::uint32_t actuator, std::uint32_t lane, CommandId id) noexcept override {
    return readings.may_begin(actuator, lane, id);
  }

  bool is_in_forked_child() noexcept;
  bool publish_first() noexcept;
  void publish(bool fresh) noexcept;
  Step step(std::int64_t at_most) noexcept;
  bool begin_direct(const DirectBurst& burst) noexcept;
  void end(BackendState state, std::string_view text) noexcept;
  Step brake() noexcept;
  void interrupt(std::uint32_t actuator) noexcept;
  bool acts() const noexcept { return shown_acts_ != 0 || controller.active() || running.moves(); }

  // the parts: each uses those before it
  Bursts bursts;
  Readings readings;
  Halts halts;
  Commanders commanders;
  Intake intake;
  StatusOutbox outbox;
  VerbWord verbs;
  const std::byte* begins_with = nullptr;  // first desired states; null: the observed ones

 private:
  // an iteration, in the order of its stages
  void watch() noexcept;
  inline void take_commands() noexcept;
  bool wait_for_burst(std::int64_t give_up, std::uint32_t& scans) noexcept;
  inline void begin_iteration_of_burst(bool first) noexcept;
  void move(Phase under_way) noexcept;
  void show_acts() noexcept;
  inline void fill_row(bool fresh) noexcept;
  inline void watch_row(bool fresh) noexcept;
  inline void end_iteration() noexcept;

  void purge_to_stop() noexcept;
  /// True if nothing acts, and the row shows all that later desired states depend on.
  bool is_at_rest() noexcept { return !halts.acts() && !running.any() && controller.shows_all(); }

  // direct bursts
  bool is_undisturbed() const noexcept;
  Step step_direct() noexcept;

  // replay
  Step step_recorded() noexcept;
  bool will_start_afresh() const noexcept;
  bool obey_recorded() noexcept;
  void obey(const JournalEntry& entry) noexcept;
  void take_recorded(const JournalEntry& entry) noexcept;

  // requests and fresh starts
  Outcome reject_request(std::uint32_t lane, CommandId id, std::string_view why) noexcept;
  Outcome start_afresh(std::uint32_t lane, CommandId id) noexcept;
  Outcome begin_afresh(std::uint32_t lane, const FreshReading& reading) noexcept;
  void start_afresh_after_request() noexcept;
  void report_ended_requests(bool fresh) noexcept;

  std::vector<std::byte> payload_;
  std::vector<std::uint64_t> fresh_desired_;
  std::uint32_t shown_acts_ = 0;  // as in Counters::acts
};

}  // namespace o80
