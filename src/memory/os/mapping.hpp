#pragma once

#include <cstddef>
#include <cstdint>

namespace o80 {

/// Move-only: a mapping of a whole file.
class Mapping {
 public:
  enum class Protection { read, read_write };
  enum class Faults { later, now };

  Mapping() noexcept = default;
  /// Throws SegmentError.
  Mapping(int descriptor, std::size_t bytes, Protection protection, Faults faults);
  Mapping(Mapping&& other) noexcept;
  Mapping& operator=(Mapping&& other) noexcept;
  ~Mapping();

  std::byte* data() const noexcept { return data_; }
  /// Maps some pages of a mapping writable, at the same address. Throws SegmentError.
  static void make_writable(std::byte* base, int descriptor, std::uint64_t offset,
                            std::size_t bytes);

 private:
  std::byte* data_ = nullptr;
  std::size_t bytes_ = 0;
};

}  // namespace o80
