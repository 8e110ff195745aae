#pragma once

#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <type_traits>

#include "o80/describe/describe.hpp"
#include "o80/robot/table.hpp"
#include "o80/runtime/request_server.hpp"
#include "o80/runtime/robot_types.hpp"

namespace o80 {

/// Offset of a value in a row whose layout is known at run time only.
template <class T>
struct Place {
  std::uint32_t offset = 0;
};

/// The desired states of one iteration, which the driver sends to the hardware in `write`.
template <class D>
class Desired {
 public:
  explicit Desired(const DesiredView& view) : view_(view) {
    if constexpr (!kIsRunTime<D>) {
      states = unpack<ActuatorsOf<D>>(view.states);
    }
  }

  ActuatorsOf<D> states;  // of all actuators

  const auto& operator[](std::size_t actuator) const { return states[actuator]; }
  /// Returns a value of a layout known at run time only.
  template <class T>
  T at(Place<T> place) const {
    return unpack<T>(view_.states + place.offset);
  }
  const std::byte* bytes() const { return view_.states; }
  /// True if a command or braking gave this state; otherwise it is held or follows the observed
  /// state (when_idle).
  bool active(std::size_t actuator) const {
    return (view_.active[actuator / 64] >> (actuator % 64) & 1) != 0;
  }
  /// Velocity of a number of these states, for feed-forward: `desired.rate(desired[0].angle)`.
  /// Difference to the last iteration divided by the period [unit/s], so that summed products with
  /// the period are the position; 0 if the actuator is not active(). Throws for a copied state.
  template <class Number>
  double rate(const Number& number) const {
    return difference(number, 1) / period();
  }
  /// Difference of the velocities of two iterations divided by the period [unit/s^2].
  template <class Number>
  double rate2(const Number& number) const {
    return difference(number, 2) / (period() * period());
  }

  std::int64_t iteration() const { return view_.iteration; }
  /// On the backend's clock [ns].
  std::int64_t time() const { return view_.time; }
  /// Duration of an iteration [s].
  double period() const { return static_cast<double>(view_.period) * 1e-9; }

 private:
  template <class T>
  double difference(const Place<T>& place, std::uint32_t order) const {
    return view_.difference != nullptr ? view_.difference(view_.context, place.offset, order) : 0.0;
  }
  template <class Number>
    requires std::is_arithmetic_v<Number>
  double difference(const Number& number, std::uint32_t order) const {
    const auto at = reinterpret_cast<std::uintptr_t>(&number);
    const auto first = reinterpret_cast<std::uintptr_t>(&states);
    if (at < first || at - first >= sizeof states) {
      throw InvalidArgument("rate() and rate2() need a number of these desired states, not a copy");
    }
    return difference(Place<Number>{static_cast<std::uint32_t>(at - first)}, order);
  }

  DesiredView view_;
};

/// The reading of one iteration; the driver fills it in `read`.
template <class D>
class Reading {
 public:
  explicit Reading(ReadingView& view) : view_(view) {
    if constexpr (!kIsRunTime<D>) {
      observed = unpack<ActuatorsOf<D>>(view.observed);
      if constexpr (!std::is_same_v<ExtendedOf<D>, NoExtended>) {
        extended = unpack<ExtendedOf<D>>(view.extended);
      }
    }
  }

  ActuatorsOf<D> observed;  // initially the last reading
  ExtendedOf<D> extended;   // initially the last reading

  /// Values of a layout known at run time only.
  template <class T>
  void observe(Place<T> place, const T& value) {
    pack(value, view_.observed + place.offset);
  }
  template <class T>
  void extend(Place<T> place, const T& value) {
    pack(value, view_.extended + place.offset);
  }
  std::byte* observed_bytes() { return view_.observed; }
  std::byte* extended_bytes() { return view_.extended; }

  std::int64_t iteration() const { return view_.iteration; }
  /// On the backend's clock [ns].
  std::int64_t time() const { return view_.time; }

  /// Ends the loop as failed; frontends raise BackendFailed with this text.
  void fault(std::string_view text) {
    store_text(fault_.text, text);
    faulty_ = true;
  }
  /// Halts the backend in the next iteration: the actuators brake, and nothing moves until a
  /// frontend resumes. A driver may halt in each reading: a repeated text is the same halt.
  void halt(std::string_view why) {
    store_text(view_.halt_text.text, why);
    view_.halted = 1;
  }
  /// Reports a tick without a reading, for example after a lost packet: the last reading
  /// remains and the iteration counts as an overrun. No effect in bursting mode.
  void missed() { view_.missed = 1; }
  /// Ends the loop in order after this row. In real time the actuators brake first: `write` and
  /// `read` continue for at most 1 s.
  void finish() { view_.finished = 1; }
  /// Ends the commands of this actuator as interrupted, in this iteration.
  void interrupt(std::size_t actuator) {
    view_.interrupted[actuator / 64] |= std::uint64_t{1} << (actuator % 64);
  }
  // requests that `on` answered with `Served::running`
  /// True while a request of this kind runs. A halt may end it: the driver must then stop its
  /// motion.
  template <class Request>
  bool runs() const {
    return report<Request>().runs != 0;
  }
  /// Sets the text that frontends see while the request runs; at most 247 characters.
  template <class Request>
  void progress(std::string_view text) {
    store_report(report<Request>(), RequestAnswer::running, text);
  }
  /// Ends the request with this row: done, rejected (the sender reads the reason), failed (the loop
  /// ends) or start_afresh (with the row of the fresh start). No effect if none of this kind runs.
  template <class Request>
  void ended(const Served& how) {
    store_report(report<Request>(), static_cast<RequestAnswer>(how.kind), how.why());
  }

  /// True in the reading of a fresh start: after a request that answered start_afresh, and after
  /// each resume. False in row 0.
  bool fresh() const { return view_.desired != nullptr; }
  /// Sets the desired states from which a fresh start continues; without it, the observed states.
  /// No effect in other readings.
  template <class Actuators>
  void go_on_from(const Actuators& desired) {
    if (!fresh()) return;
    pack(desired, view_.desired);
    view_.has_desired = 1;
  }
  /// From this fresh start to the next one, every actuator without a command follows the observed
  /// state, whatever its when_idle, and the next command after interrupt() begins there: for an arm
  /// without torque, guided by hand. No effect in other readings.
  void follow() { view_.follows = fresh() ? 1 : 0; }
  std::byte* desired_bytes() {
    view_.has_desired = fresh() ? 1 : 0;
    return view_.desired;
  }

  // for o80, which calls the driver
  bool faulty() const { return faulty_; }
  const FaultText& fault_text() const { return fault_; }
  /// Copies the typed values into the row.
  void store() {
    if constexpr (!kIsRunTime<D>) {
      if constexpr (!std::is_same_v<ActuatorsOf<D>, NoActuators>) pack(observed, view_.observed);
      if constexpr (!std::is_same_v<ExtendedOf<D>, NoExtended>) pack(extended, view_.extended);
    }
  }

 private:
  template <class Request>
  RequestReport& report() const {
    constexpr std::uint32_t kIndex = index_of_request<Request>(RequestsOf<D>{});
    static_assert(kIndex != kNoRequest, "this struct is not among the Requests of the driver");
    return view_.requests[kIndex];
  }
  /// Stores the first end of a request in a reading; later ones are ignored.
  void store_report(RequestReport& report, RequestAnswer answer, std::string_view text) {
    if (report.runs == 0 || (report.changed != 0 && report.answer != RequestAnswer::running))
      return;
    store_text(report.text, text);
    report.answer = answer;
    report.changed = 1;
    view_.reported = 1;
  }

  ReadingView& view_;
  FaultText fault_;
  bool faulty_ = false;
};

/// Requirements on a driver class. There is no base class.
///
/// The constructor must not touch hardware. Optional members:
/// - `describe(Schema&) const` names actuators and sets limits
/// - `Extended`, the type of further sensor values
/// - `Requests` with `on(const Each&)`, which returns void or Served; a request that is answered
///   with `Served::running` ends by `Reading::ended`
/// - `Served on(std::uint32_t request, const std::byte* payload)` serves the requests that
///   `describe` adds to the schema: their numbers follow those of `Requests`
/// - `wait(std::int64_t due)` waits for the robot's tick instead of the clock
/// - `halt()` is called when a halt begins
/// - `resume()` is called before a halt is cleared; it returns void or Served and may refuse
template <class D>
concept Driver = requires(D& driver, const Desired<D>& desired, Reading<D>& reading) {
  typename D::Config;
  typename D::Actuators;
  requires DescribedStruct<typename D::Config>;
  requires std::constructible_from<D, const typename D::Config&>;
  { driver.start() } -> std::same_as<void>;
  { driver.write(desired) } -> std::same_as<void>;
  { driver.read(reading) } -> std::same_as<void>;
  { driver.stop() } noexcept -> std::same_as<void>;
};

}  // namespace o80
