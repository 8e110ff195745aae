#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/map.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/string_view.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include "buffer.hpp"

// Every binding includes all casters by this header: without its caster, a cast compiles to a throw
// of std::bad_cast, and the linker may take that copy of the function for all other files.

namespace nb = nanobind;
using namespace nb::literals;
