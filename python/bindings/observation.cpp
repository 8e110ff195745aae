#include "observation.hpp"

#include <algorithm>
#include <cstring>
#include <span>

#include "bindings.hpp"
#include "describe/table.hpp"
#include "interpreter.hpp"
#include "o80/base/error.hpp"
#include "schema_tables.hpp"

namespace {

struct Part {
  const char* name;
  const char* signature;
  const char* help;
};
constexpr Part kParts[] = {
    {"desired", "def desired(self) -> States",
     "The desired states: an array (actuators,), or a record of groups."},
    {"observed", "def observed(self) -> States",
     "The observed states: an array (actuators,), or a record of groups."},
    {"extended", "def extended(self) -> Record",
     "Further sensor values: a record with a value for each field."},
    {"active", "def active(self) -> numpy.typing.NDArray[numpy.bool_]",
     "True where a command or braking gave the desired state: bool (actuators,)."},
    {"clamped", "def clamped(self) -> numpy.typing.NDArray[numpy.bool_]",
     "True where the limits changed the desired state: bool (actuators,)."},
    {"braking", "def braking(self) -> numpy.typing.NDArray[numpy.bool_]",
     "True where the actuator comes to rest without a command: bool (actuators,)."},
    {"starved", "def starved(self) -> numpy.typing.NDArray[numpy.bool_]",
     "True where a plan of chunks has no row left and is not closed: bool (actuators,)."},
    {"off_plan", "def off_plan(self) -> numpy.typing.NDArray[numpy.float32]",
     "How far the desired states are from what commands ask for, where limits change them: "
     "(actuators,), the most of the numbers of each, in their units."}};

}  // namespace

Decoder::Decoder(std::shared_ptr<const o80::Description> what, nb::object how)
    : description(std::move(what)), layout(std::move(how)), flat(layout.attr("flat")) {
  for (const Part& part : kParts) ways.push_back(layout.attr("way_to")(part.name));
}

Numpy::Numpy() {
  const nb::object capsule =
      nb::module_::import_("numpy._core._multiarray_umath").attr("_ARRAY_API");
  void** const table = static_cast<void**>(PyCapsule_GetPointer(capsule.ptr(), nullptr));
  if (table == nullptr) throw nb::python_error();
  type_ = static_cast<PyTypeObject*>(table[2]);
  make_ = reinterpret_cast<decltype(make_)>(table[94]);           // PyArray_NewFromDescr
  set_base_ = reinterpret_cast<decltype(set_base_)>(table[282]);  // PyArray_SetBaseObject
}

nb::object Numpy::view(nb::handle row, nb::handle way) const {
  constexpr int kBehaved = 0x500;   // aligned, writable
  constexpr std::size_t kMost = 8;  // more dimensions than any states have
  const nb::handle shape(PyTuple_GET_ITEM(way.ptr(), 0));
  const nb::handle dtype(PyTuple_GET_ITEM(way.ptr(), 1));
  const std::size_t offset = PyLong_AsSize_t(PyTuple_GET_ITEM(way.ptr(), 2));
  Py_intptr_t lengths[kMost] = {};
  const auto count = std::min<std::size_t>(nb::len(shape), kMost);
  for (std::size_t i = 0; i < count; ++i) {
    lengths[i] = PyLong_AsSsize_t(PyTuple_GET_ITEM(shape.ptr(), i));
  }
  std::byte* const data = nb::inst_ptr<Observation>(row)->row.bytes() + offset;
  // it takes over a reference to the dtype
  PyObject* const array = make_(type_, nb::object(nb::borrow(dtype)).release().ptr(),
                                static_cast<int>(count), lengths, nullptr, data, kBehaved, nullptr);
  if (array == nullptr) throw nb::python_error();
  nb::object made = nb::steal(array);
  if (set_base_(array, nb::object(nb::borrow(row)).release().ptr()) != 0) throw nb::python_error();
  return made;
}

namespace {

int fill_buffer(PyObject* self, Py_buffer* view, int flags) {
  auto* observation = nb::inst_ptr<Observation>(self);
  return PyBuffer_FillInfo(view, self, observation->row.bytes(),
                           static_cast<Py_ssize_t>(observation->row.size()), 0, flags);
}

PyType_Slot buffer_slots[] = {{Py_bf_getbuffer, reinterpret_cast<void*>(&fill_buffer)},
                              {0, nullptr}};

/// A row copied out of an array of rows.
Observation* from_bytes(std::shared_ptr<const Decoder> decoder, std::span<const std::byte> row,
                        std::int64_t missed) {
  auto observation = std::make_unique<Observation>(std::move(decoder));
  if (row.size() != observation->row.size()) {
    throw o80::InvalidArgument("a row of this robot has " +
                               std::to_string(observation->row.size()) + " bytes");
  }
  std::memcpy(observation->row.bytes(), row.data(), row.size());
  observation->missed = missed;
  return observation.release();
}

const Decoder& decoder_of(nb::handle observation) {
  return *nb::inst_ptr<Observation>(observation)->decoder;
}

/// A part of a row; `place`: in kParts.
nb::object decoded(nb::handle self, std::size_t place) {
  const Decoder& decoder = decoder_of(self);
  const nb::handle way = decoder.ways[place];
  return call_python([&]() -> nb::object {
    return PyTuple_CheckExact(way.ptr()) != 0 ? decoder.numpy.view(self, way) : way(self);
  });
}

nb::bytes table_of(const o80::Description& description) {
  return bytes_of(o80::to_bytes(description.schema));
}

/// Its decoder, bytes and number of missed rows, for pickle.
nb::tuple reduce(nb::handle self) {
  const auto* observation = nb::inst_ptr<Observation>(self);
  const nb::bytes row(observation->row.bytes(), observation->row.size());
  return nb::make_tuple(self.type(),
                        nb::make_tuple(observation->decoder, row, observation->missed));
}

std::shared_ptr<o80::Description> description_from(std::span<const std::byte> schema,
                                                   std::uint64_t epoch) {
  o80::Schema read = o80::schema_from_bytes(schema);
  const o80::RowLayout layout = o80::row_layout(read);
  return std::make_shared<o80::Description>(o80::Description{std::move(read), layout, epoch});
}

}  // namespace

void bind_observation(nb::module_& m) {
  nb::class_<o80::Description>(m, "Description", "A robot as its segment describes it.")
      .def(nb::new_(&description_from), "schema"_a, "epoch"_a = 0)
      .def(
          "schema", [](const o80::Description& self) { return o80::tables_of(self.schema); },
          nb::sig("def schema(self) -> dict[str, typing.Any]"))
      .def("table", &table_of)
      .def("model", [](const o80::Description& self) { return self.schema.shown.mjcf; });

  nb::class_<Decoder>(m, "Decoder", "Converts rows of one robot to arrays.")
      .def(nb::init<std::shared_ptr<const o80::Description>, nb::object>(), "description"_a,
           "layout"_a)
      .def_prop_ro(
          "layout", [](const Decoder& self) { return self.layout; },
          nb::sig("def layout(self) -> typing.Any"))
      .def_prop_ro("epoch", [](const Decoder& self) { return self.description->epoch; })
      .def(
          "__reduce__",
          [](const Decoder& self) {
            return nb::make_tuple(
                nb::module_::import_("o80.rows.layout").attr("decoder_of"),
                nb::make_tuple(table_of(*self.description), self.description->epoch));
          },
          nb::sig("def __reduce__(self) -> tuple[typing.Any, ...]"));

  nb::class_<Observation> observation(
      m, "Observation", nb::type_slots(buffer_slots),
      R"(One row of the history: desired, observed and extended values of one iteration.

The arrays are views of this observation's own copy of the row, which does not change.)");
  observation.attr("__iter__") = nb::none();
  observation.def(nb::new_(&from_bytes), "decoder"_a, "row"_a, "missed"_a = 0)
      .def("__reduce__", &reduce, nb::sig("def __reduce__(self) -> tuple[typing.Any, ...]"))
      .def(
          "__getitem__",
          [](nb::handle self, nb::handle path) {
            const nb::object read = nb::module_::import_("o80.rows.columns").attr("numbers_in");
            return read(self, decoder_of(self).layout, path);
          },
          nb::sig("def __getitem__(self, path: str) -> typing.Any"), "path"_a,
          "The numbers at a path: `row[\"observed.joint1.position\"]`, or of a group, (n,).")
      .def_prop_ro(
          "iteration", [](const Observation& self) { return self.row.iteration(); },
          "The iteration of this row.")
      .def_prop_ro(
          "epoch", [](const Observation& self) { return self.row.epoch(); },
          "The number of the run that published it; 0: not known.")
      .def_prop_ro(
          "time", [](const Observation& self) { return self.row.time(); },
          "When it was published [ns]: of the monotonic clock, or simulated in bursting.")
      .def_prop_ro(
          "lateness", [](const Observation& self) { return self.row.head().lateness; },
          "Delay between the due time and the begin of the iteration [ns].")
      .def_prop_ro(
          "overruns", [](const Observation& self) { return self.row.head().overruns; },
          "Number of iterations so far that were late.")
      .def_prop_ro(
          "skipped", [](const Observation& self) { return self.row.head().skipped; },
          "Number of periods so far that were skipped.")
      .def_prop_ro(
          "fresh", [](const Observation& self) { return self.row.head().fresh != 0; },
          "True if this is the row of a fresh start.")
      .def_prop_ro(
          "halted", [](const Observation& self) { return self.row.head().halted != 0; },
          "True if a halt was in force in this row.")
      .def_prop_ro(
          "starvations", [](const Observation& self) { return self.row.head().starvations; },
          "Number of iterations so far in which a plan of chunks began to be starved.")
      .def_ro("missed", &Observation::missed,
              "Number of rows between the row read before and this one that were overwritten; set "
              "by wait_for_next and stream.")
      .def(
          "flat",
          [](nb::handle self, nb::handle dtype) {
            return call_python([&] { return decoder_of(self).flat(self, dtype); });
          },
          "dtype"_a = nb::none(),
          nb::sig("def flat(self, dtype: numpy.typing.DTypeLike | None = None) -> "
                  "numpy.typing.NDArray[typing.Any]"),
          "All observed numbers, then all extended ones, as one vector (default: float32).")
      .def(
          "__repr__",
          [](nb::handle self) {
            return call_python([&] { return decoder_of(self).layout.attr("text")(self); });
          },
          nb::sig("def __repr__(self) -> str"));
  for (std::size_t i = 0; i < std::size(kParts); ++i) {
    observation.def_prop_ro(
        kParts[i].name, [i](nb::handle self) { return decoded(self, i); },
        nb::sig(kParts[i].signature), kParts[i].help);
  }
}
