#pragma once

#include "arms/packets.hpp"

// The protocol of Feetech's STS and SMS servos: packets `FF FF id length instruction parameters
// checksum`, numbers little-endian.

namespace o80::arms::feetech {

inline constexpr Register kFirmware{0, 2};
inline constexpr Register kModel{3, 2};
inline constexpr Register kSmallest{9, 2};  // position: the servo clamps goals to the two
inline constexpr Register kLargest{11, 2};
inline constexpr Register kHottest{13, 1};      // [degC]
inline constexpr Register kMostVoltage{14, 1};  // [0.1 V]
inline constexpr Register kLeastVoltage{15, 1};
inline constexpr Register kPhase{18, 1};         // bit 2: speeds are in steps/s, else in 50 steps/s
inline constexpr Register kOffset{31, 2, 11};    // shown position = encoder - offset
inline constexpr Register kMode{33, 1};          // 0: position
inline constexpr Register kWeak{34, 1};          // strength after an overload [%]
inline constexpr Register kTorque{40, 1};        // 0: off, 1: on
inline constexpr Register kAcceleration{41, 1};  // [100 steps/s^2]
inline constexpr Register kGoal{42, 2, 15};
inline constexpr Register kSpeed{46, 2};
inline constexpr Register kStrength{48, 2};  // [0.1 %]
inline constexpr Register kPosition{56, 2, 15};
inline constexpr Register kMoved{58, 2, 15};  // speed [steps/s]
inline constexpr Register kLoad{60, 2, 10};   // [0.1 %]
inline constexpr Register kVoltage{62, 1};    // [0.1 V]
inline constexpr Register kTemperature{63, 1};
inline constexpr int kSts3215 = 777;

class Requests : public arms::Requests {
 public:
  void read(std::uint8_t id, std::uint8_t address, std::uint8_t size) noexcept override {
    const std::size_t begin = open(id, 2, 2);
    put(address), put(size);
    close(begin);
  }
  /// Each servo answers with its own packet, in this order.
  void sync_read(std::uint8_t address, std::uint8_t size,
                 std::span<const std::uint8_t> ids) noexcept {
    const std::size_t begin = open(kEverybody, 0x82, 2 + ids.size());
    put(address), put(size);
    for (const std::uint8_t id : ids) put(id);
    close(begin);
  }
  void sync_write(Register where, std::span<const Value> values) noexcept override {
    if (values.empty()) return;
    const std::size_t begin = open(kEverybody, 0x83, 2 + values.size() * (1U + where.size));
    put(where.address), put(where.size);
    for (const Value& each : values) put(each.id), put(where, each.value);
    close(begin);
  }

 private:
  /// Returns where the packet begins.
  std::size_t open(std::uint8_t id, std::uint8_t instruction, std::size_t parameters) noexcept {
    const std::size_t begins = begin(parameters + 6);
    put(kHeader), put(kHeader), put(id), put(static_cast<std::uint8_t>(parameters + 2));
    put(instruction);
    return begins;
  }
  void close(std::size_t begin) noexcept {
    std::uint8_t sum = 0;
    for (std::size_t i = begin + 2; i < bytes().size(); ++i)
      sum = static_cast<std::uint8_t>(sum + bytes()[i]);
    put(static_cast<std::uint8_t>(~sum));
  }
};

/// The status of an answer has the bits of arms::Alarm.
class Answers : public arms::Answers {
 public:
  std::optional<Answer> next() noexcept override {
    while (rest().size() >= 6) {
      const std::span<const std::uint8_t> packet = rest();
      const std::size_t length = packet[3];
      if (packet[0] != kHeader || packet[1] != kHeader || packet[2] == kHeader) {
        skip_to_header(packet[0] == kHeader && packet[1] == kHeader);
        continue;
      }
      if (length < 2 || length > kLongest) {
        skip(2);
        continue;
      }
      if (packet.size() < length + 4) return std::nullopt;
      std::uint8_t sum = 0;
      for (std::size_t i = 2; i < length + 4; ++i) sum = static_cast<std::uint8_t>(sum + packet[i]);
      if (sum != 0xFF) {
        skip(2);
        continue;
      }
      take(length + 4);
      return Answer{packet[2], packet[4], packet.subspan(5, length - 2)};
    }
    return std::nullopt;
  }

 private:
  static constexpr std::size_t kLongest = 64;
};

}  // namespace o80::arms::feetech
