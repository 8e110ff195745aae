#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "arms/calibration.hpp"
#include "arms/servo_chain.hpp"
#include "o80/robot.hpp"

namespace o80::arms {

inline constexpr std::size_t kServos = 6;
inline constexpr std::size_t kRoll = 4;
inline constexpr std::size_t kGripper = 5;
inline constexpr std::array<const char*, kServos> kJointNames{
    "shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper"};

/// What is wrong with a servo; what stands later weighs more.
enum class Health : std::uint8_t {
  ok,
  voltage,
  encoder,
  heat,
  current,
  overload,
  torque_off,
  silent
};
O80_DESCRIBE_ENUM(Health, ok, voltage, encoder, heat, current, overload, torque_off, silent);

/// What remains when the process has ended.
enum class AtStop : std::uint8_t { hold, relax, rest };
O80_DESCRIBE_ENUM(AtStop, hold, relax, rest);

struct ArmState {
  std::array<double, kServos - 1> joints;
  double gripper;
};
O80_DESCRIBE(ArmState, (joints, "[rad]"), (gripper, "opening, 0 to 1 [1]"));

template <class Number>
using OfServos = std::array<Number, kServos>;

struct Measured {
  OfServos<double> velocity{}, effort{}, temperature{}, voltage{};
};
O80_DESCRIBE(Measured, (velocity, "of the servos [rad/s]"), (effort, "from the load, rough [Nm]"),
             (temperature, "[degC]"), (voltage, "[V]"));

/// What became of the answers.
struct BusLink {
  std::int64_t capture_time = 0;
  std::int64_t age = 0;
  bool fresh = false;
  std::uint32_t late = 0;
  std::uint32_t damaged = 0;
  std::uint32_t lost = 0;
};
O80_DESCRIBE(BusLink, (capture_time, "of the last complete reading [ns]", o80::of_the_clock()),
             (age, "of the last complete reading [ns]", o80::of_the_clock()),
             (fresh, "all servos have answered in this iteration"),
             (late, "answers to a question before"), (damaged, "answers"),
             (lost, "answers that did not come"));

struct ArmSensors {
  Measured measured;
  OfServos<Health> health{};
  BusLink link;
};
O80_DESCRIBE(ArmSensors, measured, health, link);

struct Hold {
  static constexpr std::string_view kHelp = "switch the torque on where the arm is";
};
struct Relax {
  static constexpr std::string_view kHelp =
      "switch the torque off: the arm sinks, can be guided by hand, and desired follows it";
  static constexpr bool kWhileHalted = true;
};
struct Strength {
  static constexpr std::string_view kHelp = "change the strength of all servos but the gripper's";
  double share;
};
struct Recover {
  static constexpr std::string_view kHelp =
      "switch the torque of servos that report a failure off and on";
  static constexpr bool kWhileHalted = true;
};
O80_DESCRIBE(Hold);
O80_DESCRIBE(Relax);
O80_DESCRIBE(Strength, (share, "of the most that the servos can, above 0 up to 1 [1]"));
O80_DESCRIBE(Recover);

/// What tells one arm from another.
struct ArmKind {
  std::unique_ptr<ServoChain> (*chain)(bool leader);
  std::array<const char*, 3> names;       // of LeRobot's folders for it, the newest first; or null
  std::array<double, kGripper> farthest;  // of each joint both ways, whatever its calibration [rad]
};

/// An arm of six bus servos with the manners that all such arms share: what starts, holds, halts
/// and resumes it. A class of its own for each arm says its kind.
///
/// `write` sends goals and the question for readings in one system call, `read` collects the
/// answers a period later. What the driver finds wrong is a halt whose text says what to do; what
/// only a new start can cure is an error of `start`.
class ServoArm {
 public:
  struct Config {
    std::string port;
    std::string calibration;
    bool leader = false;
    AtStop at_stop = AtStop::hold;
    double strength = 1.0;
    double gripper_strength = 0.5;
    double speed_share = 1.0;
    double answer_timeout = 0.0;
  };
  using Actuators = ArmState;
  using Extended = ArmSensors;
  using Requests = o80::Requests<Hold, Relax, Strength, Recover>;

  /// Reads the calibration. Throws std::runtime_error, o80::InvalidArgument.
  ServoArm(const Config& config, const ArmKind& kind);

  void describe(Schema& schema) const;
  void start();
  template <class Arm>
  void write(const Desired<Arm>& desired) noexcept {
    commanded_ = 0;
    for (std::size_t i = 0; i < kServos; ++i) {
      if (desired.active(i)) commanded_ |= Mask{1} << i;
    }
    send(desired.states);
  }
  template <class Arm>
  void read(Reading<Arm>& reading) noexcept {
    receive(reading.observed, reading.extended, reading.time());
    if (relaxed_) {
      reading.follow();
      for (std::size_t i = 0; i < kServos; ++i) {
        if ((commanded_ >> i & 1) != 0) reading.interrupt(i);  // nothing would move
      }
    }
    if (!link_.fresh) reading.missed();
    if (why_[0] != 0) reading.halt(why_.data());
  }
  void halt() noexcept { halted_ = true; }
  Served resume() noexcept;
  void stop() noexcept;

  Served on(const Hold& request) noexcept;
  Served on(const Relax& request) noexcept;
  Served on(const Strength& request) noexcept;
  Served on(const Recover& request) noexcept;

 private:
  using Mask = ServoChain::Mask;
  /// What the driver keeps of a servo.
  struct Servo {
    int position = 0;          // last one that is plausible [steps]
    std::int64_t seen_at = 0;  // [ns]
    int missed = 0;            // transfers in a row without an answer
    int alarmed = 0;           // answers in a row with an alarm
    int jumped = 0;            // implausible positions in a row
    bool without_torque = false;
    bool was_hot = false;  // too hot to be resumed
  };

  // servo_arm_start.cpp
  void tell_ranges(Schema& schema) const;
  void check_servos();
  void check_calibration();
  void tell_doubts() const;
  void check_rate();
  void find_place();
  void refuse_if_gone() const;
  void begin_to_hold();
  void let_go();
  [[noreturn]] void refuse(std::size_t servo, const std::string& why) const;

  // servo_arm.cpp
  void send(const ArmState& desired) noexcept;
  void receive(ArmState& observed, ArmSensors& sensors, std::int64_t time) noexcept;
  double strength_of(std::size_t servo, double share) const noexcept;
  void set_motion(Mask servos, double speed, double acceleration, double strength) noexcept;
  bool holds(std::size_t servo) const noexcept;
  void approach(Mask servos) noexcept;
  void hold(Mask servos) noexcept;
  void settle() noexcept;
  void reopen() noexcept;
  int goal_of(std::size_t servo, const ArmState& desired) const noexcept;
  std::int64_t deadline() const noexcept;
  void take(const ServoChain::Transfer& transfer) noexcept;
  bool is_plausible(std::size_t servo) const noexcept;
  void look_for_trouble(const ServoChain::Transfer& transfer) noexcept;
  void name_alarm(std::size_t servo) noexcept;
  Health health_of(std::size_t servo) const noexcept;
  Mask failing() const noexcept;
  Mask troubled() const noexcept;
  const char* why_not_ready() noexcept;
  void begin_anew() noexcept;
  bool goes_to_rest() noexcept;
  [[gnu::format(printf, 2, 3)]] void because(const char* format, ...) noexcept;

  Config config_;
  ArmKind kind_;
  std::unique_ptr<ServoChain> chain_;
  std::vector<Calibration> calibration_;  // empty: none was found
  mutable std::int64_t period_;           // [ns]
  OfServos<Servo> servos_{};
  OfServos<int> goals_{};         // sent last [steps]
  OfServos<int> start_places_{};  // where the arm stood when it was started [steps]
  OfServos<int> held_places_{};   // while the arm settles [steps]
  std::string lasting_name_;      // of the port
  Mask commanded_ = 0;            // active in the last iteration
  Mask held_ = 0;                 // servos that get goals
  bool started_ = false;
  bool halted_ = false;
  bool relaxed_ = false;
  bool wrote_ = false;            // since the last reading
  int settling_ = 0;              // iterations until full strength
  int closed_ = 0;                // iterations without a port
  int window_ = 0;                // transfers of this second
  int damaged_in_window_ = 0;     // of them
  bool failed_before_ = false;    // the last transfer
  std::int64_t complete_at_ = 0;  // when the last complete reading was asked for [ns]
  BusLink link_;
  std::array<char, 200> why_{};  // of the halt, until somebody resumes
  std::array<char, 200> not_ready_{};
};
O80_DESCRIBE(
    ServoArm::Config, (port, "of the adapter; by default the only one that is plugged in"),
    (calibration, "LeRobot's, by name or path; by default the only one that is there"),
    (leader, "it is moved by hand: its torque stays off"),
    (at_stop,
     "what remains when the process has ended: hold; relax; rest: back to where it was started, "
     "then relax"),
    (strength, "of the joints, above 0 up to 1 [1]"), (gripper_strength, "above 0 up to 1 [1]"),
    (speed_share, "of the limits of speed: less on the first day, above 0 up to 1 [1]"),
    (answer_timeout,
     "after which an answer counts as missing; 0: a quarter more than a period [s]"));

}  // namespace o80::arms
