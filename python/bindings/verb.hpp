#pragma once

#include <nanobind/nanobind.h>

#include <string>
#include <utility>

#include "frontend.hpp"
#include "verbs.hpp"  // made by verbs.py

/// Raises the TypeError that Python raises for a function of this signature.
[[noreturn]] inline void refuse_call(const char* signature, nanobind::handle self,
                                     nanobind::handle arguments, nanobind::handle keywords) {
  const nanobind::object refuse = nanobind::module_::import_("o80.calls").attr("refuse");
  refuse(signature, self, arguments, keywords);
  throw nanobind::python_error();  // refuse() has raised
}

/// Adds a compiled method that o80.frontend declares.
///
/// A call with wrong arguments raises the TypeError of a Python function. For that the method takes
/// handles, which need no conversion: nanobind tries the second overload only for wrong arguments.
template <class Function, class... Arguments>
void def_verb(nanobind::class_<Frontend>& frontend, const char* name, const VerbText& text,
              Function&& function, const Arguments&... arguments) {
  frontend.def(name, std::forward<Function>(function), arguments..., nanobind::sig(text.signature),
               text.help);
  const std::string other = std::string("def ") + name + "(self, *wrong, **arguments) -> NoReturn";
  frontend.def(
      name,
      [signature = text.signature](nanobind::handle self, nanobind::args given,
                                   nanobind::kwargs keywords) -> nanobind::object {
        refuse_call(signature, self, given, keywords);
      },
      nanobind::sig(other.c_str()), text.help);  // the same text as above, so it is shown once
}

/// Adds a property that o80.frontend declares.
template <class Getter>
void def_noun(nanobind::class_<Frontend>& frontend, const char* name, const VerbText& text,
              Getter&& noun) {
  frontend.def_prop_ro(name, std::forward<Getter>(noun), nanobind::sig(text.signature), text.help);
}
