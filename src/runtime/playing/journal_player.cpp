#include "runtime/playing/journal_player.hpp"

#include <algorithm>
#include <cstring>
#include <utility>

#include "o80/describe/describe.hpp"
#include "runtime/journal/journal_author.hpp"
#include "runtime/journal/journal_codec.hpp"

namespace o80 {

Iteration JournalPlayer::add(std::span<const std::byte> entries, std::int64_t codec) {
  Iteration last = -1;
  decode_journal(codec, entries, [&](JournalItem& item) {
    last = item.head.iteration;
    added_.push_back(std::move(item));
  });
  return last;
}

void JournalPlayer::write_until(Iteration k) {
  for (; !added_.empty() && added_.front().head.iteration <= k; added_.pop_front()) {
    const JournalItem& item = added_.front();
    writer_.skip_to(item.head.number);
    writer_.write(item.head, item.payload.data(), item.payload.size());
    note(item);
  }
}

/// Notes what the segment shows beside its rows.
void JournalPlayer::note(const JournalItem& item) {
  const JournalHead& head = item.head;
  const std::span<const std::byte> payload = item.payload;
  const bool is_halt = head.kind == JournalKind::halt || head.kind == JournalKind::halt_reason;
  if (is_halt && payload.size() >= sizeof(JournalHalt)) {
    const auto halt = unpack<JournalHalt>(payload.data());
    halt_ = {.number = head.id,
             .cause = static_cast<HaltCause>(std::min<std::uint64_t>(halt.cause, kHaltCauses - 1)),
             .iteration = head.iteration,
             .who = halt.who,
             .text = halt.text};
    halt_.who.back() = halt_.text.back() = 0;
  } else if (head.kind == JournalKind::ended) {
    const auto* text = reinterpret_cast<const char*>(payload.data());
    const bool failed = head.what == static_cast<std::uint32_t>(BackendState::failed);
    end_ = End{failed ? BackendState::failed : BackendState::stopped,
               std::string(text, strnlen(text, payload.size()))};
  }
}

}  // namespace o80
