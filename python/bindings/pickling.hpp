#pragma once

#include <nanobind/nanobind.h>

#include <string>

/// Makes objects of a class refuse to be pickled: `__reduce__` raises TypeError and says what to
/// send instead.
template <class T>
void refuse_to_pickle(nanobind::class_<T>& type, const char* what, const char* instead) {
  type.def(
      "__reduce__",
      [what, instead](const T&) -> nanobind::object {
        throw nanobind::type_error(
            (std::string(what) + " cannot be pickled, it belongs to this process: send " + instead)
                .c_str());
      },
      nanobind::sig("def __reduce__(self) -> tuple[typing.Any, ...]"));
}
