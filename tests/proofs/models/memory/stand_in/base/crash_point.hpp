#pragma once

namespace model {
/// Throws Death if the process is to die here.
void pass(const char* label);
}  // namespace model

#define O80_CRASH_POINT(label) ::model::pass(label)
