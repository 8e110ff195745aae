#include "runtime/played_segment.hpp"

#include <nanobind/nanobind.h>
#include <nanobind/stl/string.h>

#include <cstring>
#include <memory>
#include <vector>

#include "bindings.hpp"
#include "buffer.hpp"
#include "pickling.hpp"
#include "waiting.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using o80::PlayedSegment;

namespace {

PlayedSegment* make_played(const std::string& segment, nb::bytes description, bool bursting,
                           bool simulated, std::uint64_t history, bool journal,
                           std::uint32_t permission) {
  o80::PlayedOptions options;
  options.segment = segment;
  options.description = {reinterpret_cast<const std::byte*>(description.c_str()),
                         description.size()};
  options.bursting = bursting;
  options.clock = simulated ? o80::Clock::simulated : o80::Clock::monotonic;
  options.history = history;
  options.journal = journal;
  options.permission = permission;
  return new PlayedSegment(options);
}

std::size_t publish(PlayedSegment& self, nb::handle rows, nb::handle due) {
  const Bytes bytes(rows);
  const Bytes due_bytes(due);
  std::vector<std::int64_t> times(due_bytes.span().size() / sizeof(std::int64_t));
  if (!times.empty()) std::memcpy(times.data(), due_bytes.span().data(), times.size() * 8);
  const Waiting waiting;
  return self.publish(bytes.span(), times, Waiting::keep_waiting);
}

std::size_t serve(PlayedSegment& self, nb::handle rows) {
  const Bytes bytes(rows);
  const Waiting waiting;
  return self.serve(bytes.span(), Waiting::keep_waiting);
}

}  // namespace

void bind_played_segment(nb::module_& m) {
  nb::class_<PlayedSegment> bound(m, "PlayedSegment", "The segment of a recording being played.");
  refuse_to_pickle(bound, "a played segment", "the path of the recording");
  bound
      .def(nb::new_(&make_played), "segment"_a, "description"_a, "bursting"_a, "simulated"_a,
           "history"_a, "journal"_a, "permission"_a)
      .def_prop_ro("row_bytes", &PlayedSegment::row_bytes)
      .def("publish", &publish, "rows"_a, "due"_a,
           "Rows as bytes, and the due time of each as int64 [ns] (empty: at once). Returns how "
           "many were published before ask_to_stop().")
      .def(
          "wait_for_burst",
          [](PlayedSegment& self) {
            const Waiting waiting;
            return self.wait_for_burst(Waiting::keep_waiting);
          },
          "After the last row: waits for another request. False after ask_to_stop().")
      .def("serve", &serve, "rows"_a, "The same, as frontends request iterations.")
      .def(
          "add_journal",
          [](PlayedSegment& self, nb::bytes entries) {
            return self.add_journal(
                {reinterpret_cast<const std::byte*>(entries.c_str()), entries.size()});
          },
          "entries"_a, "Returns the iteration of the last entry.")
      .def("end", &PlayedSegment::end)
      .def("ask_to_stop", &PlayedSegment::ask_to_stop);
}
