#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <type_traits>

#include "o80/describe/describe.hpp"

namespace o80 {

/// Layout known at run time only: `describe` adds actuators and sensors and stores the
/// returned offsets (Place).
struct RunTimeActuators {};

/// Requests of a robot.
template <class... Each>
struct Requests {
  static_assert((Shareable<Each> && ...),
                "each of o80::Requests must be a struct of numbers that O80_DESCRIBE describes");
};

namespace robot_types {

template <class R>
struct Extended {
  using Type = NoExtended;
};
template <class R>
  requires requires { typename R::Extended; }
struct Extended<R> {
  using Type = typename R::Extended;
};
template <class R>
struct RequestsIn {
  using Type = Requests<>;
};
template <class R>
  requires requires { typename R::Requests; }
struct RequestsIn<R> {
  using Type = typename R::Requests;
};

}  // namespace robot_types

/// Types of a robot: members of the driver class, or of any struct with the same members.
template <class R>
using ActuatorsOf = typename R::Actuators;
template <class R>
using ExtendedOf = typename robot_types::Extended<R>::Type;
template <class R>
using RequestsOf = typename robot_types::RequestsIn<R>::Type;
template <class R>
inline constexpr bool kIsRunTime = std::is_same_v<ActuatorsOf<R>, RunTimeActuators>;

inline constexpr std::uint32_t kNoRequest = 0xFFFFFFFF;

/// Index of a struct among the requests of a robot.
template <class Request, class... Each>
consteval std::uint32_t index_of_request(Requests<Each...>) {
  std::uint32_t place = 0;
  const bool found = ((std::is_same_v<Request, Each> || (++place, false)) || ...);
  return found ? place : kNoRequest;
}

/// Name of a request: the struct's name in snake_case, "Home" => "home", "LaunchBall" =>
/// "launch_ball".
template <Shareable Request>
std::string request_name() {
  std::string_view type = o80_type_name(Tag<Request>{});
  const auto colon = type.rfind(':');
  if (colon != std::string_view::npos) type.remove_prefix(colon + 1);
  std::string name;
  for (const char c : type) {
    const bool upper = c >= 'A' && c <= 'Z';
    if (upper && !name.empty()) name += '_';
    name += upper ? static_cast<char>(c - 'A' + 'a') : c;
  }
  return name;
}

/// Help of a request: `static constexpr std::string_view kHelp` of the struct, if any.
template <Shareable Request>
constexpr std::string_view request_help() {
  if constexpr (requires { std::string_view(Request::kHelp); }) {
    return Request::kHelp;
  } else {
    return "";
  }
}

/// True if a request is served during a halt: `static constexpr bool kWhileHalted` of the struct,
/// if any.
template <Shareable Request>
constexpr bool request_while_halted() {
  if constexpr (requires { bool{Request::kWhileHalted}; }) {
    return Request::kWhileHalted;
  } else {
    return false;
  }
}

/// Adds the types of a robot to a schema: actuators, sensor values, requests.
template <class R>
void describe_types(Schema& schema) {
  if constexpr (!kIsRunTime<R>) describe_actuators<ActuatorsOf<R>>(schema);
  describe_extended<ExtendedOf<R>>(schema);
  [&]<class... Each>(Requests<Each...>) {
    (schema.add_request(request_name<Each>(), describing::type_of<Each>(schema),
                        request_help<Each>(), request_while_halted<Each>()),
     ...);
  }(RequestsOf<R>{});
}

}  // namespace o80
