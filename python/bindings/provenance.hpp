#pragma once

#include "nb.hpp"
#include "o80/runtime/provenance.hpp"

/// A copy of an o80.Provenance in C++.
o80::Provenance provenance_in(nb::handle object);
