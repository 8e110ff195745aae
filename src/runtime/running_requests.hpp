#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>
#include <utility>

#include "base/short_text.hpp"
#include "control/pool.hpp"
#include "memory/running_slot.hpp"
#include "o80/describe/schema.hpp"
#include "o80/runtime/request_server.hpp"

namespace o80 {

/// The requests that the driver answered with `running` and has not ended: one of a kind at most,
/// kMostRunning in all. Their progress is shown in the segment.
///
/// Writer:   the backend's thread.
/// Realtime: everything but construction.
class RunningRequests {
 public:
  struct Entry {
    bool runs = false;
    BlockIndex record = kNoBlock;
    RunningRequest shown;
    std::optional<Served> end;  // what the driver said, until it is told
  };

  RunningRequests(const Schema& schema, const SegmentView& view) : schema_(schema), view_(view) {}

  /// False if another of its kind runs, or too many do; `why` says which.
  bool may_begin(std::uint32_t request, ShortText<248>& why) const noexcept;
  void begin(std::uint32_t request, std::uint32_t lane, std::uint64_t id, BlockIndex record,
             Iteration now, std::string_view progress) noexcept;
  bool runs(std::uint32_t request) const noexcept { return find(request) != nullptr; }
  void show_progress(std::uint32_t request, std::string_view progress) noexcept;
  /// Notes how a request ended, for the row under way. Of one that does not run: nothing.
  void note_end(std::uint32_t request, const Served& how) noexcept;
  /// The place is free again.
  void forget(Entry& entry) noexcept;

  /// Calls `visit(Entry&)` for each that runs; it may be forgotten there.
  template <class Visit>
  void each(Visit&& visit) noexcept {
    for (Entry& entry : entries_) {
      if (entry.runs) visit(entry);
    }
  }
  /// One that has ended and wants a fresh start; null if there is none.
  const Entry* wanting_fresh_start() const noexcept;
  /// Goes on while the backend is halted.
  bool is_while_halted(const Entry& entry) const noexcept {
    return schema_.requests[entry.shown.request].while_halted != 0;
  }
  /// One runs that a halt would end.
  bool moves() const noexcept;
  /// The same, sent by this lane.
  bool moves(std::uint32_t lane) const noexcept;

 private:
  const Entry* find(std::uint32_t request) const noexcept;
  Entry* find(std::uint32_t request) noexcept {
    return const_cast<Entry*>(std::as_const(*this).find(request));
  }
  void show(Entry& entry, std::string_view progress) noexcept;

  const Schema& schema_;
  SegmentView view_;
  std::array<Entry, kMostRunning> entries_;
  std::uint64_t writes_ = 0;
};

}  // namespace o80
