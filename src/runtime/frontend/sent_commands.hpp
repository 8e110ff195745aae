#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "control/batch/record.hpp"

namespace o80 {

/// Which later command of the same queue ends a command as `overwritten`.
enum class GivesWay : std::uint8_t {
  to_overwrite,  // one that overwrites
  to_direct,     // also the next set-point: a direct command
  to_any         // also any successor: a trajectory behind its last row
};

/// What a frontend remembers of a record that it sent, for each of its actuators.
struct SentCommand {
  std::uint32_t place = 0;  // of the record in its batch
  std::uint16_t index = 0;  // of the actuator or the request; a purge may have kEveryActuator
  RecordKind kind = RecordKind::command;  // command also for the members of a group
  GivesWay gives_way = GivesWay::to_overwrite;
};
static_assert(sizeof(SentCommand) == 8);

/// The newest commands that a frontend has sent to each actuator. An overwritten command that is
/// older than one of them, and gives way to it, was overwritten by its own frontend. So was one
/// that ended while an own batch waited for its iteration (`at`), whichever was sent first.
///
/// A backend does not say who overwrote a command. If this frontend and another one both overwrote
/// it, this frontend counts.
class SentCommands {
 public:
  explicit SentCommands(std::size_t actuators) : newest_(actuators) {}

  /// Notes the records of a batch, with their ids, and appends them to `noted` unless it is null.
  void note(std::span<const Block> batch, std::vector<SentCommand>* noted);
  /// True if a command of this frontend may have ended the command `id` as overwritten in
  /// `iteration`.
  bool has_replaced(CommandId id, Iteration iteration, const SentCommand& command) const noexcept;

 private:
  struct Newest {
    CommandId id = 0;
    Iteration at = kNow;  // the last iteration for which one was sent
    void note(CommandId sent, Iteration when) noexcept;
    bool ended(CommandId other, Iteration iteration) const noexcept {
      return id > other || at >= iteration;
    }
  };
  struct Actuator {
    Newest overwriting, direct, any;
  };
  void note(const RecordHead& head, Iteration at) noexcept;

  std::vector<Actuator> newest_;
};

}  // namespace o80
