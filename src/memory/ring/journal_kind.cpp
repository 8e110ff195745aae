#include "o80/memory/journal_kind.hpp"

#include <array>

namespace o80 {

std::string_view to_text(JournalKind kind) noexcept {
  static constexpr std::array<std::string_view, kJournalKinds> kTexts = {"none",
                                                                         "records",
                                                                         "dropped",
                                                                         "owner",
                                                                         "taken",
                                                                         "scheduled",
                                                                         "rejected",
                                                                         "status",
                                                                         "halt",
                                                                         "halt_reason",
                                                                         "resume",
                                                                         "control_taken",
                                                                         "control_released",
                                                                         "control_lost",
                                                                         "burst",
                                                                         "burst_ended",
                                                                         "died",
                                                                         "silent",
                                                                         "interrupted",
                                                                         "fresh_start",
                                                                         "order_lost",
                                                                         "stopping",
                                                                         "ended",
                                                                         "statuses",
                                                                         "snapshot",
                                                                         "at_rest",
                                                                         "chunk_begun"};
  const auto i = static_cast<std::size_t>(kind);
  return i < kTexts.size() ? kTexts[i] : "unknown";
}

}  // namespace o80
