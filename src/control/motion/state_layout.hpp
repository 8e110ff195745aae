#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <vector>

#include "describe/visit_number.hpp"
#include "o80/describe/hooks.hpp"
#include "o80/describe/schema.hpp"

namespace o80 {

/// Position and kind of one number of a state.
struct NumberPlace {
  std::uint32_t offset = 0;  // [bytes]
  std::uint32_t size = 0;    // [bytes]
  Kind kind = Kind::float64;
  // for an enumeration
  Kind integer = Kind::uint8;     // its underlying type
  std::uint32_t first_label = 0;  // index in the list of the layout
  std::uint32_t labels = 0;

  /// True if the number is interpolated; booleans and enumerations switch.
  bool moves() const noexcept { return kind != Kind::boolean && kind != Kind::enumeration; }
};

template <class T>
T load(const std::byte* bytes) noexcept {
  T value;
  std::memcpy(&value, bytes, sizeof(T));
  return value;
}

/// Copies a number of 1, 2, 4 or 8 bytes.
inline void copy_number(std::byte* to, const std::byte* from, std::uint32_t size) noexcept {
  if (size == sizeof(double)) {  // most numbers: no call
    std::memcpy(to, from, sizeof(double));
  } else {
    std::memcpy(to, from, size);
  }
}

/// Zero is published as +0, also where -0 was commanded or observed.
inline void clear_sign_of_zero(std::byte* at, Kind kind) noexcept {
  const auto clear = [at]<class T>(T zero) {
    const T value = load<T>(at) + zero;
    std::memcpy(at, &value, sizeof value);
  };
  if (kind == Kind::float64) clear(0.0);
  if (kind == Kind::float32) clear(0.0F);
}

/// True if the bit of a number is set; a null mask means all.
inline bool masked(const std::uint64_t* mask, std::size_t number) noexcept {
  return mask == nullptr || (mask[number / 64] >> (number % 64) & 1) != 0;
}

/// The numbers of a described struct, for use in the loop.
class StateLayout {
 public:
  /// Throws InvalidArgument for a type with a text field.
  StateLayout(const Schema& schema, std::uint32_t type);

  std::uint32_t size() const noexcept { return size_; }
  const std::vector<NumberPlace>& numbers() const noexcept { return numbers_; }
  /// Number of 64-bit words of a mask of them.
  std::size_t mask_words() const noexcept { return (numbers_.size() + 63) / 64; }
  const TypeHooks& hooks() const noexcept { return hooks_; }
  /// True if the state is an array of float64 without padding.
  bool plain() const noexcept { return plain_; }

  /// Copies the numbers, not the padding.
  void copy(std::byte* to, const std::byte* from) const noexcept {
    constexpr std::size_t kOne = sizeof(double), kTwo = 2 * sizeof(double);
    if (padded_) {
      copy(to, from, nullptr);
    } else if (size_ == kOne) {  // most states, or those of position and velocity: no call
      std::memcpy(to, from, kOne);
    } else if (size_ == kTwo) {
      std::memcpy(to, from, kTwo);
    } else {
      std::memcpy(to, from, size_);
    }
  }
  /// Copies the numbers whose bits are set.
  void copy(std::byte* to, const std::byte* from, const std::uint64_t* mask) const noexcept {
    for (std::size_t i = 0; i < numbers_.size(); ++i) {
      if (!masked(mask, i)) continue;
      copy_number(to + numbers_[i].offset, from + numbers_[i].offset, numbers_[i].size);
    }
  }

  /// True if the numbers whose bits are set have the same bytes.
  bool same(const std::byte* one, const std::byte* other, const std::uint64_t* mask) const noexcept;

  /// Copies the numbers that are finite.
  void copy_finite(std::byte* to, const std::byte* from) const noexcept;

  static constexpr std::uint32_t kNoNumber = 0xFFFFFFFF;
  /// The first number whose bit is set and that is interpolated; or kNoNumber.
  std::uint32_t first_commanded(const std::uint64_t* mask) const noexcept {
    return first([&](std::uint32_t i) { return masked(mask, i) && numbers_[i].moves(); });
  }
  /// The first number that is infinite or NaN, or kNoNumber.
  std::uint32_t first_not_finite(const std::byte* state) const noexcept {
    return first([&](std::uint32_t i) { return !finite_number(i, state); });
  }

  /// True if each boolean is 0 or 1 and each enumeration has a label.
  bool proper(const std::byte* state) const noexcept {
    return first([&](std::uint32_t i) { return !proper_number(i, state); }) == kNoNumber;
  }
  bool proper_number(std::size_t number, const std::byte* state) const noexcept;
  /// A number as double (large integers are rounded).
  double number(std::size_t number, const std::byte* state) const noexcept {
    const std::byte* at = state + numbers_[number].offset;
    return visit_number(numbers_[number].kind,
                        [&]<class T>(T) { return static_cast<double>(load<T>(at)); });
  }

 private:
  template <class Predicate>
  std::uint32_t first(Predicate&& predicate) const noexcept {
    std::uint32_t i = 0;
    while (i < numbers_.size() && !predicate(i)) ++i;
    return i < numbers_.size() ? i : kNoNumber;
  }
  bool finite_number(std::size_t number, const std::byte* state) const noexcept {
    const std::byte* at = state + numbers_[number].offset;
    if (numbers_[number].kind == Kind::float64) return std::isfinite(load<double>(at));
    if (numbers_[number].kind == Kind::float32) return std::isfinite(load<float>(at));
    return true;
  }

  std::vector<NumberPlace> numbers_;
  std::vector<std::int64_t> labels_;
  TypeHooks hooks_;
  std::uint32_t size_ = 0;
  bool plain_ = true;
  bool padded_ = false;
};

/// One layout for each type of a schema; empty where it is not needed.
using Layouts = std::vector<std::optional<StateLayout>>;
/// The layout of a type, which is made when it is first asked for.
const StateLayout& layout_of(const Schema& schema, std::uint32_t type, Layouts& layouts);
/// The layouts of actuators and requests. `controlled`: throws InvalidArgument if one cannot be.
Layouts layouts_of_types(const Schema& schema, bool controlled = true);

}  // namespace o80
