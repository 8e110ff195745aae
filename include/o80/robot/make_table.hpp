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

inline void set_fault(FaultText* fault, const char* text) {
  const std::size_t size = strnlen(text, sizeof fault->text - 1);
  std::memcpy(fault->text, text, size);
  fault->text[size] = 0;
}

/// Calls the driver. An exception is stored as the fault, and the result is `failed`.
template <class Result, class Call>
Result guarded(FaultText* fault, Result failed, Call&& call) noexcept {
  try {
    return call();
  } catch (const std::exception& error) {
    set_fault(fault, error.what());
  } catch (...) {
    set_fault(fault, "the driver threw something that is not a std::exception");
  }
  return failed;
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

inline RequestAnswer answer_of(const Served& served, FaultText* text) {
  set_fault(text, served.text.data());
  return static_cast<RequestAnswer>(served.kind);
}

template <Driver D, class Request>
RequestAnswer serve(D& driver, const std::byte* payload, FaultText* text) {
  if constexpr (requires {
                  { driver.on(unpack<Request>(payload)) } -> std::same_as<Served>;
                }) {
    return answer_of(driver.on(unpack<Request>(payload)), text);
  } else {
    driver.on(unpack<Request>(payload));
    return RequestAnswer::done;
  }
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
      return driving::guarded<int>(fault, 1, [&] {
        static_cast<void>(driving::config_of<D>(values, count));
        return 0;
      });
    };
    t.create = [](void* /*self*/, const OptionValue* values, std::uint32_t count,
                  FaultText* fault) -> void* {
      return driving::guarded<void*>(
          fault, nullptr, [&]() -> void* { return new D(driving::config_of<D>(values, count)); });
    };
    t.describe = [](void* robot, std::int64_t period, void* context, SchemaTaker* take,
                    FaultText* fault) {
      return driving::guarded<int>(fault, 1, [&] {
        Schema schema;
        driving::describe_driver(*static_cast<const D*>(robot), robot_name, period, schema);
        const std::vector<std::byte> bytes = to_bytes(schema);
        take(context, bytes.data(), bytes.size(), schema.hooks.data());
        return 0;
      });
    };
    t.start = [](void* robot, FaultText* fault) {
      return driving::guarded<int>(fault, 1, [&] {
        static_cast<D*>(robot)->start();
        return 0;
      });
    };
    if constexpr (requires(D& driver, std::int64_t due) { driver.wait(due); }) {
      t.paces_itself = 1;
      t.wait = [](void* robot, std::int64_t due, FaultText* fault) {
        return driving::guarded<int>(fault, 1, [&] {
          static_cast<D*>(robot)->wait(due);
          return 0;
        });
      };
    }
    t.write = [](void* robot, const DesiredView* view, FaultText* fault) {
      return driving::guarded<int>(fault, 1, [&] {
        static_cast<D*>(robot)->write(Desired<D>(*view));
        return 0;
      });
    };
    t.read = [](void* robot, ReadingView* view, FaultText* fault) {
      return driving::guarded<int>(fault, 1, [&] {
        Reading<D> reading(*view);
        static_cast<D*>(robot)->read(reading);
        reading.store();
        if (reading.faulty()) driving::set_fault(fault, reading.fault_text().text);
        return reading.faulty() ? 1 : 0;
      });
    };
    t.request = [](void* robot, std::uint32_t index, const std::byte* payload, FaultText* text) {
      return driving::guarded<RequestAnswer>(text, RequestAnswer::failed, [&] {
        D& driver = *static_cast<D*>(robot);
        RequestAnswer answer = RequestAnswer::rejected;
        std::uint32_t i = 0;
        const bool known = [&]<class... Each>(Requests<Each...>) {
          return (
              (i++ == index && (answer = driving::serve<D, Each>(driver, payload, text), true)) ||
              ...);
        }(RequestsOf<D>{});
        if constexpr (requires {
                        { driver.on(index, payload) } -> std::same_as<Served>;
                      }) {
          if (!known) answer = driving::answer_of(driver.on(index, payload), text);
        }
        return answer;
      });
    };
    if constexpr (requires(D& driver) { driver.halt(); }) {
      t.halt = [](void* robot, FaultText* fault) {
        return driving::guarded<int>(fault, 1, [&] {
          static_cast<D*>(robot)->halt();
          return 0;
        });
      };
    }
    if constexpr (requires(D& driver) { driver.resume(); }) {
      t.resume = [](void* robot, FaultText* text) {
        return driving::guarded<RequestAnswer>(text, RequestAnswer::failed, [&] {
          D& driver = *static_cast<D*>(robot);
          if constexpr (requires {
                          { driver.resume() } -> std::same_as<Served>;
                        }) {
            return driving::answer_of(driver.resume(), text);
          } else {
            driver.resume();
            return RequestAnswer::done;
          }
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
        static_cast<void>(driving::guarded<int>(&fault, 1, [&] {
          bytes = static_cast<D*>(robot)->snapshot_bytes(slot);
          return 0;
        }));
        *size = bytes.size();
        return bytes.data();
      };
      t.load_snapshot = [](void* robot, std::uint32_t slot, const std::byte* bytes,
                           std::uint64_t size, FaultText* fault) {
        return driving::guarded<int>(fault, 1, [&] {
          if (static_cast<D*>(robot)->load_snapshot(slot, {bytes, size})) return 0;
          driving::set_fault(fault,
                             "the recorded snapshot is of another robot, or of another "
                             "version of its driver");
          return 1;
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
