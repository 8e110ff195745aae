#include <nanobind/nanobind.h>

#include <string>

#include "o80/base/version.hpp"

NB_MODULE(_core, m) {
  m.doc() = "The compiled part of o80.";
  m.def(
      "version", [] { return nanobind::str(o80::version().data(), o80::version().size()); },
      "The version of the compiled library.");
}
