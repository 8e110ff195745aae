#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "arms/feetech.hpp"
#include "arms/serial_port.hpp"

namespace o80::arms {

/// What a servo said last, as its registers have it.
struct ServoState {
  int position = 0;              // [steps]
  int speed = 0;                 // [steps/s]
  int load = 0;                  // [0.1 %]
  std::uint8_t voltage = 0;      // [0.1 V]
  std::uint8_t temperature = 0;  // [degC]
  std::uint8_t status = 0;       // bits of feetech::Alarm
  bool torque = false;
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
class FeetechChain {
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

  /// Servos have the numbers 1 to `count`.
  explicit FeetechChain(std::size_t count) : count_(count) {
    for (std::size_t i = 0; i < count; ++i) ids_[i] = static_cast<std::uint8_t>(i + 1);
  }

  // before the loop: these wait for answers, with several tries
  /// `patience`: for an answer, if it is more than 0.1 [s].
  void open(SerialPort port, double patience = 0.0);
  bool ping(std::size_t servo);
  std::optional<int> read(std::size_t servo, feetech::Register where);
  /// Sends what was queued; false if it does not leave.
  bool send_queued() noexcept;

  // loop
  /// Puts a value for some servos into the next request.
  void queue(feetech::Register where, Mask servos, std::span<const std::uint16_t> values) noexcept;
  void queue(feetech::Register where, Mask servos, std::uint16_t value) noexcept;
  /// Goals in steps for some of the servos.
  void request(Mask servos, std::span<const int> goals) noexcept;
  /// Waits for answers until this moment of the monotonic clock [ns].
  Transfer collect(std::int64_t deadline) noexcept;
  bool is_asking() const noexcept { return asking_; }
  /// When the request left that `collect` waits for, or has waited for last [ns].
  std::int64_t asked_at() const noexcept { return asked_at_; }

  SerialPort& port() noexcept { return port_; }
  std::size_t count() const noexcept { return count_; }
  Mask all() const noexcept { return (Mask{1} << count_) - 1; }
  const ServoState& operator[](std::size_t servo) const noexcept { return states_[servo]; }

 private:
  static constexpr std::int64_t kQuiet = 2'000'000;  // longer than an answer, USB included [ns]
  static constexpr std::int64_t kSetUpWait = 100'000'000;  // for an answer before the loop [ns]
  static constexpr int kTries = 3;
  static constexpr int kMissing = 3;                    // transfers without an answer
  static constexpr std::int64_t kRarely = 100'000'000;  // between questions from then on [ns]
  static constexpr int kTorqueEvery = 10;               // transfers
  static constexpr std::uint8_t kShortest = 8;          // position to temperature [bytes]
  static constexpr std::uint8_t kLengths = 8;  // numbers of bytes that tell questions apart

  std::optional<feetech::Answer> answer_to(std::size_t servo, std::size_t size);
  void receive() noexcept;
  bool take(const feetech::Answer& answer, Transfer& transfer) noexcept;

  SerialPort port_;
  std::int64_t set_up_wait_ = kSetUpWait;  // [ns]
  std::size_t count_;
  std::array<std::uint8_t, kMost> ids_{};
  std::array<ServoState, kMost> states_{};
  feetech::Requests requests_;
  feetech::Answers answers_;
  std::uint8_t question_ = 0;    // 0 to kLengths - 1, another one after each failed transfer
  std::uint8_t asked_size_ = 0;  // [bytes]
  bool asked_torque_ = false;
  int transfers_ = 0;          // since torque was asked for
  bool asking_ = false;        // between `request` and `collect`
  bool failed_ = false;        // the last transfer
  int unanswered_ = 0;         // transfers in a row
  std::int64_t asked_at_ = 0;  // [ns]
  std::int64_t heard_at_ = 0;  // [ns]
};

}  // namespace o80::arms
