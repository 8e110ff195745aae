#include "runtime/journal_player.hpp"

#include <algorithm>
#include <cstring>

#include "base/printable.hpp"
#include "o80/base/error.hpp"
#include "runtime/decision_journal.hpp"

namespace o80 {

namespace {

JournalHead head_at(std::span<const std::byte> entries) {
  JournalHead head;
  if (entries.size() < sizeof head)
    throw InvalidArgument("the recorded journal is damaged: an entry is cut off");
  std::memcpy(&head, entries.data(), sizeof head);
  const std::size_t length = std::size_t{head.words} * 8;
  if (length < sizeof head || length > entries.size())
    throw InvalidArgument("the recorded journal is damaged: an entry has an invalid length");
  return head;
}

}  // namespace

Iteration JournalPlayer::add(std::span<const std::byte> entries) {
  Iteration last = -1;
  for (std::span<const std::byte> rest = entries; !rest.empty();) {
    const JournalHead head = head_at(rest);
    last = head.iteration;
    rest = rest.subspan(std::size_t{head.words} * 8);
  }
  added_.erase(added_.begin(), added_.begin() + static_cast<std::ptrdiff_t>(written_));
  written_ = 0;
  added_.insert(added_.end(), entries.begin(), entries.end());
  return last;
}

void JournalPlayer::write_until(Iteration k) {
  while (written_ < added_.size()) {
    const std::span<const std::byte> rest = std::span(added_).subspan(written_);
    const JournalHead head = head_at(rest);
    if (head.iteration > k) return;
    const std::size_t length = std::size_t{head.words} * 8;
    const std::span<const std::byte> payload = rest.first(length).subspan(sizeof head);
    writer_.skip_to(head.number);
    writer_.write(head, payload.data(), payload.size());
    note(head, payload);
    written_ += length;
  }
}

/// Notes what the segment shows beside its rows.
void JournalPlayer::note(const JournalHead& head, std::span<const std::byte> payload) {
  const bool is_halt = head.kind == JournalKind::halt || head.kind == JournalKind::halt_reason;
  if (is_halt && payload.size() >= sizeof(JournalHalt)) {
    JournalHalt halt;
    std::memcpy(&halt, payload.data(), sizeof halt);
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
