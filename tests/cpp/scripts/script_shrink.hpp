#pragma once

#include <functional>

#include "scripts/script.hpp"

namespace o80::test {

/// A short script that still fails: steps, rows, limits and iterations are left out, and values
/// made simpler, as long as `fails` says so.
Script shrunk(Script script, const std::function<bool(const Script&)>& fails);

}  // namespace o80::test
