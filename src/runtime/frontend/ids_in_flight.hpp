#pragma once

#include <cstdint>
#include <functional>
#include <optional>

#include "base/ring.hpp"
#include "control/batch/record.hpp"

namespace o80 {

/// Draws ids for batches so that no batch loses its statuses before it has ended.
///
/// A lane has `places` status slots; id i uses slot i modulo `places`. Drawing skips the slots of
/// batches that have not ended. The last `kept` slots of each revolution are reserved for batches
/// without commands, which end soon: otherwise running batches could leave only gaps that are too
/// small for a purge.
class IdsInFlight {
 public:
  /// True if the batch whose last status has this id has ended.
  using HasEnded = std::function<bool(CommandId)>;

  explicit IdsInFlight(std::uint64_t places, std::uint64_t kept = 0)
      : places_(places), kept_(kept) {}

  /// The first of n consecutive ids from `next` on; nothing if running batches leave no such gap.
  std::optional<CommandId> draw(CommandId next, std::uint64_t n, const HasEnded& has_ended);
  /// The same for a batch without commands.
  std::optional<CommandId> draw_kept(CommandId next, std::uint64_t n, const HasEnded& has_ended);
  /// Records that a batch with these ids was sent.
  void sent(CommandId first, std::uint64_t n) { runs_.push_back({first, n, first + 1}); }

 private:
  enum class From : std::uint8_t { here_on, exactly_here };
  std::optional<CommandId> draw_up_to(CommandId next, std::uint64_t n, std::uint64_t places_end,
                                      const HasEnded& has_ended, From from = From::here_on);
  CommandId fit(CommandId first, std::uint64_t n, std::uint64_t places_end) const noexcept;
  void go_back(std::size_t moved);

  struct Run {
    std::uint64_t begin;  // its first id, plus the revolutions for which its slots were skipped
    std::uint64_t count;
    CommandId end_id;  // the id whose status reports the end of the batch
  };

  std::uint64_t places_;
  std::uint64_t kept_;
  Ring<Run> runs_;  // by `begin`, all within one revolution
};

}  // namespace o80
