#pragma once

#include <nanobind/nanobind.h>

#include <cstddef>
#include <span>

/// The memory of a Python object.
struct Bytes {
  explicit Bytes(nanobind::handle owner, int flags = PyBUF_SIMPLE) {
    if (PyObject_GetBuffer(owner.ptr(), &view, flags) != 0) throw nanobind::python_error();
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
