#include "robot/replay.hpp"

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <tuple>
#include <vector>

#include "bindings.hpp"
#include "loop_options.hpp"
#include "o80/base/error.hpp"
#include "robot/library.hpp"
#include "waiting.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace {

using Times = nb::ndarray<const std::int64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
/// Iteration, decision, recorded, replayed.
using MismatchFields = std::tuple<std::int64_t, std::string, std::string, std::string>;

/// A replay that can be closed: its segment can be removed then.
class OpenReplay {
 public:
  /// `period` [ns].
  OpenReplay(const o80::RobotLibrary& library, const std::string& segment,
             const o80::OptionValues& loop, const o80::OptionValues& options, std::int64_t period) {
    o80::BackendOptions backend = loop_options_of(loop).backend;
    backend.segment = segment;
    backend.period = period;
    replay_ = std::make_unique<o80::Replay>(
        std::make_unique<o80::DriverInstance>(*library.table, options), backend);
  }

  void add(const std::vector<const o80::JournalEntry*>& entries) {
    for (const o80::JournalEntry* entry : entries) open().add(*entry);
  }
  bool run(const Times& times) {
    o80::Replay& replay = open();
    const std::span<const std::int64_t> rows(times.data(), times.size());
    const Waiting waiting;
    return replay.run(rows);
  }
  void begin_at(std::int64_t first) { open().begin_at(first); }
  void load_snapshot(std::uint32_t slot, const nb::bytes& bytes) {
    open().load_snapshot(slot, {reinterpret_cast<const std::byte*>(bytes.c_str()), bytes.size()});
  }
  void close() { replay_.reset(); }

  std::optional<MismatchFields> mismatch() {
    const auto& found = open().mismatch();
    if (!found) return std::nullopt;
    return MismatchFields{found->iteration, found->decision, found->recorded, found->replayed};
  }
  std::string fault() { return open().fault(); }
  std::string segment() { return open().segment(); }
  std::int64_t next() { return open().next(); }

 private:
  o80::Replay& open() {
    if (replay_ == nullptr) throw o80::Closed("this replay is closed");
    return *replay_;
  }

  std::unique_ptr<o80::Replay> replay_;
};

}  // namespace

void bind_replay(nb::module_& m) {
  nb::class_<OpenReplay>(m, "Replay", "Repeats a recorded run: see o80.replaying.")
      .def(nb::init<const o80::RobotLibrary&, const std::string&, const o80::OptionValues&,
                    const o80::OptionValues&, std::int64_t>(),
           "library"_a, "segment"_a, "loop"_a, "options"_a, "period"_a, nb::keep_alive<1, 2>())
      .def("add", &OpenReplay::add, "entries"_a)
      .def("run", &OpenReplay::run, "times"_a,
           nb::sig("def run(self, times: numpy.typing.NDArray[numpy.int64]) -> bool"))
      .def("begin_at", &OpenReplay::begin_at, "first"_a)
      .def("load_snapshot", &OpenReplay::load_snapshot, "slot"_a, "state"_a)
      .def("close", &OpenReplay::close)
      .def_prop_ro("mismatch", &OpenReplay::mismatch)
      .def_prop_ro("fault", &OpenReplay::fault)
      .def_prop_ro("segment", &OpenReplay::segment)
      .def_prop_ro("next", &OpenReplay::next);
}
