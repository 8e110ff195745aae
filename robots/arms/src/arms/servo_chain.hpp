#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "arms/calibration.hpp"
#include "arms/packets.hpp"
#include "arms/serial_port.hpp"

namespace o80::arms {

/// Alarms of a servo: bits of ServoState::status.
enum Alarm : std::uint8_t {
  voltage_alarm = 1,
  encoder_alarm = 2,
  heat_alarm = 4,
  current_alarm = 8,
  overload_alarm = 32
};

/// State of a servo.
struct ServoState {
  // from the last answer
  int position = 0;         // [steps]
  double speed = 0.0;       // [steps/s]
  double effort = 0.0;      // [Nm]
  double voltage = 0.0;     // [V]
  int temperature = 0;      // [degC]
  std::uint8_t status = 0;  // bits of Alarm
  bool torque = false;
  // from the set-up
  int hottest = 70;            // [degC]
  double least_voltage = 0.0;  // [V]
  double most_voltage = 0.0;   // [V]
};

/// Value of a register, in its unit.
struct Setting {
  Register where;
  int value;
};

/// Servos on one line. In the loop a transfer is two calls: `request` sends queued values, goals
/// and the read request in one system call, `collect` receives the answers.
///
/// An old answer never counts: input is discarded before each request. After a failed transfer
/// nothing is sent until the line was silent for the duration of the longest answer, and the next
/// request reads another number of bytes, so that an answer to the previous one has the wrong
/// length. Without any answers requests are rare, which covers answers half a second late.
///
/// Realtime: all below `loop`; nothing allocates, no transfer takes longer than its deadline.
class ServoChain {
 public:
  static constexpr std::size_t kMost = 8;
  using Mask = std::uint32_t;  // a bit for each servo, in the order of the chain

  /// Result of a transfer.
  struct Transfer {
    bool asked = false;
    Mask answered = 0;
    Mask torque_known = 0;      // `torque` is of this transfer
    std::uint32_t late = 0;     // answers to an earlier request, or repeated ones
    std::uint32_t damaged = 0;  // packets
  };

  virtual ~ServoChain() = default;

  // before the loop: these functions wait for answers, with several tries
  /// `patience`: timeout of an answer, if more than 0.1 [s].
  void open(SerialPort port, double patience = 0.0);
  std::optional<int> read(std::size_t servo, Register where);
  /// Reads a servo's torque, if it answers.
  bool find(std::size_t servo);
  /// Identifies a servo. Throws std::runtime_error, whose text continues the servo's name.
  virtual void set_up(std::size_t servo) = 0;
  virtual Calibration calibration_of(std::size_t servo) = 0;
  /// Sends queued values; false if nothing was written.
  bool send_queued() noexcept;

  // loop
  /// Queues a value for some servos for the next request.
  void queue(Register where, Mask servos, std::span<const int> values) noexcept;
  void queue(Register where, Mask servos, int value) noexcept;
  void queue_goals(Mask servos, std::span<const int> goals) noexcept;
  void queue_torque(Mask servos, bool on) noexcept { queue(torque_, servos, on ? 1 : 0); }
  /// Queues speed and acceleration [steps/s, steps/s^2] and share of the strength of each servo.
  virtual void queue_motion(Mask servos, double speed, double acceleration,
                            std::span<const double> strengths) noexcept;
  /// Clears the failures of servos.
  virtual void queue_recovery(Mask servos) noexcept = 0;
  /// Whether that restarts them, so that they lose all settings and the torque.
  virtual bool recovery_restarts() const noexcept { return false; }
  /// Switches the watchdog: capable servos stop 0.1 s after the last request. Switching it on also
  /// ends a stop.
  void watch(bool on) noexcept { queue_watchdog(watched_ = on); }
  /// Sends queued values, goals [steps] for some servos, and a read request.
  void request(Mask servos, std::span<const int> goals) noexcept;
  /// Waits for answers until this time of the monotonic clock [ns].
  Transfer collect(std::int64_t deadline) noexcept;
  bool is_asking() const noexcept { return asking_; }
  /// Time of sending the last request, for which `collect` waits [ns].
  std::int64_t asked_at() const noexcept { return asked_at_; }

  // protocol of a servo
  virtual Setting goal(std::size_t /*servo*/, int position) const noexcept {
    return {goal_, position};
  }
  virtual Setting speed(std::size_t servo, double speed) const noexcept = 0;
  virtual Setting acceleration(double acceleration) const noexcept = 0;
  virtual Setting strength(std::size_t servo, double share) const noexcept = 0;
  /// Remaining strength after an overload [%].
  virtual int strength_of_overloaded(std::size_t servo) const noexcept = 0;

  Setting torque(bool on) const noexcept { return {torque_, on ? 1 : 0}; }
  SerialPort& port() noexcept { return port_; }
  bool has_port() const noexcept { return port_.is_open(); }
  std::size_t count() const noexcept { return count_; }
  Mask all() const noexcept { return (Mask{1} << count_) - 1; }
  const ServoState& operator[](std::size_t servo) const noexcept { return states_[servo]; }

 protected:
  /// Registers of a servo in a read request.
  struct Block {
    std::uint8_t first = 0;
    std::uint8_t size = 0;
  };

  /// Servos have the numbers 1 to `count`. The derived class defines the packets.
  ServoChain(std::size_t count, Requests& requests, Answers& answers, Register torque,
             Register goal);

  /// Adds the read request, and stores the requested registers of each servo. `variant`: each one
  /// has another number of bytes.
  virtual void ask(std::uint8_t variant) noexcept = 0;
  /// Decodes the data of an answer.
  virtual void take(std::size_t servo, const Answer& answer) noexcept = 0;
  virtual void queue_watchdog(bool /*on*/) noexcept {}
  /// Decodes a number of an answer.
  int number(std::size_t servo, const Answer& answer, Register where) const noexcept;
  /// Reads a number of a servo at set-up. Throws std::runtime_error without an answer.
  int needed(std::size_t servo, Register where);

  std::size_t count_;
  std::array<std::uint8_t, kMost> ids_{};
  std::array<ServoState, kMost> states_{};
  std::array<Block, kMost> asked_{};
  bool failed_ = false;        // the last transfer
  std::int64_t asked_at_ = 0;  // [ns]

 private:
  static constexpr std::int64_t kQuiet = 2'000'000;  // longer than an answer, USB included [ns]
  static constexpr std::int64_t kSetUpWait = 100'000'000;  // answer timeout before the loop [ns]
  static constexpr std::int64_t kPause = 50'000'000;       // then servos may have stopped [ns]
  static constexpr int kTries = 3;
  static constexpr int kMissing = 3;                    // transfers without an answer
  static constexpr std::int64_t kRarely = 100'000'000;  // interval of requests from then on [ns]
  static constexpr std::uint8_t kVariants = 8;          // different sizes of consecutive requests

  std::optional<Answer> answer_to(std::size_t servo, std::size_t size);
  void receive() noexcept;
  bool counts(const Answer& answer, Transfer& transfer) noexcept;

  Requests& requests_;
  Answers& answers_;
  Register torque_;
  Register goal_;
  SerialPort port_;
  std::int64_t set_up_wait_ = kSetUpWait;  // [ns]
  std::uint8_t variant_ = 0;               // another one after each failed transfer
  bool watched_ = false;                   // by the servos
  bool asking_ = false;                    // between `request` and `collect`
  int unanswered_ = 0;                     // transfers in a row
  std::int64_t heard_at_ = 0;              // [ns]
};

}  // namespace o80::arms
