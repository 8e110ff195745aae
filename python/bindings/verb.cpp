#include "verb.hpp"

#include <structmember.h>

#include <cstddef>

namespace {

/// A method of a class as Python's own: it has a signature, and explains wrong arguments.
///
/// It forwards each call to the method that nanobind made.
struct Verb {
  PyObject_HEAD vectorcallfunc call;
  PyObject* native;
  vectorcallfunc call_native;
  VerbText text;
};

Verb* verb_of(PyObject* self) { return reinterpret_cast<Verb*>(self); }

/// Raises what Python raises for wrong arguments in the place of a TypeError of nanobind. Another
/// TypeError stays.
void explain(const Verb& verb, PyObject* const* arguments, Py_ssize_t count, PyObject* names) {
  if (count == 0) return;
  nb::python_error error;  // takes the exception
  try {
    nb::list given;
    nb::dict keywords;
    for (Py_ssize_t i = 1; i < count; ++i) given.append(nb::handle(arguments[i]));
    const Py_ssize_t named = names == nullptr ? 0 : PyTuple_GET_SIZE(names);
    for (Py_ssize_t i = 0; i < named; ++i) {
      keywords[nb::handle(PyTuple_GET_ITEM(names, i))] = nb::handle(arguments[count + i]);
    }
    const nb::object refuse = nb::module_::import_("o80.base.signatures").attr("refuse");
    refuse(verb.text.signature, nb::handle(arguments[0]), given, keywords, error.value());
    error.restore();
  } catch (nb::python_error& refused) {
    refused.restore();
  }
}

PyObject* call_verb(PyObject* self, PyObject* const* arguments, std::size_t count,
                    PyObject* names) {
  const Verb& verb = *verb_of(self);
  PyObject* result = verb.call_native(verb.native, arguments, count, names);
  if (result == nullptr && PyErr_ExceptionMatches(PyExc_TypeError) != 0) {
    explain(verb, arguments, PyVectorcall_NARGS(count), names);
  }
  return result;
}

PyObject* bind_verb(PyObject* self, PyObject* object, PyObject* /*type*/) {
  if (object == nullptr || object == Py_None) return Py_NewRef(self);
  return PyMethod_New(self, object);
}

PyObject* repr_of_verb(PyObject* self) {
  return PyUnicode_FromFormat("<method '%s' of 'o80.Frontend'>", verb_of(self)->text.name);
}

void free_verb(PyObject* self) {
  PyTypeObject* type = Py_TYPE(self);
  Py_DECREF(verb_of(self)->native);
  type->tp_free(self);
  Py_DECREF(type);
}

PyObject* signature_of_verb(PyObject* self, void* /*unused*/) {
  try {
    const nb::object signature = nb::module_::import_("o80.base.signatures").attr("signature_of");
    return signature(verb_of(self)->text.signature).release().ptr();
  } catch (nb::python_error& error) {
    error.restore();
    return nullptr;
  }
}

PyMemberDef members_of_verb[] = {
    {"__vectorcalloffset__", T_PYSSIZET, offsetof(Verb, call), READONLY, nullptr},
    {"__name__", T_STRING, offsetof(Verb, text.name), READONLY, nullptr},
    {"__qualname__", T_STRING, offsetof(Verb, text.qualified_name), READONLY, nullptr},
    {"__doc__", T_STRING, offsetof(Verb, text.help), READONLY, nullptr},
    {nullptr, 0, 0, 0, nullptr}};

PyGetSetDef attributes_of_verb[] = {{"__signature__", signature_of_verb, nullptr, nullptr, nullptr},
                                    {nullptr, nullptr, nullptr, nullptr, nullptr}};

PyType_Slot slots_of_verb[] = {{Py_tp_call, reinterpret_cast<void*>(&PyVectorcall_Call)},
                               {Py_tp_descr_get, reinterpret_cast<void*>(&bind_verb)},
                               {Py_tp_repr, reinterpret_cast<void*>(&repr_of_verb)},
                               {Py_tp_dealloc, reinterpret_cast<void*>(&free_verb)},
                               {Py_tp_members, members_of_verb},
                               {Py_tp_getset, attributes_of_verb},
                               {0, nullptr}};

PyType_Spec spec_of_verb = {"o80._core.Verb", sizeof(Verb), 0,
                            Py_TPFLAGS_DEFAULT | Py_TPFLAGS_HAVE_VECTORCALL |
                                Py_TPFLAGS_METHOD_DESCRIPTOR | Py_TPFLAGS_DISALLOW_INSTANTIATION,
                            slots_of_verb};

}  // namespace

void make_verb(nb::class_<Frontend>& frontend, const VerbText& text) {
  static PyObject* const type = PyType_FromSpec(&spec_of_verb);
  if (type == nullptr) throw nb::python_error();
  nb::object native = frontend.attr(text.name);
  const nb::object verb = nb::steal(PyType_GenericAlloc(reinterpret_cast<PyTypeObject*>(type), 0));
  if (!verb.is_valid()) throw nb::python_error();
  Verb& made = *verb_of(verb.ptr());
  made.call = &call_verb;
  made.call_native = PyVectorcall_Function(native.ptr());
  made.native = native.release().ptr();
  made.text = text;
  nb::setattr(frontend, text.name, verb);
}
