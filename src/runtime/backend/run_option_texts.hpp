#pragma once

#include "o80/runtime/backend.hpp"

namespace o80 {

/// The options of a backend as names and texts, each as its loop option of that name takes it
/// (robot/loop_options.hpp). An option that is off and has no text for it is left out.
Provenance::Options texts_of(const BackendOptions& options);

}  // namespace o80
