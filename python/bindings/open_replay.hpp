#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "nb.hpp"
#include "o80/base/error.hpp"
#include "o80/runtime/journal.hpp"

/// A replay that can be closed: its segment can be removed then.
template <class Replay>
class OpenReplay {
 public:
  /// Iteration, decision, recorded, replayed.
  using MismatchFields = std::tuple<std::int64_t, std::string, std::string, std::string>;

  explicit OpenReplay(std::unique_ptr<Replay> replay) : replay_(std::move(replay)) {}

  Replay& open() {
    if (replay_ == nullptr) throw o80::Closed("this replay was closed: start another one");
    return *replay_;
  }
  void add(const std::vector<const o80::JournalEntry*>& entries) {
    for (const o80::JournalEntry* entry : entries) open().add(*entry);
  }
  void begin_at(std::int64_t first) { open().begin_at(first); }
  void close() { replay_.reset(); }

  std::optional<MismatchFields> mismatch() {
    const auto& found = open().mismatch();
    if (!found) return std::nullopt;
    return MismatchFields{found->iteration, found->decision, found->recorded, found->replayed};
  }
  std::string fault() { return open().fault(); }
  std::string segment() { return open().segment(); }
  std::int64_t next() { return open().next(); }

  /// Binds what both kinds of replay have.
  static nb::class_<OpenReplay> bind(nb::module_& m, const char* name, const char* text) {
    return nb::class_<OpenReplay>(m, name, text)
        .def("add", &OpenReplay::add, "entries"_a)
        .def("begin_at", &OpenReplay::begin_at, "first"_a)
        .def("close", &OpenReplay::close)
        .def_prop_ro("mismatch", &OpenReplay::mismatch)
        .def_prop_ro("fault", &OpenReplay::fault)
        .def_prop_ro("segment", &OpenReplay::segment)
        .def_prop_ro("next", &OpenReplay::next);
  }

 private:
  std::unique_ptr<Replay> replay_;
};
