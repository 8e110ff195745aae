#pragma once

#include <cstdint>

#include "torture/actor.hpp"

namespace torture {

/// Reads the journal of a backend that was, and compares it with what the senders know: each batch
/// was decided on once, in the iteration that its sender was told, and ended as the feedback says.
void audit_journal(Actor& actor, const o80::UntypedFrontend& frontend, std::uint32_t generation);

}  // namespace torture
