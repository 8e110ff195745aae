#pragma once

#include <string>

#include "nb.hpp"

/// Makes objects of a class refuse to be pickled: `__reduce__` raises TypeError and says what to
/// send instead.
template <class T>
void refuse_to_pickle(nb::class_<T>& type, const char* what, const char* instead) {
  type.def(
      "__reduce__",
      [what, instead](const T&) -> nb::object {
        throw nb::type_error(
            (std::string(what) + " cannot be pickled, it belongs to this process: send " + instead)
                .c_str());
      },
      nb::sig("def __reduce__(self) -> tuple[typing.Any, ...]"));
}
