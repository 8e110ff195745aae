#pragma once

#include <cstddef>
#include <cstring>
#include <span>
#include <vector>

#include "nb.hpp"

/// The memory of a Python object.
struct Bytes {
  explicit Bytes(nb::handle owner, int flags = PyBUF_SIMPLE) {
    if (PyObject_GetBuffer(owner.ptr(), &view, flags) != 0) throw nb::python_error();
  }
  Bytes(const Bytes&) = delete;
  Bytes& operator=(const Bytes&) = delete;
  ~Bytes() { PyBuffer_Release(&view); }
  std::span<const std::byte> span() const {
    return {static_cast<const std::byte*>(view.buf), static_cast<std::size_t>(view.len)};
  }
  /// Only for a buffer requested with PyBUF_WRITABLE.
  std::span<std::byte> writable() const {
    return {static_cast<std::byte*>(view.buf), static_cast<std::size_t>(view.len)};
  }
  Py_buffer view{};
};

/// The numbers in the memory of a Python object.
template <class T>
std::vector<T> numbers_in(nb::handle owner) {
  const Bytes bytes(owner);
  std::vector<T> numbers(bytes.span().size() / sizeof(T));
  if (!numbers.empty())
    std::memcpy(numbers.data(), bytes.span().data(), numbers.size() * sizeof(T));
  return numbers;
}

inline std::span<const std::byte> span_of(const nb::bytes& bytes) {
  return std::as_bytes(std::span(bytes.c_str(), bytes.size()));
}

template <class T>
nb::bytes bytes_of(const std::vector<T>& values) {
  return nb::bytes(values.data(), values.size() * sizeof(T));
}
