#include "runtime/journal/recorded_entry_check.hpp"

#include <string>

#include "control/batch/record.hpp"
#include "o80/base/error.hpp"
#include "o80/describe/describe.hpp"

namespace o80 {

namespace {

[[noreturn]] void refuse_entry(const JournalEntry& entry, const std::string& why) {
  throw InvalidArgument("entry " + std::to_string(entry.number) + " of the journal " + why);
}

/// Throws if these are not the blocks of a whole batch.
void check_blocks(const JournalEntry& entry) {
  if (entry.blocks.size() < kBlockBytes) refuse_entry(entry, "lacks the blocks of its batch");
  const auto batch = unpack<BatchRecord>(entry.blocks.data());
  const bool is_whole = batch.kind == RecordKind::batch &&
                        std::uint64_t{batch.blocks} * kBlockBytes == entry.blocks.size();
  if (!is_whole) refuse_entry(entry, "holds a damaged batch");
}

}  // namespace

void check_recorded(const JournalEntry& entry, const Schema& schema, std::uint32_t lanes) {
  const bool is_batch = entry.kind == JournalKind::taken || entry.kind == JournalKind::rejected;
  const bool is_of_lane = is_batch || entry.kind == JournalKind::died ||
                          entry.kind == JournalKind::silent ||
                          entry.kind == JournalKind::fresh_start;
  if (is_of_lane && entry.lane >= lanes) {
    refuse_entry(entry, "is of lane " + std::to_string(entry.lane) + ", but the robot has " +
                            std::to_string(lanes) +
                            " lanes: give the option lanes of the recorded run");
  }
  if (is_batch) check_blocks(entry);
  if (entry.kind == JournalKind::interrupted && entry.actuator >= schema.actuators.size()) {
    refuse_entry(entry, "interrupts an actuator that the robot does not have");
  }
}

BackendOptions replaying(BackendOptions options) {
  options.resume = true;  // halts come from the recording
  options.journal = 0;
  return options;
}

}  // namespace o80
