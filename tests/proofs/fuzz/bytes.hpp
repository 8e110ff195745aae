#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <span>

namespace o80::fuzz {

/// What the fuzzer wrote, taken from the front; zeros when there is no more.
class Bytes {
 public:
  Bytes(const std::uint8_t* data, std::size_t size) : left_(std::as_bytes(std::span(data, size))) {}

  bool empty() const noexcept { return left_.empty(); }
  std::span<const std::byte> take(std::size_t most) noexcept {
    const auto taken = left_.first(std::min(most, left_.size()));
    left_ = left_.subspan(taken.size());
    return taken;
  }
  std::span<const std::byte> rest() noexcept { return take(left_.size()); }
  template <class Number>
  Number number() noexcept {
    Number value{};
    const auto from = take(sizeof value);
    if (!from.empty()) std::memcpy(&value, from.data(), from.size());
    return value;
  }
  /// 0 .. below - 1.
  std::uint32_t below(std::uint32_t below) noexcept { return number<std::uint16_t>() % below; }

  /// A number that breaks things more often than one drawn by chance.
  std::uint64_t word() noexcept {
    constexpr std::uint64_t kSpecial[] = {0,
                                          1,
                                          2,
                                          63,
                                          64,
                                          65,
                                          4095,
                                          4096,
                                          0x7fff'ffff,
                                          0x8000'0000,
                                          0xffff'ffff,
                                          0x1'0000'0000,
                                          1ULL << 47,
                                          std::numeric_limits<std::int64_t>::max() - 1,
                                          std::numeric_limits<std::int64_t>::max(),
                                          1ULL << 63,
                                          ~0ULL - 1,
                                          ~0ULL,
                                          0x7ff0'0000'0000'0000 /* infinity */,
                                          0x7ff8'0000'0000'0000 /* not a number */};
    const auto kind = number<std::uint8_t>();
    if (kind < std::size(kSpecial)) return kSpecial[kind];
    return kind < 128 ? number<std::uint8_t>() : number<std::uint64_t>();
  }

 private:
  std::span<const std::byte> left_;
};

/// What a fuzzer does with an input.
void run(Bytes bytes);

}  // namespace o80::fuzz

extern "C" [[gnu::used]] inline int LLVMFuzzerTestOneInput(const std::uint8_t* data,
                                                           std::size_t size) {
  o80::fuzz::run({data, size});
  return 0;
}
