#pragma once

#include <cstddef>
#include <cstring>
#include <span>
#include <type_traits>
#include <vector>

namespace o80::mujoco {

/// Copies plain values to bytes or back, in the order of the calls: one list of the parts of a
/// state serves both ways.
class StateBytes {
 public:
  /// Only counts the bytes.
  StateBytes() = default;
  static StateBytes to(std::span<std::byte> bytes) noexcept { return {bytes.data(), nullptr}; }
  static StateBytes from(std::span<const std::byte> bytes) noexcept {
    return {nullptr, bytes.data()};
  }

  template <class Value>
  void copy(Value* values, std::size_t count) noexcept {
    static_assert(std::is_trivially_copyable_v<Value>);
    const std::size_t size = count * sizeof(Value);
    if (to_ != nullptr) std::memcpy(to_ + bytes_, values, size);
    if (from_ != nullptr) std::memcpy(values, from_ + bytes_, size);
    bytes_ += size;
  }
  template <class Value>
  void operator()(Value& value) noexcept {
    copy(&value, 1);
  }
  template <class Value>
  void operator()(std::vector<Value>& values) noexcept {
    if (!values.empty()) copy(values.data(), values.size());
  }
  std::size_t bytes() const noexcept { return bytes_; }

 private:
  StateBytes(std::byte* to, const std::byte* from) noexcept : to_(to), from_(from) {}

  std::byte* to_ = nullptr;
  const std::byte* from_ = nullptr;
  std::size_t bytes_ = 0;
};

}  // namespace o80::mujoco
