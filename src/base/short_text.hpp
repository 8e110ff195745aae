#pragma once

#include <algorithm>
#include <array>
#include <charconv>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <string_view>

namespace o80 {

/// A text buffer of fixed size, for code that must not allocate; excess characters are dropped.
///
/// Realtime: yes.
template <std::size_t Size>
class ShortText {
 public:
  ShortText& add(std::string_view text) noexcept {
    const std::size_t count = std::min(text.size(), Size - 1 - size_);
    std::copy_n(text.begin(), count, chars_.begin() + static_cast<std::ptrdiff_t>(size_));
    size_ += count;
    return *this;
  }
  /// Adds the shortest text that parses to the same number.
  template <class Number>
    requires std::integral<Number> || std::floating_point<Number>
  ShortText& add(Number number) noexcept {
    std::array<char, 32> digits{};
    const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), number).ptr;
    return add(std::string_view(digits.data(), static_cast<std::size_t>(end - digits.data())));
  }
  /// Adds a time in seconds. Divided: a product with 1e-9 has digits that are rounding errors.
  ShortText& add_seconds(std::int64_t nanoseconds) noexcept {
    return add(static_cast<double>(nanoseconds) / 1e9).add(" s");
  }
  std::string_view view() const noexcept { return {chars_.data(), size_}; }

 private:
  std::array<char, Size> chars_{};
  std::size_t size_ = 0;
};

}  // namespace o80
