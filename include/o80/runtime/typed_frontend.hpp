#pragma once

#include <array>
#include <initializer_list>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "o80/runtime/frontend.hpp"
#include "o80/runtime/typed_observation.hpp"

namespace o80 {

/// Throws SchemaMismatch with the difference if the types in `expected` and `found` have different
/// layouts. Names, limits and help texts may differ.
void check_types(const Schema& expected, const Schema& found, const std::string& segment);

/// Frontend with the robot's types; `Frontend<>` has none and works on bytes.
template <class R = void>
class Frontend : public UntypedFrontend {
 public:
  explicit Frontend(const std::string& segment, const FrontendOptions& options = {})
      : UntypedFrontend(segment, options) {
    compare();
  }

  using UntypedFrontend::add_command;
  /// Adds a command by index or by name; the state must be of the actuator's type.
  template <Shareable State>
  std::uint32_t add_command(std::uint32_t index, const State& target,
                            const CommandOptions& options = {}) {
    std::array<std::byte, sizeof(State)> bytes{};
    pack(target, bytes.data());
    check_state<State>(index);
    return UntypedFrontend::add_command(index, bytes, options);
  }
  template <Shareable State>
  std::uint32_t add_command(std::string_view name, const State& target,
                            const CommandOptions& options = {}) {
    return add_command(actuator(name), target, options);
  }
  using UntypedFrontend::add_commands;
  /// Adds one command for several actuators of one state type, a target for each.
  template <Shareable State>
  std::uint32_t add_commands(std::span<const std::string_view> names,
                             std::span<const State> targets, const CommandOptions& options = {}) {
    const auto [indices, bytes] = packed(names, targets);
    return UntypedFrontend::add_commands(indices, bytes, options);
  }
  template <Shareable State>
  std::uint32_t add_commands(std::initializer_list<std::string_view> names,
                             std::initializer_list<State> targets,
                             const CommandOptions& options = {}) {
    return add_commands(std::span(names.begin(), names.size()),
                        std::span<const State>(targets.begin(), targets.size()), options);
  }
  using UntypedFrontend::preview;
  /// Preview of add_command after the newest row; with `initial`, from rest there.
  template <Shareable State>
  TypedPreview<R> preview(std::string_view name, const State& target,
                          const CommandOptions& options = {},
                          const std::type_identity_t<std::optional<State>>& initial = {}) const {
    const auto [indices, bytes] = packed(std::span(&name, 1), std::span(&target, 1));
    if (!initial) return TypedPreview<R>(UntypedFrontend::preview(indices, bytes, options));
    UntypedObservation row = UntypedFrontend::latest();
    const std::uint32_t offset = schema().actuators[indices.front()].offset;
    pack(*initial, row.bytes() + row.layout().desired + offset);
    return TypedPreview<R>(preview_from(row, indices, bytes, options));
  }
  /// The same for several actuators of one state type, a target for each.
  template <Shareable State>
  TypedPreview<R> preview(std::initializer_list<std::string_view> names,
                          std::initializer_list<State> targets,
                          const CommandOptions& options = {}) const {
    const auto [indices, bytes] = packed(std::span(names.begin(), names.size()),
                                         std::span<const State>(targets.begin(), targets.size()));
    return TypedPreview<R>(UntypedFrontend::preview(indices, bytes, options));
  }
  /// Adds one command through all rows, with `options.pace` for each row.
  template <Shareable State>
  std::uint32_t add_trajectory(std::string_view name, std::span<const State> rows,
                               const CommandOptions& options = {.pace = iterations(1)}) {
    const auto [indices, bytes] = packed(std::span(&name, 1), rows);
    return UntypedFrontend::add_trajectory(indices.front(), static_cast<std::uint32_t>(rows.size()),
                                           bytes, options);
  }
  /// Adds a chunk of one actuator; see UntypedFrontend::add_chunk.
  template <Shareable State>
  std::uint32_t add_chunk(std::string_view name, std::span<const std::uint32_t> due,
                          std::span<const State> rows, const ChunkOptions& options) {
    const auto [indices, bytes] = packed(std::span(&name, 1), rows);
    return UntypedFrontend::add_chunk(indices, due, bytes, options);
  }
  using UntypedFrontend::move_to;
  /// Sends one actuator to a target and waits until it is observed there.
  template <Shareable State>
  Observation<R> move_to(std::string_view name, const State& target, const MoveOptions& options,
                         Timeout timeout = std::nullopt) {
    return move_to(std::span(&name, 1), std::span(&target, 1), options, timeout);
  }
  /// The same for several actuators of one state type, a target for each.
  template <Shareable State>
  Observation<R> move_to(std::span<const std::string_view> names, std::span<const State> targets,
                         const MoveOptions& options, Timeout timeout = std::nullopt) {
    const auto [indices, bytes] = packed(names, targets);
    return Observation<R>(UntypedFrontend::move_to(indices, bytes, options, timeout));
  }
  template <Shareable State>
  Observation<R> move_to(std::initializer_list<std::string_view> names,
                         std::initializer_list<State> targets, const MoveOptions& options,
                         Timeout timeout = std::nullopt) {
    return move_to(std::span(names.begin(), names.size()),
                   std::span<const State>(targets.begin(), targets.size()), options, timeout);
  }
  template <Shareable Request>
  std::uint32_t add_request(const Request& request) {
    std::array<std::byte, sizeof(Request)> bytes{};
    pack(request, bytes.data());
    return UntypedFrontend::add_request(request_index(request_name<Request>()), bytes);
  }

  Observation<R> latest() const { return Observation<R>(UntypedFrontend::latest()); }
  Observation<R> wait_for(Iteration k, Timeout timeout = std::chrono::seconds(5)) const {
    return Observation<R>(UntypedFrontend::wait_for(k, timeout));
  }
  Observation<R> pulse_and_wait(Timeout timeout = std::nullopt, const PulseOptions& options = {},
                                const WaitOptions& wait = {}) {
    return Observation<R>(UntypedFrontend::pulse_and_wait(timeout, options, {}, wait));
  }
  Observation<R> burst(std::int64_t count, Timeout timeout = std::chrono::seconds(5),
                       const PulseOptions& options = {}) {
    return Observation<R>(UntypedFrontend::burst(count, timeout, {}, options));
  }

 private:
  void compare() {
    if constexpr (!kIsRunTime<R>) {
      Schema expected;
      describe_types<R>(expected);
      check_types(expected, schema(), segment());
      for (const ActuatorRow& row : expected.actuators) states_.push_back(expected.keys[row.type]);
    }
  }
  /// Indices of the actuators, and the bytes of these targets.
  template <class State>
  std::pair<std::vector<std::uint32_t>, std::vector<std::byte>> packed(
      std::span<const std::string_view> names, std::span<const State> targets) const {
    std::vector<std::uint32_t> indices;
    for (const std::string_view name : names)
      check_state<State>(indices.emplace_back(actuator(name)));
    std::vector<std::byte> bytes(targets.size() * sizeof(State));
    for (std::size_t i = 0; i < targets.size(); ++i) {
      pack(targets[i], bytes.data() + i * sizeof(State));
    }
    return {std::move(indices), std::move(bytes)};
  }
  /// Throws InvalidArgument if State is not the state type of the actuator.
  template <class State>
  void check_state(std::uint32_t index) const {
    if (index >= states_.size() || states_[index] == &describing::kKey<State>) return;
    throw InvalidArgument("the target of actuator '" + schema().actuators[index].name.str() +
                          "' of '" + segment() + "' must have the state type of that actuator");
  }

  std::vector<const void*> states_;  // of each actuator: key of the C++ type of its state
};

template <>
class Frontend<void> : public UntypedFrontend {
 public:
  using UntypedFrontend::UntypedFrontend;
};

}  // namespace o80
