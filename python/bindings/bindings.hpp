#pragma once

#include <nanobind/nanobind.h>

// What each file of this folder adds to the module.

void bind_errors(nanobind::module_& module);
void bind_segment_list(nanobind::module_& module);
void bind_observation(nanobind::module_& module);
void bind_batch(nanobind::module_& module);
void bind_canceller(nanobind::module_& module);
void bind_frontend(nanobind::module_& module);
void bind_control(nanobind::module_& module);
void bind_backend(nanobind::module_& module);
void bind_inline_group(nanobind::module_& module);
void bind_robots(nanobind::module_& module);
void bind_loop_state(nanobind::module_& module);
void bind_journal(nanobind::module_& module);
void bind_provenance(nanobind::module_& module);
void bind_played_segment(nanobind::module_& module);
void bind_nearest_name(nanobind::module_& module);
void bind_python_driver(nanobind::module_& module);
void bind_replay(nanobind::module_& module);
