#pragma once

#include <exception>
#include <memory>
#include <string>

#include "o80/base/version.hpp"
#include "o80/describe/options.hpp"
#include "o80/robot/driver.hpp"
#include "o80/robot/driver_checks.hpp"
#include "o80/robot/table.hpp"

/// Makes a shared library a robot. Use once, at global scope: O80_ROBOT(arm, Arm). The first
/// argument names the robot and its default segment.
#define O80_ROBOT(robot, DriverType) O80_ROBOT_WITH(robot, DriverType, "")

/// As O80_ROBOT, with versions of other libraries in the robot's build ("mujoco 4.0.1").
#define O80_ROBOT_WITH(robot, DriverType, versions)                                             \
  static_assert(::o80::kDriverPassed<DriverType>);                                              \
  extern "C" __attribute__((visibility("default"))) const ::o80::RobotTable* o80_robot_table(); \
  const ::o80::RobotTable* o80_robot_table() {                                                  \
    return ::o80::robot_table<DriverType>(#robot, versions);                                    \
  }

namespace o80 {

namespace driving {

/// Calls the driver. An exception is stored as the fault, and the result is `failed`.
template <class Result, class Call>
Result guarded(FaultText* fault, Result failed, Call&& call) noexcept {
  try {
    return call();
  } catch (const std::exception& error) {
    store_text(fault->text, error.what());
  } catch (...) {
    store_text(fault->text, "the driver threw something that is not a std::exception");
  }
  return failed;
}

/// The same for functions that return 0, or 1 with a fault.
template <class Call>
int done(FaultText* fault, Call&& call) noexcept {
  return guarded(fault, 1, [&] {
    call();
    return 0;
  });
}

template <Driver D>
void describe_driver(const D& driver, const char* name, std::int64_t period, Schema& schema) {
  schema.head.robot = NameText(name);
  schema.head.period = period;
  describe_types<D>(schema);
  if constexpr (requires { driver.describe(schema); }) driver.describe(schema);
  schema.head.block = round_up(schema.head.block, 8);
}

template <Driver D>
typename D::Config config_of(const OptionValue* values, std::uint32_t count) {
  typename D::Config config;
  for (std::uint32_t i = 0; i < count; ++i) set_option(config, values[i].name, values[i].text);
  return config;
}

/// Calls a function of the driver that returns void or Served.
template <class Call>
RequestAnswer answer(FaultText* text, Call&& call) {
  if constexpr (std::is_void_v<decltype(call())>) {
    call();
    return RequestAnswer::done;
  } else {
    const Served served = call();
    store_text(text->text, served.why());
    return static_cast<RequestAnswer>(served.kind);
  }
}
template <class Request, class D>
RequestAnswer serve(D& driver, const std::byte* payload, FaultText* text) {
  return answer(text, [&] { return driver.on(unpack<Request>(payload)); });
}
static_assert(static_cast<int>(RequestAnswer::rejected) ==
                  static_cast<int>(Served::Kind::rejected) &&
              static_cast<int>(RequestAnswer::start_afresh) ==
                  static_cast<int>(Served::Kind::start_afresh) &&
              static_cast<int>(RequestAnswer::failed) == static_cast<int>(Served::Kind::failed) &&
              static_cast<int>(RequestAnswer::running) == static_cast<int>(Served::Kind::running));

}  // namespace driving

/// Makes the table of functions of a driver class.
template <class D>
const RobotTable* robot_table(const char* name, const char* versions = "") {
  static_assert(kDriverPassed<D> && Driver<D>);
  static const char* robot_name = name;
  static const std::string built_with =
      std::string("o80 ") + O80_VERSION + (*versions == 0 ? "" : std::string("; ") + versions);
  static const RobotTable table = [] {
    RobotTable t{};
    t.version = kRobotTableVersion;
    t.size = sizeof(RobotTable);
    t.row_sizes = kSchemaRowSizes;
    t.name = robot_name;
    t.built_with = built_with.c_str();
    t.options = [](void* /*self*/, void* context, void (*each)(void*, const OptionRow*)) {
      for (const Option& option : options_of<typename D::Config>()) {
        const OptionRow row{option.name.c_str(), option.kind.c_str(), option.default_text.c_str(),
                            option.help.c_str(), option.unit.c_str()};
        each(context, &row);
      }
    };
    t.accepts = [](void* /*self*/, const OptionValue* values, std::uint32_t count,
                   FaultText* fault) {
      return driving::done(fault, [&] { static_cast<void>(driving::config_of<D>(values, count)); });
    };
    t.create = [](void* /*self*/, const OptionValue* values, std::uint32_t count,
                  FaultText* fault) -> void* {
      return driving::guarded<void*>(
          fault, nullptr, [&]() -> void* { return new D(driving::config_of<D>(values, count)); });
    };
    t.describe = [](void* robot, std::int64_t period, void* context, SchemaTaker* take,
                    FaultText* fault) {
      return driving::done(fault, [&] {
        Schema schema;
        driving::describe_driver(*static_cast<const D*>(robot), robot_name, period, schema);
        const std::vector<std::byte> bytes = to_bytes(schema);
        take(context, bytes.data(), bytes.size(), schema.hooks.data());
      });
    };
    t.start = [](void* robot, FaultText* fault) {
      return driving::done(fault, [&] { static_cast<D*>(robot)->start(); });
    };
    if constexpr (requires(D& driver, std::int64_t due) { driver.wait(due); }) {
      t.paces_itself = 1;
      t.wait = [](void* robot, std::int64_t due, FaultText* fault) {
        return driving::done(fault, [&] { static_cast<D*>(robot)->wait(due); });
      };
    }
    t.write = [](void* robot, const DesiredView* view, FaultText* fault) {
      return driving::done(fault, [&] { static_cast<D*>(robot)->write(Desired<D>(*view)); });
    };
    t.read = [](void* robot, ReadingView* view, FaultText* fault) {
      return driving::guarded(fault, 1, [&] {
        Reading<D> reading(*view);
        static_cast<D*>(robot)->read(reading);
        reading.store();
        if (reading.faulty()) *fault = reading.fault_text();
        return reading.faulty() ? 1 : 0;
      });
    };
    t.request = [](void* robot, std::uint32_t index, const std::byte* payload, FaultText* text) {
      return driving::guarded<RequestAnswer>(text, RequestAnswer::failed, [&] {
        D& driver = *static_cast<D*>(robot);
        RequestAnswer answer = RequestAnswer::rejected;
        std::uint32_t i = 0;
        const bool known = [&]<class... Each>(Requests<Each...>) {
          return ((i++ == index && (answer = driving::serve<Each>(driver, payload, text), true)) ||
                  ...);
        }(RequestsOf<D>{});
        if constexpr (requires {
                        { driver.on(index, payload) } -> std::same_as<Served>;
                      }) {
          if (!known) answer = driving::answer(text, [&] { return driver.on(index, payload); });
        }
        return answer;
      });
    };
    if constexpr (requires(D& driver) { driver.halt(); }) {
      t.halt = [](void* robot, FaultText* fault) {
        return driving::done(fault, [&] { static_cast<D*>(robot)->halt(); });
      };
    }
    if constexpr (requires(D& driver) { driver.resume(); }) {
      t.resume = [](void* robot, FaultText* text) {
        return driving::guarded<RequestAnswer>(text, RequestAnswer::failed, [&] {
          return driving::answer(text, [&] { return static_cast<D*>(robot)->resume(); });
        });
      };
    }
    if constexpr (requires(D& driver, std::uint32_t slot, std::span<const std::byte> bytes) {
                    { driver.snapshot_bytes(slot) } -> std::same_as<std::span<const std::byte>>;
                    { driver.load_snapshot(slot, bytes) } -> std::same_as<bool>;
                  }) {
      t.snapshot_bytes = [](void* robot, std::uint32_t slot,
                            std::uint64_t* size) -> const std::byte* {
        std::span<const std::byte> bytes;
        FaultText fault;
        driving::done(&fault, [&] { bytes = static_cast<D*>(robot)->snapshot_bytes(slot); });
        *size = bytes.size();
        return bytes.data();
      };
      t.load_snapshot = [](void* robot, std::uint32_t slot, const std::byte* bytes,
                           std::uint64_t size, FaultText* fault) {
        return driving::done(fault, [&] {
          if (static_cast<D*>(robot)->load_snapshot(slot, {bytes, size})) return;
          throw DriverError(
              "the recorded snapshot is of another robot, or of another version of its driver");
        });
      };
    }
    t.stop = [](void* robot) { static_cast<D*>(robot)->stop(); };
    t.destroy = [](void* robot) { delete static_cast<D*>(robot); };
    return t;
  }();
  return &table;
}

}  // namespace o80
