#include "o80/memory/segment_list.hpp"
#include "bindings.hpp"
#include "memory/os/process_start.hpp"
#include "memory/segment/segment_name.hpp"
#include "waiting.hpp"

void bind_segment_list(nb::module_& m) {
  using o80::SegmentEntry;
  nb::class_<SegmentEntry>(m, "SegmentEntry", "A file in shared memory with a segment's name.")
      .def_ro("name", &SegmentEntry::name)
      .def_prop_ro("life",
                   [](const SegmentEntry& entry) { return std::string(name_of(entry.life)); })
      .def_prop_ro("state", [](const SegmentEntry& entry) { return std::string(entry.state()); })
      .def_ro("readable", &SegmentEntry::readable)
      .def_ro("pid", &SegmentEntry::pid)
      .def_ro("process_start", &SegmentEntry::process_start)
      .def_ro("started_at", &SegmentEntry::started_at, "[s] since 1970")
      .def_ro("user", &SegmentEntry::user)
      .def_ro("program", &SegmentEntry::program)
      .def_ro("epoch", &SegmentEntry::epoch)
      .def_ro("size", &SegmentEntry::bytes)
      .def_ro("played", &SegmentEntry::played)
      .def_ro("problem", &SegmentEntry::problem, "Reason why it is not readable.");
  m.def("list_segments", [] {
    const Waiting waiting;
    return o80::list_segments();
  });
  m.def("clean", [](const std::string& name) { return o80::clean(name); }, nb::arg("name"));
  m.def("process_start", &o80::process_start, nb::arg("pid"));
  m.def("clean_dead", &o80::clean_dead);
  m.def("directory_problem", &o80::directory_problem);
}
