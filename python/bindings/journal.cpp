#include "o80/runtime/journal.hpp"

#include <memory>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "base/printable.hpp"
#include "bindings.hpp"
#include "enums.hpp"
#include "frontend.hpp"
#include "runtime/frontend/raw_journal.hpp"
#include "runtime/journal/recorded_journal.hpp"
#include "waiting.hpp"

namespace {

const char* word_of(o80::JournalRecord::Kind kind) {
  constexpr const char* kWords[] = {"command",      "purge",           "request",
                                    "take_control", "release_control", "resume",
                                    "mark",         "close_plan",      "unknown"};
  return kWords[static_cast<std::size_t>(kind)];
}

/// A getter of a member that is a word: a string.
template <class Owner, class Value>
auto word(Value Owner::* member) {
  return [member](const Owner& self) {
    const std::string_view text = to_text(self.*member);
    return nb::str(text.data(), text.size());
  };
}

/// A getter of a member that is an enumeration of o80.base.words.
template <class Value>
auto enumeration(Value o80::JournalEntry::* member) {
  return [member](const o80::JournalEntry& self) { return python_word(self.*member); };
}

/// At most `most` entries that are there.
std::vector<o80::JournalEntry> entries_of(o80::Journal& journal, std::size_t most) {
  std::vector<o80::JournalEntry> entries;
  const Waiting waiting;
  for (o80::JournalEntry entry; entries.size() < most && journal.next(entry);) {
    entries.push_back(std::move(entry));
  }
  return entries;
}

/// Actuator, number, and place, slope and curvature of each.
auto starts_of(const o80::JournalEntry& self) {
  std::vector<std::tuple<std::uint32_t, std::uint32_t, std::tuple<double, double, double>>> starts;
  for (const o80::ChunkStart& each : self.starts) {
    starts.emplace_back(each.actuator, each.number,
                        std::tuple{each.place, each.slope, each.curvature});
  }
  return starts;
}

/// Bytes, number of the first entry, number after the last one, whether there may be more, text and
/// iteration of the marks in them, whether entries are notable.
auto read_raw(o80::RawJournal& journal, std::size_t most) {
  const o80::RawJournal::Entries entries = journal.read(most);
  std::vector<std::pair<std::string, o80::Iteration>> marks;
  for (const auto& mark : entries.marks)
    marks.emplace_back(o80::printable(mark.text), mark.iteration);
  return std::tuple(bytes_of(entries.bytes), entries.first, entries.next, entries.more, marks,
                    entries.notable);
}

std::vector<o80::JournalEntry> decoded(o80::RecordedJournal& journal,
                                       std::span<const std::byte> bytes, std::int64_t codec) {
  std::vector<o80::JournalEntry> entries;
  journal.decode(bytes, entries, codec);
  return entries;
}

/// Journals in the format of files.
void bind_raw(nb::module_& m) {
  nb::class_<o80::RawJournal>(m, "RawJournal")
      .def(
          "__init__",
          [](o80::RawJournal* self, const Frontend& frontend, std::uint64_t first) {
            new (self) o80::RawJournal(frontend.untyped(), first);
          },
          "frontend"_a, "first"_a)
      .def_prop_ro("exists", &o80::RawJournal::exists)
      .def_prop_ro("unread", &o80::RawJournal::unread)
      .def("read", &read_raw, "most"_a);
  nb::class_<o80::RecordedJournal>(m, "RecordedJournal")
      .def(nb::init<std::shared_ptr<const o80::Description>, std::uint64_t, bool>(),
           "description"_a, "first"_a, "rests"_a = false)
      .def("decode", &decoded, "entries"_a, "codec"_a);
  m.attr("JOURNAL_CODEC") = o80::kJournalCodec;
}

void bind_record(nb::module_& m) {
  using o80::JournalRecord;
  using Target = JournalRecord::Target;
  nb::class_<Target>(m, "JournalTarget")
      .def_ro("actuator", &Target::actuator)
      .def_ro("mask", &Target::mask)
      .def_prop_ro("states", [](const Target& self) { return bytes_of(self.states); });
  nb::class_<JournalRecord>(m, "JournalRecord")
      .def_prop_ro("kind", [](const JournalRecord& self) { return word_of(self.kind); })
      .def_ro("id", &JournalRecord::id)
      .def_prop_ro("pace",
                   [](const JournalRecord& self) { return std::string(to_text(self.pace.pace)); })
      .def_prop_ro("amount", [](const JournalRecord& self) { return self.pace.amount; })
      .def_prop_ro("per_second", [](const JournalRecord& self) { return self.pace.per_second; })
      .def_prop_ro("mode", word(&JournalRecord::mode))
      .def_prop_ro("profile", word(&JournalRecord::profile))
      .def_prop_ro("start", word(&JournalRecord::start))
      .def_ro("rows", &JournalRecord::rows)
      .def_ro("row_times", &JournalRecord::row_times)
      .def_ro("due", &JournalRecord::due)
      .def_prop_ro("anchor", [](const JournalRecord& self) { return self.chunk.anchor; })
      .def_prop_ro("first", [](const JournalRecord& self) { return self.chunk.first; })
      .def_prop_ro("final", [](const JournalRecord& self) { return self.chunk.final; })
      .def_prop_ro("ease", [](const JournalRecord& self) { return self.chunk.ease; })
      .def_prop_ro("fixed", [](const JournalRecord& self) { return self.chunk.fixed; })
      .def_ro("targets", &JournalRecord::targets)
      .def_ro("actuator", &JournalRecord::actuator)
      .def_ro("only_own", &JournalRecord::only_own)
      .def_ro("request", &JournalRecord::request)
      .def_prop_ro("payload", [](const JournalRecord& self) { return bytes_of(self.payload); })
      .def_prop_ro("text", [](const JournalRecord& self) { return o80::printable(self.text); })
      .def_ro("halt", &JournalRecord::halt)
      .def_ro("unknown", &JournalRecord::unknown);
}

}  // namespace

void bind_journal(nb::module_& m) {
  using o80::Journal;
  using o80::JournalEntry;
  bind_record(m);
  bind_raw(m);
  nb::class_<JournalEntry>(m, "JournalEntry")
      .def_prop_ro("kind", word(&JournalEntry::kind))
      .def_ro("number", &JournalEntry::number)
      .def_ro("missed", &JournalEntry::missed)
      .def_ro("iteration", &JournalEntry::iteration)
      .def_ro("lane", &JournalEntry::lane)
      .def_ro("who", &JournalEntry::who)
      .def_ro("id", &JournalEntry::id)
      .def_ro("ticket", &JournalEntry::ticket)
      .def_ro("at", &JournalEntry::at)
      .def_ro("burst", &JournalEntry::burst)
      .def_ro("seen", &JournalEntry::seen, nb::sig("def seen(self) -> Seen | None"))
      .def_ro("records", &JournalEntry::records)
      .def_ro("records_lost", &JournalEntry::records_lost)
      .def_ro("clipped", &JournalEntry::clipped)
      .def_ro("row", &JournalEntry::row)
      .def_ro("shift", &JournalEntry::shift)
      .def_prop_ro("starts", &starts_of)
      .def_prop_ro("blocks", [](const JournalEntry& self) { return bytes_of(self.blocks); })
      .def_prop_ro("status", enumeration(&JournalEntry::status),
                   nb::sig("def status(self) -> Status"))
      .def_prop_ro("reason", enumeration(&JournalEntry::reason),
                   nb::sig("def reason(self) -> Reason"))
      .def_ro("halt", &JournalEntry::halt)
      .def_prop_ro("cause", word(&JournalEntry::cause))
      .def_ro("cut", &JournalEntry::cut)
      .def_ro("follows", &JournalEntry::follows)
      .def_ro("text", &JournalEntry::text)
      .def_ro("unknown", &JournalEntry::unknown)
      .def_ro("actuator", &JournalEntry::actuator)
      .def_ro("slot", &JournalEntry::slot)
      .def_prop_ro("kept", [](const JournalEntry& self) { return bytes_of(self.kept); });
  nb::class_<Journal>(m, "Journal")
      .def(
          "__init__",
          [](Journal* self, const Frontend& frontend) { new (self) Journal(frontend.untyped()); },
          "frontend"_a)
      .def_prop_ro("exists", &Journal::exists)
      .def("read", &entries_of, "most"_a)
      .def("seek", &Journal::seek, "number"_a)
      .def("seek_end", &Journal::seek_end);
}
