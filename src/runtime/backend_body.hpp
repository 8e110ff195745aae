#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <utility>
#include <vector>

#include "o80/base/time.hpp"
#include "o80/control/controller.hpp"
#include "o80/memory/fork.hpp"
#include "o80/memory/history.hpp"
#include "o80/memory/lane.hpp"
#include "o80/memory/liveness.hpp"
#include "o80/memory/signal.hpp"
#include "o80/runtime/backend.hpp"
#include "o80/runtime/schedule.hpp"

namespace o80 {

inline constexpr std::uint32_t kNobody = 0xFFFFFFFF;
inline constexpr std::uint32_t kBlocksPerIteration = 1024;  // of batches, that are taken
inline constexpr std::int64_t kUntilEnded = -1;

/// The parts of a backend, and the order in which batches reach the controller.
class UntypedBackend::Body final : public StatusSink, public BatchHandler {
 public:
  Body(Schema&& given, const BackendOptions& options, RequestServer* server);
  Body(const Body&) = delete;
  Body& operator=(const Body&) = delete;
  virtual ~Body() = default;

  // BatchHandler: what a batch can ask of the backend itself
  Iteration iteration() const noexcept override { return current; }
  Outcome request(std::uint32_t lane, CommandId id, std::uint32_t index,
                  Cursor payload) noexcept override;
  Outcome take_control(std::uint32_t lane) noexcept override;
  Outcome release_control(std::uint32_t lane) noexcept override;

  // StatusSink
  void changed(const StatusChange& change) noexcept override;
  void freed(std::uint32_t lane, std::uint32_t blocks) noexcept override;

  std::byte* row() noexcept { return reinterpret_cast<std::byte*>(row_.data()); }
  void publish(bool fresh) noexcept;
  Step step(std::int64_t at_most) noexcept;
  void cut_burst() noexcept;
  void end(State state, std::string_view text) noexcept;
  std::int64_t time() const noexcept {
    return schema.head.bursting != 0 ? current * schema.head.period : monotonic_now();
  }

  const Schema schema;
  const RowLayout layout;
  OwnedSegment segment;
  HistoryWriter history;
  RowSignal row_signal;
  BellWaiter bell;
  LaneReceivers lanes;
  LaneLiveness liveness;
  BlockPool pool;
  Controller controller;
  Schedule schedule;
  Timing timing;
  std::atomic<bool> stop{false};
  std::array<char, 248> failure{};
  Iteration current = 0;  // under way, or about to be

 private:
  // batches => controller
  void take_batches() noexcept;
  void take_due() noexcept;
  void begin_staging(std::uint32_t lane, std::uint32_t& budget) noexcept;
  bool stage(std::uint32_t& budget) noexcept;
  void drop_staged(std::uint32_t blocks_outside) noexcept;
  void staged() noexcept;
  bool admit(const ScheduledBatch& sent) noexcept;
  void take(const ScheduledBatch& sent) noexcept;
  void grant(std::uint32_t lane, const BatchRecord& batch) noexcept;
  bool granted() const noexcept { return burst_left_ != 0; }
  void count_burst() noexcept;
  void end_burst(Iteration row) noexcept;

  // what the helper thread saw
  void look_at_lives() noexcept;
  void mourn(std::uint32_t lane, std::uint64_t incarnation) noexcept;
  void watch_holder() noexcept;
  void watch_silence() noexcept;
  void stale(std::uint32_t lane, Reason reason) noexcept;
  void fail(std::string_view text) noexcept;

  void tell(const StatusChange& change) noexcept;
  void tell_of_the_row(bool published) noexcept;

  void wake(bool lanes_wait, bool reader_waits) noexcept;

  ForkGuard guard_;
  RequestServer* server_;
  std::vector<LaneLife> lives_;
  std::vector<std::uint64_t> mourned_;  // last owner of each lane whose death was dealt with
  std::vector<std::uint64_t> row_;      // 8-byte words: the row under way
  std::vector<std::byte> payload_;
  std::vector<std::uint64_t> fresh_desired_;
  Stale stale_;
  std::int64_t silence_;  // [iterations], 0: no limit
  Iteration last_batch_ = 0;
  std::uint32_t seen_changes_ = 0;
  std::uint32_t seen_rounds_ = 0;
  bool begun_ = false;      // row 0 is out
  bool under_way_ = false;  // from step to publish: what ends now ends in this iteration
  bool stepping_ = false;   // what the controller says now is told when the row is out
  std::vector<StatusChange> untold_;

  // the batch being copied from its lane
  bool staging_ = false;
  bool staging_of_dead_ = false;  // whose place another frontend has taken
  std::uint32_t staging_lane_ = 0;
  std::uint64_t staging_incarnation_ = 0;
  std::uint64_t staging_owner_ = 0;  // 0: one that had left the lane before
  std::uint32_t staging_left_ = 0;   // blocks
  BlockChain staging_chain_;

  std::uint32_t holder_ = kNobody;  // lane with exclusive control
  std::uint64_t holder_incarnation_ = 0;
  std::uint64_t taking_owner_ = 0;  // who sent the batch that is being taken

  std::int64_t burst_left_ = 0;  // iterations, or kUntilEnded
  std::uint32_t burst_lane_ = kNobody;
  CommandId burst_id_ = 0;
  std::uint64_t burst_incarnation_ = 0;
};

}  // namespace o80
