#pragma once

#include "nb.hpp"

// What each file of this folder adds to the module.

void bind_errors(nb::module_& module);
void bind_segment_list(nb::module_& module);
void bind_observation(nb::module_& module);
void bind_batch(nb::module_& module);
void bind_canceller(nb::module_& module);
void bind_frontend(nb::module_& module);
void bind_control(nb::module_& module);
void bind_backend(nb::module_& module);
void bind_inline_group(nb::module_& module);
void bind_robots(nb::module_& module);
void bind_loop_state(nb::module_& module);
void bind_journal(nb::module_& module);
void bind_provenance(nb::module_& module);
void bind_played_segment(nb::module_& module);
void bind_nearest_name(nb::module_& module);
void bind_python_driver(nb::module_& module);
void bind_replay(nb::module_& module);
