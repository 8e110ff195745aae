#pragma once

#include "torture/actor.hpp"

namespace torture {

/// Halts the backend, and writes down when it was asked for and when that was answered.
void halt(Actor& actor, o80::UntypedFrontend& frontend);
/// The same for whatever backend has the name now, also one that is still starting.
void halt_by_name(Actor& actor);
/// Tries to end the halt that acts, if one does; sometimes by a number that is not its own.
void resume(Actor& actor, o80::UntypedFrontend& frontend, std::int64_t& call_began);

}  // namespace torture
