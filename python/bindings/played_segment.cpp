#include "runtime/playing/played_segment.hpp"

#include <cstring>
#include <memory>
#include <vector>

#include "bindings.hpp"
#include "buffer.hpp"
#include "pickling.hpp"
#include "waiting.hpp"

using o80::PlayedSegment;

namespace {

/// The bytes of a text, also of one with lone surrogates (names of files that are not UTF-8).
std::string encoded(nb::handle text) {
  const nb::object bytes = text.attr("encode")("utf-8", "surrogateescape");
  const auto view = nb::cast<nb::bytes>(bytes);
  return {view.c_str(), view.size()};
}

std::string text_in(nb::handle object, const char* name) { return encoded(object.attr(name)); }

o80::Provenance::Options options_in(nb::handle object, const char* name) {
  o80::Provenance::Options options;
  for (const auto [key, value] : nb::cast<nb::dict>(object.attr(name)))
    options.emplace_back(encoded(key), encoded(value));
  return options;
}

/// Copy of an o80.rows.provenance.Provenance in C++.
o80::Provenance provenance_in(nb::handle object) {
  o80::Provenance provenance;
  provenance.robot = text_in(object, "robot");
  provenance.library = text_in(object, "library");
  provenance.library_sha256 = text_in(object, "library_sha256");
  provenance.built_with = text_in(object, "built_with");
  provenance.options = options_in(object, "options");
  provenance.run_options = options_in(object, "run_options");
  for (const nb::handle file : nb::cast<nb::tuple>(object.attr("files")))
    provenance.files.push_back(
        {text_in(file, "option"), text_in(file, "path"), text_in(file, "sha256")});
  provenance.version = text_in(object, "version");
  provenance.source_hash = text_in(object, "source_hash");
  provenance.motion_rules = nb::cast<std::int64_t>(object.attr("motion_rules"));
  provenance.wall_clock_offset = nb::cast<std::int64_t>(object.attr("wall_clock_offset"));
  return provenance;
}

PlayedSegment* make_played(const std::string& segment, nb::bytes description, nb::handle provenance,
                           bool bursting, bool simulated, std::uint64_t history, bool journal,
                           std::uint32_t permission) {
  o80::PlayedOptions options;
  options.segment = segment;
  options.description = span_of(description);
  options.provenance = provenance_in(provenance);
  options.bursting = bursting;
  options.clock = simulated ? o80::Clock::simulated : o80::Clock::monotonic;
  options.history = history;
  options.journal = journal;
  options.permission = permission;
  return new PlayedSegment(options);
}

std::size_t publish(PlayedSegment& self, nb::handle rows, nb::handle due) {
  const Bytes bytes(rows);
  const std::vector<std::int64_t> times = numbers_in<std::int64_t>(due);
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
      .def(nb::new_(&make_played), "segment"_a, "description"_a, "provenance"_a, "bursting"_a,
           "simulated"_a, "history"_a, "journal"_a, "permission"_a)
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
          [](PlayedSegment& self, nb::bytes entries, std::int64_t codec) {
            return self.add_journal(span_of(entries), codec);
          },
          "entries"_a, "codec"_a, "Returns the iteration of the last entry.")
      .def("end", &PlayedSegment::end)
      .def("ask_to_stop", &PlayedSegment::ask_to_stop);
}
