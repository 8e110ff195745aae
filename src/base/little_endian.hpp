#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

namespace o80 {

/// Writes numbers and texts in a format whose widths do not depend on the types in memory. A list
/// of fields that is a template over writer and reader serves both directions.
class LittleEndianWriter {
 public:
  explicit LittleEndianWriter(std::vector<std::byte>& to) : to_(to) {}

  template <class... Values>
  void u8(const Values&... values) {
    (put(static_cast<std::uint64_t>(values), 1), ...);
  }
  template <class... Values>
  void u16(const Values&... values) {
    (put(static_cast<std::uint64_t>(values), 2), ...);
  }
  template <class... Values>
  void u32(const Values&... values) {
    (put(static_cast<std::uint64_t>(values), 4), ...);
  }
  /// Also for signed numbers: their two's complement.
  template <class... Values>
  void u64(const Values&... values) {
    (put(static_cast<std::uint64_t>(values), 8), ...);
  }
  /// Up to the first NUL: its length, then its characters.
  template <class Chars>
  void text(const Chars& chars) {
    const std::size_t length = strnlen(chars.data(), chars.size());
    u16(length);
    bytes(std::as_bytes(std::span(chars.data(), length)));
  }
  /// Overwrites a u32 that was written at this place.
  void set_u32(std::size_t at, std::uint64_t value) {
    for (std::size_t i = 0; i < 4; ++i) to_[at + i] = static_cast<std::byte>(value >> 8 * i);
  }
  void bytes(std::span<const std::byte> bytes) {
    to_.insert(to_.end(), bytes.begin(), bytes.end());
  }

 private:
  void put(std::uint64_t value, std::size_t width) {
    const std::size_t at = to_.size();
    to_.resize(at + width);
    for (std::size_t i = 0; i < width; ++i) to_[at + i] = static_cast<std::byte>(value >> 8 * i);
  }
  std::vector<std::byte>& to_;
};

/// Reads what a LittleEndianWriter has written. Arbitrary bytes are safe: what lies beyond the end
/// is read as 0.
class LittleEndianReader {
 public:
  explicit LittleEndianReader(std::span<const std::byte> from) : from_(from) {}

  template <class... Values>
  void u8(Values&... values) {
    ((values = static_cast<Values>(take(1))), ...);
  }
  template <class... Values>
  void u16(Values&... values) {
    ((values = static_cast<Values>(take(2))), ...);
  }
  template <class... Values>
  void u32(Values&... values) {
    ((values = static_cast<Values>(take(4))), ...);
  }
  template <class... Values>
  void u64(Values&... values) {
    ((values = static_cast<Values>(take(8))), ...);
  }
  /// A text that does not fit is an error.
  template <class Chars>
  void text(Chars& chars) {
    std::size_t length = 0;
    u16(length);
    const std::span<const std::byte> found = bytes(length);
    chars = {};
    if (found.size() > chars.size()) failed_ = true;
    if (!failed_ && !found.empty()) std::memcpy(chars.data(), found.data(), found.size());
  }
  std::span<const std::byte> bytes(std::size_t count) {
    if (count > from_.size()) failed_ = true;
    if (failed_) return {};
    const std::span<const std::byte> found = from_.first(count);
    from_ = from_.subspan(count);
    return found;
  }
  std::span<const std::byte> rest() { return bytes(from_.size()); }

  std::size_t left() const noexcept { return failed_ ? 0 : from_.size(); }
  bool failed() const noexcept { return failed_; }

 private:
  std::uint64_t take(std::size_t width) {
    std::uint64_t value = 0;
    const std::span<const std::byte> found = bytes(width);
    for (std::size_t i = found.size(); i > 0; --i)
      value = value << 8 | std::to_integer<std::uint64_t>(found[i - 1]);
    return value;
  }
  std::span<const std::byte> from_;
  bool failed_ = false;
};

}  // namespace o80
