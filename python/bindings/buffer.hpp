#pragma once

#include <nanobind/nanobind.h>

#include <cstddef>
#include <cstring>
#include <span>
#include <type_traits>
#include <vector>

/// The memory of a Python object.
struct Bytes {
  explicit Bytes(nanobind::handle owner, int flags = PyBUF_SIMPLE) {
    if (PyObject_GetBuffer(owner.ptr(), &view, flags) != 0) throw nanobind::python_error();
  }
  Bytes(const Bytes&) = delete;
  Bytes& operator=(const Bytes&) = delete;
  ~Bytes() { PyBuffer_Release(&view); }
  std::span<const std::byte> span() const { return writable(); }
  /// Only for a buffer requested with PyBUF_WRITABLE.
  std::span<std::byte> writable() const {
    return {static_cast<std::byte*>(view.buf), static_cast<std::size_t>(view.len)};
  }
  Py_buffer view{};
};

/// An argument std::span: the memory of a Python object until the call returns. Without `const` the
/// function writes to it.
template <class T>
struct nanobind::detail::type_caster<std::span<T>> {
  template <class>
  using Cast = std::span<T>;
  static constexpr auto Name = const_name("bytes | bytearray | numpy.typing.NDArray[typing.Any]");

  type_caster() = default;
  type_caster(const type_caster&) = delete;
  type_caster& operator=(const type_caster&) = delete;
  ~type_caster() { PyBuffer_Release(&view); }
  template <class>
  static constexpr bool can_cast() {
    return true;
  }
  bool from_python(handle owner, std::uint32_t, cleanup_list*) noexcept {
    constexpr int kFlags = std::is_const_v<T> ? PyBUF_SIMPLE : PyBUF_WRITABLE;
    const bool has_memory = PyObject_GetBuffer(owner.ptr(), &view, kFlags) == 0;
    if (!has_memory) PyErr_Clear();
    return has_memory;
  }
  explicit operator std::span<T>() const {
    return {static_cast<T*>(view.buf), static_cast<std::size_t>(view.len) / sizeof(T)};
  }
  Py_buffer view{};
};

template <class T>
nanobind::bytes bytes_of(const std::vector<T>& values) {
  return nanobind::bytes(values.data(), values.size() * sizeof(T));
}
