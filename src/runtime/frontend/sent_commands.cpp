#include "runtime/frontend/sent_commands.hpp"

#include <algorithm>

#include "o80/describe/describe.hpp"

namespace o80 {

namespace {

GivesWay gives_way(const RecordHead& head) noexcept {
  if (head.pace == Pace::direct) return GivesWay::to_direct;
  return head.rows > 1 || head.pace == Pace::chunk ? GivesWay::to_any : GivesWay::to_overwrite;
}

}  // namespace

void SentCommands::note(std::span<const Block> batch, std::vector<SentCommand>* noted) {
  const auto record = unpack<BatchRecord>(batch.front().bytes.data());
  std::uint32_t places = 0;
  for (std::size_t block = 1; block < batch.size();) {
    const auto head = unpack<RecordHead>(batch[block].bytes.data());
    block += blocks_of(head.payload_bytes);
    const bool is_member = head.kind == RecordKind::member;
    const bool is_command = is_member || head.kind == RecordKind::command;
    if (is_command) note(head, record.at);
    if (!is_member) ++places;
    if (noted == nullptr || head.kind == RecordKind::group) continue;
    noted->push_back({places - 1, head.actuator, is_member ? RecordKind::command : head.kind,
                      is_command ? gives_way(head) : GivesWay::to_overwrite});
  }
}

void SentCommands::Newest::note(CommandId sent, Iteration when) noexcept {
  id = sent;
  at = std::max(at, when);
}

void SentCommands::note(const RecordHead& head, Iteration at) noexcept {
  if (head.actuator >= newest_.size()) return;
  Actuator& newest = newest_[head.actuator];
  newest.any.note(head.id, at);
  if (head.pace == Pace::direct) newest.direct.note(head.id, at);
  if (head.mode == Mode::overwrite) newest.overwriting.note(head.id, at);
}

bool SentCommands::has_replaced(CommandId id, Iteration iteration,
                                const SentCommand& command) const noexcept {
  if (command.index >= newest_.size()) return false;
  const Actuator& newest = newest_[command.index];
  if (newest.overwriting.ended(id, iteration)) return true;
  switch (command.gives_way) {
    case GivesWay::to_overwrite:
      return false;
    case GivesWay::to_direct:
      return newest.direct.ended(id, iteration);
    case GivesWay::to_any:
      return newest.any.ended(id, iteration);
  }
  return false;
}

}  // namespace o80
