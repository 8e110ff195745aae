#pragma once

#include <concepts>
#include <cstdint>
#include <type_traits>
#include <utility>

#include "o80/describe/describe.hpp"
#include "o80/robot/driver.hpp"
#include "o80/runtime/request_server.hpp"
#include "o80/runtime/robot_types.hpp"

// Compile-time checks of a driver class. A part that is missing, has a wrong signature or a
// misspelled name gives one error with one sentence. Without these checks the compiler would
// silently ignore an optional part with such a mistake.

namespace o80::driver_checks {

// has_name<D>(): true if D has a member of that name, of any kind, also a private one. Method: a
// class that inherits the name from D and from another class has an ambiguous member.
// NOLINTBEGIN(readability-identifier-naming)
#define O80_MEMBER(name)                                               \
  struct With_##name {                                                 \
    int name;                                                          \
  };                                                                   \
  template <class D>                                                   \
  struct Twice_##name : D, With_##name {};                             \
  template <class D>                                                   \
  consteval bool has_##name() {                                        \
    if constexpr (std::is_final_v<D>) {                                \
      return requires { &D::name; } || requires { typename D::name; }; \
    } else {                                                           \
      return !requires { &Twice_##name<D>::name; };                    \
    }                                                                  \
  }
O80_MEMBER(describe)
O80_MEMBER(wait)
O80_MEMBER(halt)
O80_MEMBER(resume)
O80_MEMBER(on)
O80_MEMBER(Requests)
O80_MEMBER(Extended)
#undef O80_MEMBER
// NOLINTEND(readability-identifier-naming)

template <class T>
struct IsRequests : std::false_type {};
template <class... Each>
struct IsRequests<Requests<Each...>> : std::true_type {};

template <class T>
concept NothingOrServed = std::same_as<T, void> || std::same_as<T, Served>;

template <class D, class Request>
concept Serves = requires(D& driver, const Request& request) {
  { driver.on(request) } -> NothingOrServed;
};

template <class D>
consteval bool serves_all() {
  return []<class... Each>(Requests<Each...>) { return (Serves<D, Each> && ...); }(RequestsOf<D>{});
}

#define O80_TYPE(name) requires { typename D::name; }
template <class D>
consteval bool config_is_described() {
  if constexpr (O80_TYPE(Config)) return DescribedStruct<typename D::Config>;
  return true;  // a missing Config has its own error
}

template <class D>
consteval bool actuators_are_states() {
  if constexpr (O80_TYPE(Actuators)) {
    using Actuators = typename D::Actuators;
    if constexpr (describing::ArrayOf<Actuators>::value) {
      using State = typename describing::ArrayOf<Actuators>::Element;
      return Shareable<State> || DescribedStruct<State>;  // the members are checked one by one
    } else {
      return std::is_same_v<Actuators, NoActuators> ||
             std::is_same_v<Actuators, RunTimeActuators> || DescribedStruct<Actuators>;
    }
  }
  return true;  // missing: reported before
}

/// The static assertions name the members that cannot be shared.
template <class D>
consteval bool states_cross_memory() {
  if constexpr (O80_TYPE(Actuators)) {
    using Actuators = typename D::Actuators;
    if constexpr (actuators_are_states<D>() && !std::is_same_v<Actuators, NoActuators> &&
                  !std::is_same_v<Actuators, RunTimeActuators>) {
      return describing::kCrossesMemory<Actuators, int>;
    }
  }
  return true;  // or reported before
}

/// The required types of a driver.
template <class D>
struct Parts {
  static_assert(O80_TYPE(Config), "a driver needs a public `struct Config`, empty or with fields");
  static_assert(
      config_is_described<D>(),
      "a driver's Config must be described: `O80_DESCRIBE(Arm::Config, (gain, \"help\"));`, or "
      "`O80_DESCRIBE(Arm::Config);` if it is empty, in the namespace of Arm");
  static_assert(O80_TYPE(Actuators),
                "a driver needs a public `using Actuators = std::array<Joint, 4>;`, a described "
                "struct of actuators, o80::NoActuators or o80::RunTimeActuators");
  static_assert(
      actuators_are_states<D>(),
      "a driver's Actuators must be a std::array of states or a described struct of them; "
      "a state is a number, a described enum or a struct that O80_DESCRIBE describes");
  static_assert(states_cross_memory<D>(), "a state must be a plain struct of numbers");
  static constexpr bool kPassed = true;
};

/// The required functions of a driver. They must return void: o80 would ignore a result.
template <class D>
struct NeededVerbs {
  static_assert(std::constructible_from<D, const typename D::Config&>,
                "a driver needs a public constructor `explicit Arm(const Config& config)`");
  static_assert(
      requires(D& driver) {
        { driver.start() } -> std::same_as<void>;
      }, "a driver needs `void start()`, public; it throws if it cannot start");
  static_assert(
      requires(D& driver, const Desired<D>& desired) {
        { driver.write(desired) } -> std::same_as<void>;
      }, "a driver needs `void write(const o80::Desired<Arm>& desired)`, public");
  static_assert(
      requires(D& driver, Reading<D>& reading) {
        { driver.read(reading) } -> std::same_as<void>;
      },
      "a driver needs `void read(o80::Reading<Arm>& reading)`, public; it reports a failure by "
      "`reading.fault(text)`");
  static_assert(
      requires(D& driver) {
        { driver.stop() } noexcept -> std::same_as<void>;
      }, "a driver needs `void stop() noexcept`, public");
  static constexpr bool kPassed = true;
};

#define O80_VERB(name) requires { &D::name; }
/// The optional functions: if present, they must have the expected signature.
template <class D>
struct Verbs {
  static_assert(
      !has_describe<D>() || requires(const D& driver, Schema& schema) {
        { driver.describe(schema) } -> std::same_as<void>;
      }, "a driver's describe must be `void describe(o80::Schema& schema) const`, and public");
  // braces refuse a parameter type that is too narrow for nanoseconds
  static_assert(
      !has_wait<D>() ||
          requires(D& driver, std::int64_t due) {
            { driver.wait({due}) } -> std::same_as<void>;
          },
      "a driver's wait must be `void wait(std::int64_t due)` (nanoseconds of the monotonic clock), "
      "and public");
  static_assert(
      !has_halt<D>() || requires(D& driver) {
        { driver.halt() } -> std::same_as<void>;
      }, "a driver's halt must be `void halt()`, and public");
  static_assert(
      !has_resume<D>() || requires(D& driver) {
        { driver.resume() } -> NothingOrServed;
      }, "a driver's resume must be `void resume()` or `o80::Served resume()`, and public");

  static_assert(has_describe<D>() ||
                    !(O80_VERB(Describe) || O80_VERB(describes) || O80_VERB(descibe) ||
                      O80_VERB(desribe) || O80_VERB(discribe)),
                "this driver has `Describe`, `describes`, `descibe`, `desribe` or `discribe`: "
                "rename it to `describe`");
  static_assert(has_wait<D>() || !(O80_VERB(Wait) || O80_VERB(waits)),
                "this driver has `Wait` or `waits`: rename it to `wait`");
  static_assert(has_halt<D>() || !(O80_VERB(Halt) || O80_VERB(on_halt) || O80_VERB(onHalt)),
                "this driver has `Halt`, `on_halt` or `onHalt`: rename it to `halt`");
  static_assert(has_resume<D>() || !(O80_VERB(Resume) || O80_VERB(on_resume) ||
                                     O80_VERB(onResume) || O80_VERB(resme) || O80_VERB(reusme)),
                "this driver has `Resume`, `on_resume`, `onResume`, `resme` or `reusme`: rename it "
                "to `resume`");
  static constexpr bool kPassed = true;
};

/// The optional types: if present, they must be usable, and no name may be misspelled.
template <class D>
struct Types {
  static_assert(!has_Requests<D>() || O80_TYPE(Requests), "a driver's Requests must be public");
  static_assert(IsRequests<RequestsOf<D>>::value,
                "a driver's Requests must be `o80::Requests<...>` of structs that O80_DESCRIBE "
                "describes");
  static_assert(!has_Extended<D>() || O80_TYPE(Extended), "a driver's Extended must be public");
  static_assert(std::is_same_v<ExtendedOf<D>, NoExtended> ||
                    (DescribedStruct<ExtendedOf<D>> && Shareable<ExtendedOf<D>>),
                "a driver's Extended must be a struct of numbers that O80_DESCRIBE describes in "
                "its namespace");
  static_assert(has_Requests<D>() ||
                    !(O80_TYPE(Request) || O80_TYPE(requests) || O80_TYPE(Requets) ||
                      O80_TYPE(Reqests) || O80_TYPE(Requsets) || O80_TYPE(Reqeusts)),
                "a driver lists its requests as `using Requests = o80::Requests<...>`: rename this "
                "type to `Requests`");
  static_assert(has_Extended<D>() ||
                    !(O80_TYPE(Extension) || O80_TYPE(Extensions) || O80_TYPE(Extend) ||
                      O80_TYPE(Extends) || O80_TYPE(extended) || O80_TYPE(Extented)),
                "a driver names its sensor values by `using Extended = ...`: rename this type to "
                "`Extended`");
  static constexpr bool kPassed = true;
};
#undef O80_TYPE
#undef O80_VERB

template <class D>
struct Handlers {
  static_assert(has_Requests<D>() || !has_on<D>(),
                "a driver with `on(...)` must list its requests: `using Requests = "
                "o80::Requests<Home>;`");
  static_assert(serves_all<D>(),
                "each struct in a driver's Requests needs `void on(const Each&)` or `o80::Served "
                "on(const Each&)`, public");
  static constexpr bool kPassed = true;
};

}  // namespace o80::driver_checks

namespace o80 {

/// True; fails to compile for a driver class with a mistake.
template <class D>
inline constexpr bool kDriverPassed =
    driver_checks::Parts<D>::kPassed && driver_checks::NeededVerbs<D>::kPassed &&
    driver_checks::Types<D>::kPassed && driver_checks::Verbs<D>::kPassed &&
    driver_checks::Handlers<D>::kPassed;

}  // namespace o80
