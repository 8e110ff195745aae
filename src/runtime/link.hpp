#pragma once

#include <algorithm>
#include <atomic>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "control/batch_builder.hpp"
#include "control/limits.hpp"
#include "memory/attached_segment.hpp"
#include "memory/halt_word.hpp"
#include "memory/history.hpp"
#include "memory/lane_sender.hpp"
#include "memory/signal.hpp"
#include "o80/runtime/observation.hpp"
#include "runtime/ids_in_flight.hpp"
#include "runtime/inline_runner.hpp"

namespace o80 {

/// Blocks of a lane that commands leave free, so that there is room for a burst, a purge, a
/// request.
constexpr std::uint32_t kept_free(std::uint32_t blocks) noexcept {
  return blocks < 8 ? 0 : std::clamp(blocks / 16, 2U, 16U);
}

/// What a frontend, its batches and its bursts share: the attached segment and the lane.
///
/// Writer / Readers: any threads; `sending` guards what is sent.
struct Link {
  Link(AttachedSegment attached, std::shared_ptr<InlineRunner> inline_runner);

  /// The lane, taken at the first call. Throws NoLane, ReadOnly, Closed.
  std::shared_ptr<LaneSender> lane();
  /// The same if it was taken, else null.
  std::shared_ptr<LaneSender> lane_if_taken() const;
  /// Throws Closed or UsedAfterFork.
  void check_usable() const;
  /// Held while something is added or sent. Throws Closed or UsedAfterFork: in a forked child a
  /// thread that does not exist there may hold it for ever.
  std::unique_lock<std::mutex> lock_to_send() const;
  /// The halt that acts; if this frontend may write, also one that was asked for and does not yet.
  std::optional<Halt> halt() const;
  /// "it is halted since iteration 7 (halt 3, cause frontend, asked for by pid 5 (python)): why" of
  /// the halt that ended something in this iteration, or nothing if that one no longer acts.
  std::string halt_text(Iteration iteration) const;
  /// The caller's check, which also ends waits on a closed frontend.
  KeepWaiting guarded(const KeepWaiting& keep_waiting) const;

  AttachedSegment segment;
  std::shared_ptr<const Description> description;
  CommandCheck command_check;
  HistoryReader history;
  RowWaiter rows;
  std::shared_ptr<InlineRunner> runner;       // guarded by `sending`, gone when closed
  BatchBuilder builder;                       // what the next pulse sends; guarded by `sending`
  std::vector<BatchBuilder::Member> members;  // of the group that is being added; likewise
  IdsInFlight ids;                            // guarded by `sending`
  /// A batch sent for a later iteration.
  struct Scheduled {
    Iteration at;
    CommandId id;
  };
  std::deque<Scheduled> scheduled;  // guarded by `sending`; some of them may have been taken
  mutable std::mutex sending;
  std::atomic<bool> closed{false};

 private:
  friend class UntypedFrontend;
  std::shared_ptr<LaneSender> lane_;
};

}  // namespace o80
