#pragma once

#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "o80/describe/options.hpp"
#include "o80/describe/schema.hpp"
#include "o80/robot/table.hpp"
#include "o80/runtime/request_server.hpp"

namespace o80 {

/// Name and text of each option with which a robot is started.
using OptionValues = std::vector<std::pair<std::string, std::string>>;

/// The options of a robot, from its table.
std::vector<Option> options_of(const RobotTable& table);

/// Throws DriverError if the table was built with another version of o80.
void check_table(const RobotTable& table, const std::string& where);

/// Throws InvalidArgument for an unknown option or an invalid value.
void check_options(const RobotTable& table, const OptionValues& options);

/// Each option of the robot with the text that it is started with: the given one, or the default. A
/// Seed that is not given is drawn.
OptionValues effective_options(const RobotTable& table, const OptionValues& given);

/// One driver object behind its table of functions.
///
/// Not copyable. The destructor stops and destroys the driver.
class DriverInstance {
 public:
  /// Constructs the driver, which touches no hardware. Throws InvalidArgument, DriverError.
  DriverInstance(const RobotTable& table, const OptionValues& options);
  DriverInstance& operator=(DriverInstance&&) = delete;
  ~DriverInstance();

  const RobotTable& table() const { return table_; }
  /// The effective options it was started with.
  const OptionValues& options() const { return options_; }
  /// `period`: the period that the user requested [ns]; 0: none. Throws DriverError.
  Schema describe(std::int64_t period = 0) const;

  // the functions of the driver; false: `fault()` has the reason
  bool start() noexcept;
  bool wait(std::int64_t due) noexcept;
  bool write(const DesiredView& desired) noexcept;
  bool read(ReadingView& reading) noexcept;
  Served request(std::uint32_t index, const std::byte* payload) noexcept;
  bool halt() noexcept;
  Served resume() noexcept;
  /// The snapshot in a slot; empty if there is none, or if the driver does not give it.
  std::span<const std::byte> snapshot_bytes(std::uint32_t slot) noexcept;
  /// Fills a slot; false if the driver refuses.
  bool load_snapshot(std::uint32_t slot, std::span<const std::byte> bytes) noexcept;
  /// Calls the driver's stop() once, and only after a call of start().
  void stop() noexcept;
  /// The result that a driver reported for a request in its reading.
  static Served served(const RequestReport& report) noexcept;
  const char* fault() const noexcept { return fault_.text; }

 private:
  static Served served(RequestAnswer answer, std::string_view text) noexcept;
  Served answered(RequestAnswer answer, const FaultText& text) noexcept;

  const RobotTable& table_;
  OptionValues options_;
  void* driver_ = nullptr;
  FaultText fault_{};
  bool started_ = false;
};

}  // namespace o80
