#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "o80/runtime/robot_types.hpp"
#include "o80/runtime/typed_frontend.hpp"
#include "robot/group/inline_robot.hpp"

namespace o80 {

/// A bundled robot inside the test, with a frontend.
struct InlineSimulation {
  static constexpr std::int64_t kPeriod = 2'000'000;  // [ns]
  using Row = std::vector<std::byte>;

  InlineSimulation(std::string_view name, const RobotTable& table, const OptionValues& options,
                   std::int64_t period)
      : segment(unused_segment_name(std::string(name))),
        robot(std::make_shared<InlineRobot>(std::make_unique<DriverInstance>(table, options),
                                            BackendOptions{.segment = segment, .period = period})),
        frontend(robot->backend(), robot) {}

  UntypedObservation burst(std::int64_t n) { return frontend.burst(n, std::chrono::seconds(60)); }
  template <class State>
  void ask(std::string_view actuator, const State& state, const CommandOptions& options = {}) {
    std::array<std::byte, sizeof(State)> bytes{};
    pack(state, bytes.data());
    frontend.add_command(frontend.actuator(actuator), bytes, options);
  }
  template <class Request>
  void request(const Request& request) {
    std::array<std::byte, sizeof(Request)> bytes{};
    pack(request, bytes.data());
    frontend.add_request(frontend.request_index(request_name<Request>()), bytes);
  }
  /// The last rows, from their desired states on: without iteration and time.
  std::vector<Row> rows(std::size_t n) {
    const Rows history = frontend.history(n);
    std::vector<Row> all;
    for (std::size_t i = 0; i < history.count; ++i) {
      const auto row = history.row(i).subspan(sizeof(RowHead));
      all.emplace_back(row.begin(), row.end());
    }
    return all;
  }

  std::string segment;
  std::shared_ptr<InlineRobot> robot;
  UntypedFrontend frontend;
};

}  // namespace o80
