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

/// What a servo may complain about: bits of ServoState::status.
enum Alarm : std::uint8_t {
  voltage_alarm = 1,
  encoder_alarm = 2,
  heat_alarm = 4,
  current_alarm = 8,
  overload_alarm = 32
};

/// What is known of a servo.
struct ServoState {
  // of its last answer
  int position = 0;         // [steps]
  double speed = 0.0;       // [steps/s]
  double effort = 0.0;      // [Nm]
  double voltage = 0.0;     // [V]
  int temperature = 0;      // [degC]
  std::uint8_t status = 0;  // bits of Alarm
  bool torque = false;
  // from its set-up
  int hottest = 70;            // [degC]
  double least_voltage = 0.0;  // [V]
  double most_voltage = 0.0;   // [V]
};

/// A number for a register, in its unit.
struct Setting {
  Register where;
  int value;
};

/// Servos on one line. In the loop a transfer is two calls: `request` sends what was queued, goals
/// and the question in one system call, `collect` takes the answers.
///
/// An old answer never counts: input is discarded before each request; after a failed transfer
/// nothing is sent until the line was silent for as long as the longest answer takes, and the next
/// question asks for another number of bytes, so that an answer to the one before is known by its
/// length. Where nobody answers it asks rarely, so that this holds for answers half a second late.
///
/// Realtime: all below `loop`; nothing allocates, no transfer takes longer than its deadline.
class ServoChain {
 public:
  static constexpr std::size_t kMost = 8;
  using Mask = std::uint32_t;  // a bit for each servo, in the order of the chain

  /// What became of a transfer.
  struct Transfer {
    bool asked = false;
    Mask answered = 0;
    Mask torque_known = 0;      // `torque` is of this transfer
    std::uint32_t late = 0;     // answers to a question before, or twice
    std::uint32_t damaged = 0;  // packets
  };

  virtual ~ServoChain() = default;

  // before the loop: these wait for answers, with several tries
  /// `patience`: for an answer, if it is more than 0.1 [s].
  void open(SerialPort port, double patience = 0.0);
  std::optional<int> read(std::size_t servo, Register where);
  /// Whether a servo answers, and its torque.
  bool find(std::size_t servo);
  /// Looks what a servo is. Throws std::runtime_error, whose text goes on behind its name.
  virtual void set_up(std::size_t servo) = 0;
  virtual Calibration calibration_of(std::size_t servo) = 0;
  /// Sends what was queued; false if it does not leave.
  bool send_queued() noexcept;

  // loop
  /// Puts a value for some servos into the next request.
  void queue(Register where, Mask servos, std::span<const int> values) noexcept;
  void queue(Register where, Mask servos, int value) noexcept;
  void queue_goals(Mask servos, std::span<const int> goals) noexcept;
  void queue_torque(Mask servos, bool on) noexcept { queue(torque_, servos, on ? 1 : 0); }
  /// How fast [steps/s, steps/s^2] and with which share of its strength each servo moves.
  virtual void queue_motion(Mask servos, double speed, double acceleration,
                            std::span<const double> strengths) noexcept;
  /// Ends the failures of servos.
  virtual void queue_recovery(Mask servos) noexcept = 0;
  /// It restarts them: they have forgotten what they were told, and have no torque.
  virtual bool recovery_restarts() const noexcept { return false; }
  /// Servos that can do so stop when nothing was asked of them for 0.1 s. Switching it on ends a
  /// stop, too.
  void watch(bool on) noexcept { queue_watchdog(watched_ = on); }
  /// Goals in steps for some of the servos.
  void request(Mask servos, std::span<const int> goals) noexcept;
  /// Waits for answers until this moment of the monotonic clock [ns].
  Transfer collect(std::int64_t deadline) noexcept;
  bool is_asking() const noexcept { return asking_; }
  /// When the request left that `collect` waits for, or has waited for last [ns].
  std::int64_t asked_at() const noexcept { return asked_at_; }

  // what a servo understands
  virtual Setting goal(std::size_t /*servo*/, int position) const noexcept {
    return {goal_, position};
  }
  virtual Setting speed(std::size_t servo, double speed) const noexcept = 0;
  virtual Setting acceleration(double acceleration) const noexcept = 0;
  virtual Setting strength(std::size_t servo, double share) const noexcept = 0;
  /// What remains of its strength when it is overloaded [%].
  virtual int strength_of_overloaded(std::size_t servo) const noexcept = 0;

  Setting torque(bool on) const noexcept { return {torque_, on ? 1 : 0}; }
  SerialPort& port() noexcept { return port_; }
  bool has_port() const noexcept { return port_.is_open(); }
  std::size_t count() const noexcept { return count_; }
  Mask all() const noexcept { return (Mask{1} << count_) - 1; }
  const ServoState& operator[](std::size_t servo) const noexcept { return states_[servo]; }

 protected:
  /// Registers of a servo that a question asks for.
  struct Block {
    std::uint8_t first = 0;
    std::uint8_t size = 0;
  };

  /// Servos have the numbers 1 to `count`. The packets are those of the class that derives.
  ServoChain(std::size_t count, Requests& requests, Answers& answers, Register torque,
             Register goal);

  /// Puts the question into the request, and notes what it asks of each servo. `variant`: another
  /// one asks for another number of bytes.
  virtual void ask(std::uint8_t variant) noexcept = 0;
  /// Takes the data of an answer.
  virtual void take(std::size_t servo, const Answer& answer) noexcept = 0;
  virtual void queue_watchdog(bool /*on*/) noexcept {}
  /// A number in an answer to the question.
  int number(std::size_t servo, const Answer& answer, Register where) const noexcept;
  /// A number of a servo in its set-up. Throws std::runtime_error if it does not answer.
  int needed(std::size_t servo, Register where);

  std::size_t count_;
  std::array<std::uint8_t, kMost> ids_{};
  std::array<ServoState, kMost> states_{};
  std::array<Block, kMost> asked_{};
  bool failed_ = false;        // the last transfer
  std::int64_t asked_at_ = 0;  // [ns]

 private:
  static constexpr std::int64_t kQuiet = 2'000'000;  // longer than an answer, USB included [ns]
  static constexpr std::int64_t kSetUpWait = 100'000'000;  // for an answer before the loop [ns]
  static constexpr std::int64_t kPause = 50'000'000;  // after which servos may have stopped [ns]
  static constexpr int kTries = 3;
  static constexpr int kMissing = 3;                    // transfers without an answer
  static constexpr std::int64_t kRarely = 100'000'000;  // between questions from then on [ns]
  static constexpr std::uint8_t kVariants = 8;  // numbers of bytes that tell questions apart

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
