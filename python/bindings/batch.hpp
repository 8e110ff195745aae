#pragma once

#include <memory>

#include "errors.hpp"
#include "interpreter.hpp"
#include "nb.hpp"
#include "o80/runtime/batch.hpp"
#include "o80/runtime/move.hpp"
#include "observation.hpp"
#include "waiting.hpp"

/// A requested burst, and the decoder of its row.
struct PendingBurst {
  o80::Burst burst;
  std::shared_ptr<const Decoder> decoder;
};

/// Calls `wait` without the GIL; an o80.TimeoutError gets the batch as its member (a NotReached has
/// it already).
template <class Wait>
auto carrying(const o80::Batch& batch, Wait&& wait) {
  try {
    return without_gil(wait);
  } catch (const o80::NotReached&) {
    throw;
  } catch (const o80::TimeoutError& error) {
    call_python([&] {
      const nb::object type = python_error("TimeoutError");
      const nb::object raised = type(error.what(), nb::cast(batch));
      PyErr_SetObject(type.ptr(), raised.ptr());
    });
    throw nb::python_error();
  }
}
