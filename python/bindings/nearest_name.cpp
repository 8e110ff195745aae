#include "o80/base/nearest_name.hpp"

#include "bindings.hpp"

void bind_nearest_name(nb::module_& m) {
  m.def("nearest_name", &o80::nearest_name, nb::arg("given"), nb::arg("known"),
        "The known name that was probably meant, or an empty text.");
  m.def("names_instead", &o80::names_instead, nb::arg("given"), nb::arg("known"),
        "The end of an error text about an unknown name: known names and the nearest one.");
}
