#include "runtime/playing/played_segment.hpp"

#include "bindings.hpp"
#include "provenance.hpp"
#include "waiting.hpp"

using o80::PlayedSegment;

namespace {

using ConstBytes = std::span<const std::byte>;

PlayedSegment* make_played(const std::string& segment, ConstBytes description,
                           nb::handle provenance, bool bursting, bool simulated,
                           std::uint64_t history, bool journal, std::uint32_t permission) {
  return new PlayedSegment(
      o80::PlayedOptions{.segment = segment,
                         .description = description,
                         .provenance = provenance_in(provenance),
                         .bursting = bursting,
                         .clock = simulated ? o80::Clock::simulated : o80::Clock::monotonic,
                         .history = history,
                         .journal = journal,
                         .permission = permission});
}

}  // namespace

void bind_played_segment(nb::module_& m) {
  using Self = PlayedSegment;
  nb::class_<Self>(m, "PlayedSegment", "The segment of a recording being played.")
      .def(nb::new_(&make_played), "segment"_a, "description"_a, "provenance"_a, "bursting"_a,
           "simulated"_a, "history"_a, "journal"_a, "permission"_a)
      .def(
          "publish",
          [](Self& self, ConstBytes rows, std::span<const std::int64_t> due) {
            return self.publish(rows, due, Waiting::keep_waiting);
          },
          "rows"_a, "due"_a, nb::call_guard<Waiting>(),
          "Rows as bytes, and the due time of each as int64 [ns] (empty: at once). Returns how "
          "many were published before ask_to_stop().")
      .def(
          "wait_for_burst", [](Self& self) { return self.wait_for_burst(Waiting::keep_waiting); },
          nb::call_guard<Waiting>(),
          "After the last row: waits for another request. False after ask_to_stop().")
      .def(
          "serve",
          [](Self& self, ConstBytes rows) { return self.serve(rows, Waiting::keep_waiting); },
          "rows"_a, nb::call_guard<Waiting>(), "The same, as frontends request iterations.")
      .def("add_journal", &Self::add_journal, "entries"_a, "codec"_a,
           "Returns the iteration of the last entry.")
      .def("end", &Self::end)
      .def("ask_to_stop", &Self::ask_to_stop);
}
