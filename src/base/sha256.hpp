#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

namespace o80 {

/// SHA-256 of a sequence of bytes (FIPS 180-4).
class Sha256 {
 public:
  void add(std::span<const std::byte> bytes) noexcept;
  /// The hash of all that was added, in hexadecimal. Ends the sequence.
  std::string hex() noexcept;

 private:
  void digest(const std::byte* block) noexcept;

  static constexpr std::size_t kBlock = 64;
  std::array<std::uint32_t, 8> state_{0x6a09e667, 0xbb67ae85, 0x3c6ef372, 0xa54ff53a,
                                      0x510e527f, 0x9b05688c, 0x1f83d9ab, 0x5be0cd19};
  std::array<std::byte, kBlock> rest_{};  // bytes that do not fill a block yet
  std::uint64_t length_ = 0;              // [bytes]
};

}  // namespace o80
