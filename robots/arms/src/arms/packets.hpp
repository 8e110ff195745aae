#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

// Common parts of bus servo protocols: buffers of packets, numbers little-endian. Fixed
// buffers, no allocation.

namespace o80::arms {

inline constexpr std::uint8_t kEverybody = 254;
inline constexpr std::uint8_t kHeader = 0xFF;  // begins each packet, twice

/// Register of a servo.
struct Register {
  std::uint8_t address;
  std::uint8_t size;          // [bytes]
  std::uint8_t sign_bit = 0;  // bit of the sign; 0: unsigned, or two's complement
};

/// Decodes a number with a sign bit.
constexpr int signed_by_bit(int raw, int bit) noexcept {
  const int magnitude = raw & ((1 << bit) - 1);
  return (raw & (1 << bit)) != 0 ? -magnitude : magnitude;
}
constexpr int with_sign_bit(int value, int bit) noexcept {
  return value < 0 ? -value | (1 << bit) : value;
}
/// Decodes a register from its first byte.
constexpr int number_of(Register where, std::span<const std::uint8_t> data) noexcept {
  std::uint32_t raw = 0;
  for (std::size_t i = where.size; i > 0; --i) raw = raw << 8 | data[i - 1];
  const auto value = static_cast<int>(raw);
  return where.sign_bit > 0 ? signed_by_bit(value, where.sign_bit) : value;
}

/// A value for one servo.
struct Value {
  std::uint8_t id;
  int value;
};

/// Packets for one write(2). A packet that does not fit is left out, see `fits`.
class Requests {
 public:
  virtual ~Requests() = default;
  void clear() noexcept { size_ = 0, fits_ = true; }
  bool empty() const noexcept { return size_ == 0; }
  bool fits() const noexcept { return fits_; }
  std::span<const std::uint8_t> bytes() const noexcept { return {bytes_.data(), size_}; }

  virtual void read(std::uint8_t id, std::uint8_t address, std::uint8_t size) noexcept = 0;
  /// No servo answers.
  virtual void sync_write(Register where, std::span<const Value> values) noexcept = 0;

 protected:
  /// Returns the begin of a packet of this size.
  std::size_t begin(std::size_t size) noexcept {
    if (size_ + size > bytes_.size()) fits_ = false;
    return size_;
  }
  void put(std::uint8_t byte) noexcept {
    if (fits_) bytes_[size_++] = byte;
  }
  std::span<std::uint8_t> packet_from(std::size_t begin) noexcept {
    return std::span(bytes_).subspan(begin, size_ - begin);
  }
  void put(Register where, int value) noexcept {
    const int raw = where.sign_bit > 0 ? with_sign_bit(value, where.sign_bit) : value;
    for (int i = 0; i < where.size; ++i) put(static_cast<std::uint8_t>(raw >> 8 * i & 0xFF));
  }

 private:
  std::array<std::uint8_t, 1024> bytes_{};
  std::size_t size_ = 0;
  bool fits_ = true;
};

/// Answer of a servo.
struct Answer {
  std::uint8_t id;
  std::uint8_t status;  // a byte of the protocol
  std::span<const std::uint8_t> data;
};

/// Finds answers in the received bytes, and skips all else.
class Answers {
 public:
  virtual ~Answers() = default;
  void clear() noexcept { begin_ = end_ = 0, lost_track_ = false; }
  /// Free memory for received bytes; `arrived` reports their number.
  std::span<std::uint8_t> room() noexcept {
    if (begin_ > 0) {
      for (std::size_t i = begin_; i < end_; ++i) bytes_[i - begin_] = bytes_[i];
      end_ -= begin_, begin_ = 0;
    }
    return std::span(bytes_).subspan(end_);
  }
  void arrived(std::size_t count) noexcept { end_ += count; }

  /// The next complete, undamaged answer, valid until the next call of `room`.
  virtual std::optional<Answer> next() noexcept = 0;
  /// Number of damaged packets so far.
  std::uint32_t damaged() const noexcept { return damaged_; }

 protected:
  /// Received bytes that were not searched yet.
  std::span<std::uint8_t> rest() noexcept {
    return std::span(bytes_).subspan(begin_, end_ - begin_);
  }
  /// Consumes a complete packet of this size.
  void take(std::size_t size) noexcept { begin_ += size, lost_track_ = false; }
  /// Counts a damaged packet. Bytes behind a damaged one are not counted again.
  void skip(std::size_t size) noexcept {
    begin_ += size;
    lost_track_ = true;
    ++damaged_;
  }
  /// Searches for a header one byte later. `shifted`: this one only begins a byte too early, which
  /// is no damage.
  void skip_to_header(bool shifted) noexcept {
    ++begin_;
    if (shifted) return;
    if (!lost_track_) ++damaged_;
    lost_track_ = true;
  }

 private:
  std::array<std::uint8_t, 512> bytes_{};
  std::size_t begin_ = 0;
  std::size_t end_ = 0;
  bool lost_track_ = false;  // inside of bytes already counted as damaged
  std::uint32_t damaged_ = 0;
};

}  // namespace o80::arms
