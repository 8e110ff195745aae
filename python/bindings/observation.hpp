#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "nb.hpp"
#include "o80/runtime/observation.hpp"

/// Makes arrays by the table of functions that NumPy gives to compiled modules, whose places do not
/// change: numpy.ndarray takes twice as long.
class Numpy {
 public:
  Numpy();
  /// An array over a row. `way`: its shape, dtype and offset in the row.
  nb::object view(nb::handle row, nb::handle way) const;

 private:
  PyTypeObject* type_;
  PyObject* (*make_)(PyTypeObject*, PyObject* dtype, int dimensions, const Py_intptr_t* lengths,
                     const Py_intptr_t* strides, void* data, int flags, PyObject* like);
  int (*set_base_)(PyObject* array, PyObject* base);
};

/// Converts rows of one robot to arrays: the methods of its o80.rows.layout.Layout, looked up once,
/// or the way to a plain array.
struct Decoder {
  Decoder(std::shared_ptr<const o80::Description> description, nb::object layout);

  std::shared_ptr<const o80::Description> description;
  Numpy numpy;
  nb::object layout, flat;
  std::vector<nb::object> ways;  // to the parts of a row
};

/// A row and its decoder. Python sees the bytes as a buffer.
struct Observation {
  explicit Observation(std::shared_ptr<const Decoder> how)
      : decoder(std::move(how)), row(decoder->description) {}
  Observation(std::shared_ptr<const Decoder> how, o80::UntypedObservation&& filled)
      : decoder(std::move(how)), row(std::move(filled)) {}

  std::shared_ptr<const Decoder> decoder;
  o80::UntypedObservation row;
  std::int64_t missed = 0;
};
