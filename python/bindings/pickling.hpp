#pragma once

#include <nanobind/nanobind.h>

#include <string>

/// The `__reduce__` of what lives in this process only: raises TypeError, saying what to send.
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
