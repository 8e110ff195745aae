#pragma once

#include <cstdint>
#include <vector>

#include "o80/control/pool.hpp"
#include "o80/control/record.hpp"
#include "o80/control/state_layout.hpp"
#include "o80/describe/schema.hpp"

namespace o80 {

/// Judges records that crossed a lane: whatever their bytes are, they do no harm.
///
/// Realtime: everything but construction.
class RecordCheck {
 public:
  /// One layout for each type that an actuator or a request has (the others are null).
  using Layouts = std::vector<const StateLayout*>;
  RecordCheck(const Schema& schema, Layouts layouts);

  /// Whether the record starting at `block`, all of whose blocks are there, can be followed.
  bool valid(const BlockPool& pool, BlockIndex block) noexcept;

 private:
  bool valid_command(const RecordHead& head, Cursor payload) noexcept;
  bool valid_request(const RecordHead& head, Cursor payload) noexcept;

  Layouts layouts_;
  std::vector<std::uint32_t> actuator_types_;
  std::vector<std::uint32_t> request_types_;
  std::vector<std::uint64_t> state_;
  std::vector<std::uint64_t> mask_;
};

}  // namespace o80
