#pragma once

#include "arms/packets.hpp"

// Protocol 2.0 of Dynamixel servos: packets `FF FF FD 00 id length instruction parameters crc`,
// numbers little-endian. A header inside the parameters is followed by an additional FD. Registers
// are of the X series.

namespace o80::arms::dynamixel {

// registers below 64 are persistent, and can be written without torque only
inline constexpr Register kModel{0, 2};
inline constexpr Register kReturnDelay{9, 1};   // [2 us]
inline constexpr Register kDriveMode{10, 1};    // 0: neither reversed nor paced by time
inline constexpr Register kMode{11, 1};         // 4: position over many turns; 5: with a current
inline constexpr Register kOffset{20, 4};       // shown position = encoder + offset
inline constexpr Register kHottest{31, 1};      // [degC]
inline constexpr Register kMostVoltage{32, 2};  // [0.1 V]
inline constexpr Register kLeastVoltage{34, 2};
inline constexpr Register kMostPwm{36, 2};      // [0.113 %]
inline constexpr Register kMostCurrent{38, 2};  // [mA]
inline constexpr Register kLargest{48, 4};      // position: not used in modes 4 and 5
inline constexpr Register kSmallest{52, 4};
inline constexpr Register kShutdown{63, 1};  // failures that switch the torque off until a restart
inline constexpr Register kTorque{64, 1};
inline constexpr Register kAnswers{68, 1};  // 1: to reads only
inline constexpr Register kFailure{70, 1};  // bits of Failure
inline constexpr Register kGainD{80, 2};
inline constexpr Register kGainI{82, 2};
inline constexpr Register kGainP{84, 2};
inline constexpr Register kWatchdog{98, 1};  // [20 ms]; 0 ends a stop
inline constexpr Register kPwm{100, 2};      // at most, in position modes
inline constexpr Register kGoalCurrent{102, 2};
inline constexpr Register kAcceleration{108, 4};  // [214.577 rev/min^2]
inline constexpr Register kSpeed{112, 4};         // [0.229 rev/min]
inline constexpr Register kGoal{116, 4};
inline constexpr Register kCurrent{126, 2};  // [mA]; of an XL430 the load [0.1 %]
inline constexpr Register kVelocity{128, 4};
inline constexpr Register kPosition{132, 4};
inline constexpr Register kVoltage{144, 2};
inline constexpr Register kTemperature{146, 1};

enum Failure : std::uint8_t {
  voltage_failure = 1,
  heat_failure = 4,
  encoder_failure = 8,
  shock_failure = 16,
  overload_failure = 32
};
inline constexpr std::uint8_t kAlert = 128;  // in the error byte of each answer: see kFailure

/// CRC-16 with the polynomial 0x8005.
constexpr std::uint16_t crc(std::span<const std::uint8_t> bytes) noexcept {
  constexpr auto kTable = [] {
    std::array<std::uint16_t, 256> table{};
    for (unsigned i = 0; i < 256; ++i) {
      unsigned value = i << 8;
      for (int bit = 0; bit < 8; ++bit) value = value << 1 ^ ((value & 0x8000) != 0 ? 0x8005 : 0);
      table[i] = static_cast<std::uint16_t>(value);
    }
    return table;
  }();
  std::uint16_t sum = 0;
  for (const std::uint8_t byte : bytes) {
    sum = static_cast<std::uint16_t>(sum << 8 ^ kTable[(sum >> 8 ^ byte) & 0xFF]);
  }
  return sum;
}

inline bool is_header(std::span<const std::uint8_t> bytes) noexcept {
  return bytes[0] == kHeader && bytes[1] == kHeader && bytes[2] == 0xFD;
}

/// Registers of one servo.
struct Block {
  std::uint8_t id;
  std::uint8_t first;
  std::uint8_t size;
};

class Requests : public arms::Requests {
 public:
  void read(std::uint8_t id, std::uint8_t address, std::uint8_t size) noexcept override {
    const std::size_t begin = open(id, 2, 4);
    put(kTwo, address), put(kTwo, size);
    close(begin);
  }
  /// Each servo answers with its own packet, in this order.
  void bulk_read(std::span<const Block> blocks) noexcept {
    const std::size_t begin = open(kEverybody, 0x92, 5 * blocks.size());
    for (const Block& each : blocks) put(each.id), put(kTwo, each.first), put(kTwo, each.size);
    close(begin);
  }
  void sync_write(Register where, std::span<const Value> values) noexcept override {
    if (values.empty()) return;
    const std::size_t begin = open(kEverybody, 0x83, 4 + values.size() * (1U + where.size));
    put(kTwo, where.address), put(kTwo, where.size);
    for (const Value& each : values) put(each.id), put(where, each.value);
    close(begin);
  }
  /// A servo whose register kAnswers is 1 does not answer it.
  void reboot(std::uint8_t id) noexcept { close(open(id, 8, 0)); }

 private:
  static constexpr Register kTwo{0, 2};  // a number of two bytes

  std::size_t open(std::uint8_t id, std::uint8_t instruction, std::size_t parameters) noexcept {
    const std::size_t begins = begin(parameters * 4 / 3 + 10);
    put(kHeader), put(kHeader), put(0xFD), put(0), put(id), put(kTwo, 0), put(instruction);
    return begins;
  }
  void close(std::size_t begin) noexcept {
    if (!fits()) return;
    for (std::size_t i = 8; i + 2 < packet_from(begin).size(); ++i) {
      if (!is_header(packet_from(begin).subspan(i))) continue;
      put(0);
      const std::span<std::uint8_t> packet = packet_from(begin);
      for (std::size_t k = packet.size() - 1; k > i + 3; --k) packet[k] = packet[k - 1];
      packet[i + 3] = 0xFD;
    }
    const std::span<std::uint8_t> packet = packet_from(begin);
    const std::size_t length = packet.size() - 7 + 2;
    packet[5] = static_cast<std::uint8_t>(length & 0xFF);
    packet[6] = static_cast<std::uint8_t>(length >> 8);
    put(kTwo, crc(packet));
  }
};

/// The status of an answer has kAlert, and in its low bits the reason of a refusal.
class Answers : public arms::Answers {
 public:
  std::optional<Answer> next() noexcept override {
    while (rest().size() >= 11) {
      const std::span<std::uint8_t> packet = rest();
      const std::size_t length = packet[5] | packet[6] << 8;
      if (!is_header(packet)) {
        skip_to_header(packet[0] == kHeader && packet[1] == kHeader && packet[2] == kHeader);
        continue;
      }
      if (packet[3] != 0 || length < 4 || length > kLongest) {
        skip(3);
        continue;
      }
      const std::size_t size = length + 7;
      if (packet.size() < size) return std::nullopt;
      if (crc(packet.first(size - 2)) != number_of({0, 2}, packet.subspan(size - 2))) {
        skip(3);
        continue;
      }
      take(size);
      if (packet[7] != kAnswer) continue;  // an instruction: the adapter echoes
      return Answer{packet[4], packet[8], without_stuffing(packet.subspan(9, length - 4))};
    }
    return std::nullopt;
  }

 private:
  static constexpr std::size_t kLongest = 160;
  static constexpr std::uint8_t kAnswer = 0x55;

  static std::span<const std::uint8_t> without_stuffing(std::span<std::uint8_t> data) noexcept {
    std::size_t size = 0;
    for (const std::uint8_t byte : data) {
      const bool stuffed = byte == 0xFD && size >= 3 && is_header(data.subspan(size - 3));
      if (!stuffed) data[size++] = byte;
    }
    return data.first(size);
  }
};

}  // namespace o80::arms::dynamixel
