#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include "nb.hpp"
#include "o80/runtime/frontend.hpp"
#include "observation.hpp"
#include "robot/group/inline_robot.hpp"
#include "waiting.hpp"

/// A native frontend that no Python object owns yet: attached, or of an inline robot.
struct Attachment {
  std::shared_ptr<o80::UntypedFrontend> frontend;
  std::shared_ptr<o80::InlineRobot> robot;
};

/// Targets of one command: the actuators, their states one after the other, and a mask for each
/// (none if all numbers are given).
struct Targets {
  std::vector<std::uint32_t> actuators;
  std::vector<std::byte> states;
  std::vector<std::uint64_t> masks;
  std::size_t clipped = 0;  // numbers that were put inside their bounds
};

/// The compiled half of o80.Frontend.
///
/// Its own members are guarded by the GIL. Another thread may `reattach`, which replaces the core's
/// frontend: copy `shared()` before you call Python code or release the GIL.
class Frontend {
 public:
  Frontend(const Attachment& attachment, std::shared_ptr<Decoder> decoder);

  o80::UntypedFrontend& untyped() const { return *untyped_; }
  std::shared_ptr<o80::UntypedFrontend> shared() const { return untyped_; }
  const std::shared_ptr<const Decoder>& decoder() const { return decoder_; }
  bool is_inline() const { return robot_ != nullptr; }

  /// From an index or a name.
  std::uint32_t actuator(nb::handle named) const;
  /// Each returns the index of its record in the batch.
  std::uint32_t add_command(nb::handle named, nb::handle target,
                            const o80::CommandOptions& options) const;
  /// The targets of one command: for one actuator, a group, a list of actuators, or all (None).
  Targets targets_of(nb::handle named, nb::handle given) const;
  /// From an index, a name, also of a group, a sequence of these, or None (all).
  std::vector<std::uint32_t> actuators(nb::handle named) const;
  /// True for an index, or a name that is not that of a group.
  bool names_one(nb::handle named) const;
  /// Puts `rows` targets of each actuator inside their bounds if `clip`.
  void clip(nb::handle clip, Targets& targets, std::uint32_t rows = 1) const;
  /// Counts what was clipped of targets that were added.
  void note_clipped(const Targets& targets) const;
  Observation blank() const { return Observation(decoder_); }
  /// Calls `work` with the core's frontend, without the GIL.
  template <class Work>
  auto released(Work&& work) const {
    const std::shared_ptr<o80::UntypedFrontend> frontend = untyped_;
    const Waiting waiting;
    return work(*frontend);
  }

  /// Releases the lane and stops an inline robot.
  void close();
  /// Throws Closed after close().
  void reattach(const Attachment& attachment, std::shared_ptr<Decoder> decoder);

  mutable std::int64_t clipped = 0;  // numbers of targets that were put inside their bounds
  o80::Iteration next = -1;          // next row of wait_for_next; -1: not called yet

 private:
  std::string name_of(std::uint32_t index) const;
  void write(std::uint32_t index, const o80::FieldRow& number, nb::handle target,
             std::byte* to) const;
  /// The actuators of a group, by its name; what is no name of a group stays what it is.
  nb::object expanded(nb::handle named) const;

  std::shared_ptr<o80::UntypedFrontend> untyped_;
  std::shared_ptr<o80::InlineRobot> robot_;
  std::shared_ptr<const Decoder> decoder_;
  nb::dict indices_;
  nb::dict groups_;  // lists of indices, of groups whose name is none of an actuator
  std::vector<const o80::FieldRow*> plain_;  // of each actuator; null: a struct
};

/// Number, cause, iteration, who, text of a halt.
using HaltFields = std::tuple<std::uint64_t, std::string, std::int64_t, std::string, std::string>;
std::optional<HaltFields> halt_fields(const std::optional<o80::Halt>& halt);
/// Name, iteration, who, progress of a running request.
using RunningFields = std::tuple<std::string, std::int64_t, std::string, std::string>;
std::vector<RunningFields> running_fields(const o80::UntypedFrontend& frontend);

// what each file adds to the class
void bind_moving(nb::module_& m, nb::class_<Frontend>& frontend);
void bind_sending(nb::module_& m, nb::class_<Frontend>& frontend);
void bind_halting(nb::module_& m, nb::class_<Frontend>& frontend);
void bind_reading(nb::module_& m, nb::class_<Frontend>& frontend);
