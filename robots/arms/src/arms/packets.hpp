#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

// What the protocols of bus servos share: buffers of packets, numbers little-endian. Fixed
// buffers, no memory is taken.

namespace o80::arms {

inline constexpr std::uint8_t kEverybody = 254;
inline constexpr std::uint8_t kHeader = 0xFF;  // begins each packet, twice

/// Where a number of a servo lies.
struct Register {
  std::uint8_t address;
  std::uint8_t size;          // [bytes]
  std::uint8_t sign_bit = 0;  // a bit of its own is its sign; 0: it has none, or two's complement
};

/// A number whose sign is a bit of its own.
constexpr int signed_by_bit(int raw, int bit) noexcept {
  const int magnitude = raw & ((1 << bit) - 1);
  return (raw & (1 << bit)) != 0 ? -magnitude : magnitude;
}
constexpr int with_sign_bit(int value, int bit) noexcept {
  return value < 0 ? -value | (1 << bit) : value;
}
/// The number of a register whose bytes begin there.
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

/// Packets that leave in one write(2). One that does not fit is left out: `fits` tells.
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
  /// Returns where a packet of this size begins.
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

/// What a servo sent back.
struct Answer {
  std::uint8_t id;
  std::uint8_t status;  // a byte of the protocol
  std::span<const std::uint8_t> data;
};

/// Finds answers in the bytes that arrive, whatever lies between them.
class Answers {
 public:
  virtual ~Answers() = default;
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
  virtual std::optional<Answer> next() noexcept = 0;
  /// Packets so far that were damaged.
  std::uint32_t damaged() const noexcept { return damaged_; }

 protected:
  /// What has arrived, and was not looked at.
  std::span<std::uint8_t> rest() noexcept {
    return std::span(bytes_).subspan(begin_, end_ - begin_);
  }
  /// A packet of this size was whole.
  void take(std::size_t size) noexcept { begin_ += size, lost_track_ = false; }
  /// This was no packet. Bytes behind a damaged one are not counted again.
  void skip(std::size_t size) noexcept {
    begin_ += size;
    lost_track_ = true;
    ++damaged_;
  }
  /// Looks for a header one byte later. `shifted`: this one only begins a byte too early, which is
  /// no damage.
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
  bool lost_track_ = false;  // inside what was counted as damaged
  std::uint32_t damaged_ = 0;
};

}  // namespace o80::arms
