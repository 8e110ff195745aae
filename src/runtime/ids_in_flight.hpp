#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <optional>

#include "control/record.hpp"

namespace o80 {

/// Gives ids to batches so that no status of a batch that has not ended is lost.
///
/// A lane keeps the statuses of its last `places` ids, each at the place id modulo `places`. Ids
/// pass over the places of a batch that still runs when they come round again. The last `kept`
/// places of each revolution are left to batches without commands, which end soon: what runs may
/// leave nothing but gaps too narrow for a purge.
class IdsInFlight {
 public:
  /// Whether the batch whose last status is that of this id has ended.
  using HasEnded = std::function<bool(CommandId)>;

  explicit IdsInFlight(std::uint64_t places, std::uint64_t kept = 0)
      : places_(places), kept_(kept) {}

  /// The first of n ids in a row, not before `next`; none if the batches that have not ended leave
  /// no such row.
  std::optional<CommandId> draw(CommandId next, std::uint64_t n, const HasEnded& has_ended);
  /// The same for a batch without commands.
  std::optional<CommandId> draw_kept(CommandId next, std::uint64_t n, const HasEnded& has_ended);
  /// The batch with these ids was sent.
  void sent(CommandId first, std::uint64_t n) { runs_.push_back({first, n, first + 1}); }

 private:
  enum class From : std::uint8_t { here_on, exactly_here };
  std::optional<CommandId> draw_up_to(CommandId next, std::uint64_t n, std::uint64_t places_end,
                                      const HasEnded& has_ended, From from = From::here_on);
  CommandId fit(CommandId first, std::uint64_t n, std::uint64_t places_end) const noexcept;
  void go_back(std::size_t moved);

  struct Run {
    std::uint64_t begin;  // where its places come round: its first id, plus revolutions
    std::uint64_t count;
    CommandId end_id;  // of the status that tells its end
  };

  std::uint64_t places_;
  std::uint64_t kept_;
  std::deque<Run> runs_;  // by `begin`, all within one revolution
};

}  // namespace o80
