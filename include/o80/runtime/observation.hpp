#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "o80/base/time.hpp"
#include "o80/control/command.hpp"
#include "o80/describe/describe.hpp"
#include "o80/describe/layout.hpp"
#include "o80/describe/schema.hpp"

namespace o80 {

/// Description of a robot from its segment, shared by all observations of a frontend.
struct Description {
  Schema schema;
  RowLayout layout;
  std::uint64_t epoch = 0;  // run of the described rows; 0: none
};

/// Row of a history, in bytes: desired, observed and extended values of one iteration.
class UntypedObservation {
 public:
  explicit UntypedObservation(std::shared_ptr<const Description> description)
      : description_(std::move(description)), row_(description_->layout.size / 8) {}

  const Schema& schema() const { return description_->schema; }
  const RowLayout& layout() const { return description_->layout; }
  const std::byte* bytes() const { return reinterpret_cast<const std::byte*>(row_.data()); }
  std::byte* bytes() { return reinterpret_cast<std::byte*>(row_.data()); }
  std::size_t size() const { return row_.size() * 8; }

  RowHead head() const { return unpack<RowHead>(bytes()); }
  Iteration iteration() const { return head().iteration; }
  /// On the schema's clock [ns].
  std::int64_t time() const { return head().time; }
  /// The run that published the row.
  std::uint64_t epoch() const { return description_->epoch; }
  /// For `pulse({.seen = row})`.
  operator Seen() const {  // NOLINT(google-explicit-constructor)
    const auto time = unpack<std::int64_t>(bytes() + layout().captured);
    const bool is_known = layout().captured == offsetof(RowHead, time) || time > 0;
    return {epoch(), iteration(), is_known ? time : -1, schema().head.clock};
  }
  const std::byte* desired() const { return bytes() + layout().desired; }
  const std::byte* observed() const { return bytes() + layout().observed; }
  const std::byte* extended() const { return bytes() + layout().extended; }
  /// True if a command or braking gave the desired state of this actuator.
  bool active(std::uint32_t actuator) const { return bit(layout().active, actuator); }
  /// True if limits changed the desired state of this actuator.
  bool clamped(std::uint32_t actuator) const { return bit(layout().clamped, actuator); }
  /// True if the actuator brakes to rest without a command.
  bool braking(std::uint32_t actuator) const { return bit(layout().braking, actuator); }
  /// True if a plan of chunks has no row left for this actuator, and is not closed.
  bool starved(std::uint32_t actuator) const { return bit(layout().starved, actuator); }
  /// Largest difference of this actuator's desired state from the commanded one, over all numbers,
  /// in their units. 0 if no limit changed the state.
  float off_plan(std::uint32_t actuator) const {
    return unpack<float>(bytes() + layout().off_plan + actuator * sizeof(float));
  }
  /// True if any actuator brakes.
  bool any_braking() const {
    for (std::uint32_t word = 0; word < layout().mask_words; ++word) {
      if (unpack<std::uint64_t>(bytes() + layout().braking + word * 8) != 0) return true;
    }
    return false;
  }

 private:
  bool bit(std::uint32_t mask, std::uint32_t actuator) const {
    return (unpack<std::uint64_t>(bytes() + mask + actuator / 64 * 8) >> (actuator % 64) & 1) != 0;
  }

  std::shared_ptr<const Description> description_;
  std::vector<std::uint64_t> row_;
};

/// Consecutive rows of a history, packed.
struct Rows {
  Iteration first = 0;
  std::size_t count = 0;
  std::size_t row_bytes = 0;
  std::vector<std::byte> bytes;

  std::span<const std::byte> row(std::size_t i) const {
    return std::span(bytes).subspan(i * row_bytes, row_bytes);
  }
};

}  // namespace o80
