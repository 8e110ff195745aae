#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "o80/describe/options.hpp"
#include "o80/describe/schema.hpp"
#include "o80/robot/table.hpp"
#include "o80/runtime/request_server.hpp"

namespace o80 {

/// Name and text of each value that a robot is started with.
using OptionValues = std::vector<std::pair<std::string, std::string>>;

/// The options a robot knows, from its table.
std::vector<Option> options_of(const RobotTable& table);

/// Throws DriverError if a table was made by another version of o80.
void check_table(const RobotTable& table, const std::string& where);

/// Throws InvalidArgument if the robot has no such option, or one cannot have that text.
void check_options(const RobotTable& table, const OptionValues& options);

/// One living driver behind its table.
///
/// Move-only. The driver is stopped and destroyed with it.
class Robot {
 public:
  /// Constructs the driver, which touches no hardware. Throws InvalidArgument, DriverError.
  Robot(const RobotTable& table, const OptionValues& options);
  Robot(const Robot&) = delete;
  Robot& operator=(const Robot&) = delete;
  ~Robot();

  const RobotTable& table() const { return table_; }
  /// `period`: that the user asks for [ns]; 0 if none was asked for. Throws DriverError.
  Schema describe(std::int64_t period = 0) const;

  // the driver's verbs; false: `fault()` says why
  bool start() noexcept;
  bool wait(std::int64_t due) noexcept;
  bool write(const DesiredView& desired) noexcept;
  bool read(ReadingView& reading) noexcept;
  Served request(std::uint32_t index, const std::byte* payload) noexcept;
  bool halt() noexcept;
  Served resume() noexcept;
  /// Once, and only if a start was tried.
  void stop() noexcept;
  /// What the driver said of a request in its reading.
  static Served served(const RequestReport& report) noexcept;
  const char* fault() const noexcept { return fault_.text; }

 private:
  Served served(RequestAnswer answer, const FaultText& text) noexcept;

  const RobotTable& table_;
  void* driver_ = nullptr;
  FaultText fault_{};
  bool started_ = false;
};

}  // namespace o80
