#pragma once

#include <functional>

#include "scripts/script.hpp"

namespace o80::test {

/// A shorter script that still fails: steps and iterations are left out as long as `fails` says so.
Script shrunk(Script script, const std::function<bool(const Script&)>& fails);

}  // namespace o80::test
