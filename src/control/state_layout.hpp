#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <vector>

#include "o80/describe/hooks.hpp"
#include "o80/describe/schema.hpp"

namespace o80 {

/// Where one number of a state lies and what it is.
struct NumberPlace {
  std::uint32_t offset = 0;  // [bytes]
  std::uint32_t size = 0;    // [bytes]
  Kind kind = Kind::float64;
  bool is_signed = false;         // of an enumeration
  std::uint32_t first_label = 0;  // of an enumeration, in the layout's own list
  std::uint32_t labels = 0;

  /// Interpolated; booleans and enumerations switch instead.
  bool moves() const noexcept { return kind != Kind::boolean && kind != Kind::enumeration; }
};

template <class T>
T load(const std::byte* bytes) noexcept {
  T value;
  std::memcpy(&value, bytes, sizeof(T));
  return value;
}

/// The numbers of a described struct, ready for the loop.
class StateLayout {
 public:
  /// Throws InvalidArgument for a type with text: that cannot cross a loop.
  StateLayout(const Schema& schema, std::uint32_t type);

  std::uint32_t size() const noexcept { return size_; }
  const std::vector<NumberPlace>& numbers() const noexcept { return numbers_; }
  const TypeHooks& hooks() const noexcept { return hooks_; }
  /// Nothing but float64, side by side.
  bool plain() const noexcept { return plain_; }

  /// Copies the numbers; padding stays as it is.
  void copy(std::byte* to, const std::byte* from) const noexcept {
    if (size_ == sizeof(double) && !padded_) {  // most states: no call
      std::memcpy(to, from, sizeof(double));
    } else if (!padded_) {
      std::memcpy(to, from, size_);
    } else {
      copy_numbers(to, from);
    }
  }
  /// Copies the numbers whose bits are set.
  void copy(std::byte* to, const std::byte* from, const std::uint64_t* mask) const noexcept;

  /// Copies the numbers whose bits are set, but for those that are infinite or NaN.
  void copy_finite(std::byte* to, const std::byte* from,
                   const std::uint64_t* mask = nullptr) const noexcept;

  static constexpr std::uint32_t kNoNumber = 0xFFFFFFFF;
  /// The first number that moves, of those whose bits are set; or kNoNumber.
  std::uint32_t first_commanded(const std::uint64_t* mask) const noexcept;
  /// The first number that is infinite or NaN, or kNoNumber.
  std::uint32_t first_not_finite(const std::byte* state) const noexcept;

  /// Each boolean is 0 or 1 and each enumeration has a label; with `mask`, only those set there.
  bool proper(const std::byte* state, const std::uint64_t* mask = nullptr) const noexcept;
  /// Proper, and neither NaN nor infinite.
  bool finite(const std::byte* state, const std::uint64_t* mask = nullptr) const noexcept;
  bool proper_number(std::size_t number, const std::byte* state) const noexcept;
  /// A number as a double (a large integer rounded).
  double number(std::size_t number, const std::byte* state) const noexcept;

 private:
  bool finite_number(std::size_t number, const std::byte* state) const noexcept;
  void copy_numbers(std::byte* to, const std::byte* from) const noexcept;

  std::vector<NumberPlace> numbers_;
  std::vector<std::int64_t> labels_;
  TypeHooks hooks_;
  std::uint32_t size_ = 0;
  bool plain_ = true;
  bool padded_ = false;
};

/// Whether the bit of a number is set; no mask sets all.
inline bool masked(const std::uint64_t* mask, std::size_t number) noexcept {
  return mask == nullptr || (mask[number / 64] >> (number % 64) & 1) != 0;
}

}  // namespace o80
