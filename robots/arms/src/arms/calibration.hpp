#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <string>
#include <vector>

namespace o80::arms {

/// Calibration of a joint from LeRobot's file: converts steps of a servo to an angle.
struct Calibration {
  int offset = 0;    // register 31
  int smallest = 0;  // registers 9 and 11 [steps]
  int largest = 4095;

  /// LeRobot's degrees in radians: 0 is the middle of the range, and a turn has 4095 steps.
  static constexpr double kStep = 2.0 * std::numbers::pi / 4095.0;  // [rad]
  double middle() const noexcept { return (smallest + largest) / 2.0; }
  double width() const noexcept { return largest - smallest; }  // [steps]
  double angle(double steps) const noexcept { return (steps - middle()) * kStep; }
  double steps(double angle) const noexcept { return angle / kStep + middle(); }
  /// 0 at the smallest position, 1 at the largest.
  double share(double steps) const noexcept { return (steps - smallest) / width(); }
  double steps_of_share(double share) const noexcept { return smallest + share * width(); }

  bool operator==(const Calibration&) const = default;
};

/// Reads a calibration file of LeRobot. `joints`: in the order of their servos, which have the
/// numbers 1, 2, ... Throws std::runtime_error, which names the file and the fault.
std::vector<Calibration> read_calibration(const std::string& path,
                                          const std::vector<std::string>& joints);

/// Finds the file of a name in LeRobot's folders for this type of arm; a path is returned
/// unchanged. Empty name: the only file, or an empty path. Throws std::runtime_error.
std::string find_calibration(const std::string& name, const std::vector<std::string>& folders);

}  // namespace o80::arms
