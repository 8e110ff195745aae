#include "bindings.hpp"

void bind_backend(nanobind::module_&) {}
