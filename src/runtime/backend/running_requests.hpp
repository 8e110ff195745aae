#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>
#include <utility>

#include "base/short_text.hpp"
#include "control/receiving/pool.hpp"
#include "memory/segment/running_slot.hpp"
#include "o80/describe/schema.hpp"
#include "o80/runtime/request_server.hpp"

namespace o80 {

/// The requests that the driver answered with `running` and has not ended: at most one of a kind
/// and kMaxRunning in all. The segment shows their progress.
///
/// Writer:   the backend's thread.
/// Realtime: everything but construction.
class RunningRequests {
 public:
  struct Entry {
    bool runs = false;
    BlockIndex record = kNoBlock;
    RunningRequest shown;
    std::optional<Served> end;  // set by the driver, not yet reported to the sender
  };

  RunningRequests(const Schema& schema, const SegmentView& view) : schema_(schema), view_(view) {}

  /// False if a request of the same kind runs, or kMaxRunning run; `why` gets the reason.
  bool may_begin(std::uint32_t request, ShortText<248>& why) const noexcept;
  void begin(std::uint32_t request, std::uint32_t lane, std::uint64_t id, BlockIndex record,
             Iteration now, std::string_view progress) noexcept;
  bool any() const noexcept { return count_ != 0; }
  bool runs(std::uint32_t request) const noexcept { return find(request) != nullptr; }
  void show_progress(std::uint32_t request, std::string_view progress) noexcept;
  /// Records how a request ended in the current row. No effect if it does not run.
  void note_end(std::uint32_t request, const Served& how) noexcept;
  /// Frees the entry.
  void forget(Entry& entry) noexcept;

  /// Calls `visit(Entry&)` for each running request; `visit` may call forget().
  template <class Visit>
  void each(Visit&& visit) noexcept {
    if (!any()) return;
    for (Entry& entry : entries_) {
      if (entry.runs) visit(entry);
    }
  }
  /// A request that has ended and needs a fresh start; null if there is none.
  const Entry* wanting_fresh_start() const noexcept {
    return any() ? find_wanting_fresh_start() : nullptr;
  }
  /// True if the request continues during a halt.
  bool is_while_halted(const Entry& entry) const noexcept {
    return schema_.requests[entry.shown.request].while_halted != 0;
  }
  /// True if a request runs that a halt would end.
  bool moves() const noexcept;
  /// The same for requests of one lane.
  bool moves(std::uint32_t lane) const noexcept;

 private:
  const Entry* find(std::uint32_t request) const noexcept;
  const Entry* find_wanting_fresh_start() const noexcept;
  Entry* find(std::uint32_t request) noexcept {
    return const_cast<Entry*>(std::as_const(*this).find(request));
  }
  void show(Entry& entry, std::string_view progress) noexcept;

  const Schema& schema_;
  SegmentView view_;
  std::array<Entry, kMaxRunning> entries_;
  std::uint32_t count_ = 0;  // that run
  std::uint64_t writes_ = 0;
};

}  // namespace o80
