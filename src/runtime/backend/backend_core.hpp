#pragma once

#include <array>
#include <atomic>
#include <cassert>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string_view>
#include <vector>

#include "control/queue/controller.hpp"
#include "memory/os/fork.hpp"
#include "memory/ring/history.hpp"
#include "memory/ring/lane_receiver.hpp"
#include "memory/segment/liveness.hpp"
#include "memory/segment/owned_segment.hpp"
#include "memory/segment/signal.hpp"
#include "o80/base/time.hpp"
#include "o80/runtime/backend.hpp"
#include "runtime/backend/running_requests.hpp"
#include "runtime/backend/schedule.hpp"
#include "runtime/journal/journal_author.hpp"

namespace o80 {

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

/// What the parts of a backend share: segment, controller, phase, the current row, and how batches
/// and running requests end.
///
/// Writer:   the backend's thread; `stop` any.
/// Realtime: everything but construction.
class BackendCore {
 public:
  BackendCore(Schema&& given, const BackendOptions& options, RequestServer* server_or_null,
              RecordedDecisions* recorded_or_null, StatusSink& statuses);

  std::byte* row() noexcept { return reinterpret_cast<std::byte*>(row_.data()); }
  const std::byte* row() const noexcept { return reinterpret_cast<const std::byte*>(row_.data()); }
  bool has_begun() const noexcept { return phase != Phase::starting; }
  bool is_under_way() const noexcept {
    return phase == Phase::iterating || phase == Phase::braking;
  }
  void enter(Phase next) noexcept {
    assert(may_follow(next, phase));
    phase = next;
  }
  /// Time of the current row [ns].
  std::int64_t time() const noexcept {
    return schema.head.bursting != 0 ? current * schema.head.period : real_time();
  }

  /// The first failure that is noted is the reason with which the backend ends.
  void note_failure(std::string_view text) noexcept;
  void fail(std::string_view text) noexcept {
    note_failure(text);
    stop.store(true, std::memory_order_relaxed);
  }
  /// Calls a function of the program that serves this backend, which may fork.
  template <class Call>
  auto asks(std::string_view function, Call&& call) const noexcept {
    const auto answer = std::invoke(call, *server);
    if (guard.forked()) end_forked_child(schema.head.robot.view(), function);
    return answer;
  }

  /// Rejects a batch; its records end with `status`.
  void end_batch(const StagedBatch& sent, Reason reason, std::uint8_t detail,
                 Status status) noexcept {
    deciding = &sent;
    controller.reject(sent.lane, sent.batch, reason, detail, current, status);
    deciding = nullptr;
  }
  /// The same; false, for `return reject(...)`.
  bool reject(const StagedBatch& sent, Reason reason, std::uint32_t detail = 0) noexcept {
    end_batch(sent, reason, static_cast<std::uint8_t>(detail), Status::rejected);
    return false;
  }
  void end_running(RunningRequests::Entry& entry, const Outcome& outcome) noexcept;
  /// Ends running requests without the driver. At a halt, requests that are served during halts
  /// continue.
  void drop_running(const Outcome& outcome) noexcept;

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
  Schedule schedule;
  RunningRequests running;
  ForkGuard guard;
  RequestServer* const server;            // null: requests are rejected
  RecordedDecisions* const recorded;      // a replay obeys them; else null
  const StagedBatch* deciding = nullptr;  // the batch that is being taken or rejected
  Timing timing;
  std::atomic<bool> stop{false};
  std::array<char, 248> failure{};
  Phase phase = Phase::starting;
  Iteration current = 0;  // the current iteration; between two iterations, the next one

 private:
  std::int64_t real_time() const noexcept;

  std::vector<std::uint64_t> row_;  // 8-byte words: the current row
};

}  // namespace o80
