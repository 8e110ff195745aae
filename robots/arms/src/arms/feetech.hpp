#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

// The protocol of Feetech's STS and SMS servos: packets `FF FF id length instruction parameters
// checksum`, numbers little-endian. Fixed buffers, no memory is taken.

namespace o80::arms::feetech {

inline constexpr std::uint8_t kEverybody = 254;
inline constexpr std::uint8_t kHeader = 0xFF;

/// A register, and how many bytes it has.
struct Register {
  std::uint8_t address;
  std::uint8_t size;
};
inline constexpr Register kFirmware{0, 2};
inline constexpr Register kModel{3, 2};
inline constexpr Register kSmallest{9, 2};  // position: the servo clamps goals to the two
inline constexpr Register kLargest{11, 2};
inline constexpr Register kHottest{13, 1};      // [degC]
inline constexpr Register kMostVoltage{14, 1};  // [0.1 V]
inline constexpr Register kLeastVoltage{15, 1};
inline constexpr Register kPhase{18, 1};   // bit 2: speeds are in steps/s, else in 50 steps/s
inline constexpr Register kWeak{34, 1};    // strength that an overload leaves [%]
inline constexpr Register kOffset{31, 2};  // shown position = encoder - offset; sign in bit 11
inline constexpr Register kMode{33, 1};    // 0: position
inline constexpr Register kTorque{40, 1};  // 0: off, 1: on
inline constexpr Register kAcceleration{41, 1};  // [100 steps/s^2]
inline constexpr Register kGoal{42, 2};
inline constexpr Register kSpeed{46, 2};
inline constexpr Register kStrength{48, 2};  // [0.1 %]
inline constexpr Register kPosition{56, 2};
inline constexpr std::uint16_t kSts3215 = 777;

/// Bits of the status byte of each answer.
enum Alarm : std::uint8_t {
  voltage_alarm = 1,
  encoder_alarm = 2,
  heat_alarm = 4,
  current_alarm = 8,
  overload_alarm = 32
};

/// A number whose sign is a bit of its own.
constexpr int signed_by_bit(int raw, int bit) noexcept {
  const int magnitude = raw & ((1 << bit) - 1);
  return (raw & (1 << bit)) != 0 ? -magnitude : magnitude;
}
constexpr std::uint16_t with_sign_bit(int value, int bit) noexcept {
  return static_cast<std::uint16_t>(value < 0 ? -value | (1 << bit) : value);
}
constexpr int number_at(std::span<const std::uint8_t> data, std::size_t at) noexcept {
  return data[at] | data[at + 1] << 8;
}

/// A value for one servo.
struct Value {
  std::uint8_t id;
  std::uint16_t value;
};

/// Packets that leave in one write(2). One that does not fit is left out: `fits` tells.
class Requests {
 public:
  void clear() noexcept { size_ = 0, fits_ = true; }
  bool empty() const noexcept { return size_ == 0; }
  bool fits() const noexcept { return fits_; }
  std::span<const std::uint8_t> bytes() const noexcept { return {bytes_.data(), size_}; }

  void ping(std::uint8_t id) noexcept { close(open(id, 1, 0)); }
  void read(std::uint8_t id, std::uint8_t address, std::uint8_t size) noexcept {
    const std::size_t begin = open(id, 2, 2);
    put(address), put(size);
    close(begin);
  }
  /// Each servo answers with a packet of its own, in this order.
  void sync_read(std::uint8_t address, std::uint8_t size,
                 std::span<const std::uint8_t> ids) noexcept {
    const std::size_t begin = open(kEverybody, 0x82, 2 + ids.size());
    put(address), put(size);
    for (const std::uint8_t id : ids) put(id);
    close(begin);
  }
  /// No servo answers.
  void sync_write(Register where, std::span<const Value> values) noexcept {
    if (values.empty()) return;
    const std::size_t begin = open(kEverybody, 0x83, 2 + values.size() * (1U + where.size));
    put(where.address), put(where.size);
    for (const Value& each : values) {
      put(each.id), put(static_cast<std::uint8_t>(each.value & 0xFF));
      if (where.size == 2) put(static_cast<std::uint8_t>(each.value >> 8));
    }
    close(begin);
  }

 private:
  /// Returns where the packet begins.
  std::size_t open(std::uint8_t id, std::uint8_t instruction, std::size_t parameters) noexcept {
    if (size_ + parameters + 6 > bytes_.size()) fits_ = false;
    const std::size_t begin = size_;
    put(kHeader), put(kHeader), put(id), put(static_cast<std::uint8_t>(parameters + 2));
    put(instruction);
    return begin;
  }
  void put(std::uint8_t byte) noexcept {
    if (fits_) bytes_[size_++] = byte;
  }
  void close(std::size_t begin) noexcept {
    std::uint8_t sum = 0;
    for (std::size_t i = begin + 2; i < size_; ++i)
      sum = static_cast<std::uint8_t>(sum + bytes_[i]);
    put(static_cast<std::uint8_t>(~sum));
  }

  std::array<std::uint8_t, 512> bytes_{};
  std::size_t size_ = 0;
  bool fits_ = true;
};

/// What a servo sent back.
struct Answer {
  std::uint8_t id;
  std::uint8_t status;  // bits of Alarm
  std::span<const std::uint8_t> data;
};

/// Finds answers in the bytes that arrive, whatever lies between them.
class Answers {
 public:
  void clear() noexcept { begin_ = end_ = 0, lost_track_ = false; }
  /// Where bytes may be put; `arrived` says how many were.
  std::span<std::uint8_t> room() noexcept {
    if (begin_ > 0) {
      for (std::size_t i = begin_; i < end_; ++i) bytes_[i - begin_] = bytes_[i];
      end_ -= begin_, begin_ = 0;
    }
    return std::span(bytes_).subspan(end_);
  }
  void arrived(std::size_t count) noexcept { end_ += count; }

  /// The next one that is whole and undamaged. It is valid until the next call of `room`.
  std::optional<Answer> next() noexcept {
    while (end_ - begin_ >= 6) {
      const std::uint8_t* const packet = bytes_.data() + begin_;
      const std::size_t length = packet[3];
      if (packet[0] != kHeader || packet[1] != kHeader || packet[2] == kHeader) {
        // a header whose second byte is the first of the next one is no damage
        const bool shifted = packet[0] == kHeader && packet[1] == kHeader;
        skip(1, !shifted && !lost_track_);
        continue;
      }
      if (length < 2 || length > kLongest) {
        skip(2, true);
        continue;
      }
      if (end_ - begin_ < length + 4) return std::nullopt;
      std::uint8_t sum = 0;
      for (std::size_t i = 2; i < length + 4; ++i) sum = static_cast<std::uint8_t>(sum + packet[i]);
      if (sum != 0xFF) {
        skip(2, true);
        continue;
      }
      begin_ += length + 4;
      lost_track_ = false;
      return Answer{packet[2], packet[4], {packet + 5, length - 2}};
    }
    return std::nullopt;
  }
  /// Packets so far that were damaged.
  std::uint32_t damaged() const noexcept { return damaged_; }

 private:
  static constexpr std::size_t kLongest = 64;

  void skip(std::size_t count, bool counts) noexcept {
    begin_ += count;
    lost_track_ = true;
    if (counts) ++damaged_;
  }

  std::array<std::uint8_t, 512> bytes_{};
  std::size_t begin_ = 0;
  std::size_t end_ = 0;
  bool lost_track_ = false;  // inside what was counted as damaged
  std::uint32_t damaged_ = 0;
};

}  // namespace o80::arms::feetech
