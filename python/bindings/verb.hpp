#pragma once

#include <utility>

#include "frontend.hpp"
#include "nb.hpp"
#include "verbs.hpp"  // made by verbs.py

/// Makes a method that nanobind has added look like one of Python's own.
void make_verb(nb::class_<Frontend>& frontend, const VerbText& text);

/// Adds a compiled method that o80.frontend declares.
///
/// A call with wrong arguments raises the TypeError of a Python function. The method takes handles,
/// so that nanobind itself refuses only a wrong number of arguments and wrong names.
template <class Function, class... Arguments>
void def_verb(nb::class_<Frontend>& frontend, const VerbText& text, Function&& function,
              const Arguments&... arguments) {
  frontend.def(text.name, std::forward<Function>(function), arguments..., nb::sig(text.signature),
               text.help);
  make_verb(frontend, text);
}

/// Adds a property that o80.frontend declares.
template <class Getter>
void def_noun(nb::class_<Frontend>& frontend, const VerbText& text, Getter&& noun) {
  frontend.def_prop_ro(text.name, std::forward<Getter>(noun), nb::sig(text.signature), text.help);
}

/// A method without arguments of the core's frontend.
template <auto method>
auto of_core(const Frontend& self) {
  return (self.untyped().*method)();
}
