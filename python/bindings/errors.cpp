#include <cstring>

#include "bindings.hpp"
#include "errors.hpp"
#include "interpreter.hpp"
#include "o80/base/error.hpp"
#include "o80/runtime/move.hpp"
#include "o80/runtime/not_completed.hpp"
#include "observation.hpp"
#include "robot/group/inline_group.hpp"

namespace {

void translate(const std::exception_ptr& thrown, void*);

/// The Python exception for a C++ exception.
nb::object exception_of(const std::exception_ptr& thrown) {
  try {
    translate(thrown, nullptr);
  } catch (nb::python_error& error) {
    return nb::borrow(error.value());
  } catch (const std::exception& error) {
    set_error(python_error("Error"), error.what());
  } catch (...) {
    set_error(python_error("Error"), "an unknown C++ exception");
  }
  return nb::borrow(nb::python_error().value());
}

/// Calls Python; the interpreter may end meanwhile.
nb::object called(const nb::object& callable, const nb::tuple& arguments) {
  // nothing of C++ that a forced unwinding would have to leave stands between the two
  PyObject* const result =
      call_python([&] { return PyObject_CallObject(callable.ptr(), arguments.ptr()); });
  if (result == nullptr) throw nb::python_error();
  return nb::steal(result);
}

nb::object imported(const char* module) {
  PyObject* const found = call_python([&] { return PyImport_ImportModule(module); });
  if (found == nullptr) throw nb::python_error();
  return nb::steal(found);
}

/// Raises a class of o80.base.errors, made with these arguments.
void set_made(const char* name, const nb::tuple& arguments) {
  const nb::object type = python_error(name);
  PyErr_SetObject(type.ptr(), called(type, arguments).ptr());
}

/// Raises CopyFailed from the error of the first copy.
void set_copy_failed(const o80::CopyFailed& failed) {
  nb::dict errors;
  for (const o80::CopyFailed::Failure& failure : failed.failures()) {
    errors[nb::int_(failure.copy)] = exception_of(failure.error);
  }
  const nb::object error =
      called(python_error("CopyFailed"), nb::make_tuple(failed.what(), errors));
  const nb::object first = errors[nb::int_(failed.failures().front().copy)];
  PyException_SetCause(error.ptr(), nb::object(first).release().ptr());
  PyErr_SetObject(reinterpret_cast<PyObject*>(Py_TYPE(error.ptr())), error.ptr());
}

/// A row as Python sees it.
nb::object observation_of(const o80::UntypedObservation& row) {
  auto description =
      std::make_shared<o80::Description>(o80::Description{row.schema(), row.layout()});
  nb::object layout =
      called(imported("o80.rows.layout").attr("Layout"), nb::make_tuple(description));
  auto decoder = std::make_shared<const Decoder>(std::move(description), std::move(layout));
  return nb::cast(Observation(std::move(decoder), o80::UntypedObservation(row)));
}

void set_not_completed(const o80::NotCompleted& error) {
  nb::list handles;
  nb::list actuators;
  for (const o80::NotCompleted::End& end : error.ends()) {
    handles.append(nb::cast(end.handle));
    actuators.append(nb::tuple(nb::cast(end.actuators)));
  }
  set_made("NotCompleted",
           nb::make_tuple(error.what(), handles, actuators, observation_of(error.observation())));
}

void set_not_reached(const o80::NotReached& error) {
  const nb::object miss = python_error("Miss");
  nb::list misses;
  for (const o80::Miss& each : error.misses()) {
    misses.append(called(miss, nb::make_tuple(each.actuator, each.field, each.target, each.observed,
                                              each.distance, each.tolerance, each.unit)));
  }
  set_made("NotReached", nb::make_tuple(error.what(), error.batch(), nb::list(), misses,
                                        observation_of(error.observation())));
}

/// Raises the class of o80.base.errors with the name of the C++ class.
void translate(const std::exception_ptr& thrown, void*) {
#define O80_TRANSLATE(Name)                       \
  catch (const o80::Name& error) {                \
    set_error(python_error(#Name), error.what()); \
  }
  try {
    std::rethrow_exception(thrown);
  } catch (const o80::CopyFailed& failed) {
    set_copy_failed(failed);
  } catch (const o80::NotCompleted& error) {
    set_not_completed(error);
  } catch (const o80::NotReached& error) {
    set_not_reached(error);
  }
  O80_TRANSLATE(InvalidArgument)
  O80_TRANSLATE(TimeoutError)
  O80_TRANSLATE(SegmentTaken)
  O80_TRANSLATE(SegmentError)
  O80_TRANSLATE(SchemaMismatch)
  O80_TRANSLATE(BackendStopped)
  O80_TRANSLATE(BackendFailed)
  O80_TRANSLATE(BackendKilled)
  O80_TRANSLATE(BackendSuperseded)
  O80_TRANSLATE(BackendGone)
  O80_TRANSLATE(BackendHalted)
  O80_TRANSLATE(RowOverwritten)
  O80_TRANSLATE(LaneFull)
  O80_TRANSLATE(NoLane)
  O80_TRANSLATE(NotBursting)
  O80_TRANSLATE(ReadOnly)
  O80_TRANSLATE(UsedAfterFork)
  O80_TRANSLATE(Closed)
  O80_TRANSLATE(Cancelled)
  O80_TRANSLATE(DriverError)
  O80_TRANSLATE(Error)
#undef O80_TRANSLATE
}

}  // namespace

nb::object python_error(const char* name) { return imported("o80.base.errors").attr(name); }

void set_error(const nb::object& type, const char* text) {
  // the text may come from memory that other processes write: invalid UTF-8 must not hide the error
  const auto length = static_cast<Py_ssize_t>(std::strlen(text));
  const nb::object decoded = nb::steal(PyUnicode_DecodeUTF8(text, length, "replace"));
  if (decoded.is_valid()) call_python([&] { PyErr_SetObject(type.ptr(), decoded.ptr()); });
}

void raise_python(const char* name, const std::string& text) {
  set_error(python_error(name), text.c_str());
  throw nb::python_error();
}

void bind_errors(nb::module_&) { nb::register_exception_translator(translate); }
