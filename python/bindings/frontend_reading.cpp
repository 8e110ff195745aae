// How a frontend reads rows.

#include <algorithm>
#include <utility>

#include "arguments.hpp"
#include "frontend.hpp"
#include "pickling.hpp"
#include "runtime/frontend/link.hpp"
#include "verb.hpp"
#include "waiting.hpp"

using o80::Iteration;
using o80::UntypedFrontend;
using o80::UntypedObservation;

namespace {

Observation latest(const Frontend& self) {
  Observation observation = self.blank();
  self.untyped().latest(observation.row.bytes());
  return observation;
}

Observation wait_for(const Frontend& self, nb::handle iteration, Patience timeout) {
  const Iteration wanted = count_of(iteration, "the iteration to wait for");
  Observation observation = self.blank();
  self.released([&](UntypedFrontend& frontend) {
    frontend.wait_for(wanted, observation.row.bytes(), timeout, Waiting::keep_waiting);
  });
  return observation;
}

/// Moves the position behind the row that was read.
Observation next_row(const std::shared_ptr<UntypedFrontend>& frontend,
                     const std::shared_ptr<const Decoder>& decoder, Iteration& position,
                     o80::Timeout timeout) {
  Observation observation(decoder);
  const Waiting waiting;
  observation.missed =
      frontend->wait_for_next(position, observation.row.bytes(), timeout, Waiting::keep_waiting);
  return observation;
}

/// The next row of a frontend from `next` on. Another thread may have read a row or attached again
/// meanwhile.
Observation next_row_of(Frontend& self, const std::shared_ptr<UntypedFrontend>& core,
                        Iteration next, o80::Timeout timeout) {
  Observation observation = next_row(core, self.decoder(), next, timeout);
  if (core == self.shared()) self.next = std::max(self.next, next);
  return observation;
}

/// The row that wait_for_next returns next.
Iteration next_of(Frontend& self) {
  if (self.next < 0) self.next = self.untyped().published() + 1;
  return self.next;
}

Observation wait_for_next(Frontend& self, Patience timeout) {
  return next_row_of(self, self.shared(), next_of(self), timeout);
}

/// Waits until a row is published; it may be overwritten since.
void await_row(const UntypedFrontend& frontend, Iteration k, o80::Timeout timeout) {
  UntypedObservation row(frontend.description());
  const Waiting waiting;
  try {
    frontend.wait_for(k, row.bytes(), timeout, Waiting::keep_waiting);
  } catch (const o80::RowOverwritten&) {
    // it was published
  }
}

/// The frontends whose rows are published, with these rows. None as a row is the next in sequence.
std::vector<std::pair<Frontend*, Observation>> wait_for_first(
    const std::vector<std::pair<Frontend*, nb::object>>& wanted, Patience timeout) {
  std::vector<std::shared_ptr<UntypedFrontend>> alive;
  std::vector<o80::RowWish> wishes;
  for (const auto& [frontend, iteration] : wanted) {
    const Iteration row =
        iteration.is_none() ? next_of(*frontend) : count_of(iteration, "the iteration to wait for");
    alive.push_back(frontend->shared());
    wishes.push_back({.frontend = alive.back().get(), .row = row});
  }
  const std::vector<std::size_t> there =
      without_gil([&] { return o80::wait_for_first(wishes, timeout, Waiting::keep_waiting); });
  std::vector<std::pair<Frontend*, Observation>> rows;
  for (const std::size_t i : there) {
    Frontend& frontend = *wanted[i].first;
    if (wanted[i].second.is_none()) {
      rows.emplace_back(&frontend, next_row_of(frontend, alive[i], wishes[i].row, {}));
    } else {
      Observation observation = frontend.blank();
      alive[i]->wait_for(wishes[i].row, observation.row.bytes(), std::chrono::nanoseconds(0));
      rows.emplace_back(&frontend, std::move(observation));
    }
  }
  return rows;
}

/// Iterates over rows in sequence, with a position of its own.
struct Stream {
  std::shared_ptr<UntypedFrontend> frontend;
  std::shared_ptr<const Decoder> decoder;
  Iteration next;
  o80::Timeout timeout;
};

Stream open_stream(const Frontend& self, nb::handle since, Patience timeout) {
  const Iteration next = self.untyped().published() + 1;
  const Iteration first = since.is_none() ? next : count_of(since, "since");
  return {self.shared(), self.decoder(), std::max<Iteration>(first, 0), timeout};
}

/// Fills an array of rows; returns the first iteration and the number of rows. With parts (those of
/// HistoryReader, as numbers) a row of the array has `packed` bytes.
std::pair<Iteration, std::size_t> read_rows(const Frontend& self, Iteration first,
                                            std::span<std::byte> to,
                                            std::span<const o80::HistoryReader::Part> parts,
                                            std::size_t packed) {
  const auto frontend = self.shared();
  const o80::HistoryReader& history = frontend->link()->history;
  const Waiting waiting;
  const o80::HistoryReader::Range range =
      parts.empty() ? history.read_range(first, to.size() / history.row_bytes(), to.data())
                    : history.read_parts(first, to.size() / packed, parts, packed, to.data());
  return {range.first, range.count};
}

}  // namespace

void bind_reading(nb::module_& m, nb::class_<Frontend>& frontend) {
  nb::class_<Stream> stream(m, "Stream", "Every observation, in order.");
  stream
      .def(
          "__iter__", [](nb::object self) { return self; }, nb::sig("def __iter__(self) -> Stream"))
      .def("__next__",
           [](Stream& self) {
             Iteration next = self.next;
             Observation observation = next_row(self.frontend, self.decoder, next, self.timeout);
             self.next = std::max(self.next, next);
             return observation;
           })
      .def(
          "__aiter__", [](nb::object self) { return self; },
          nb::sig("def __aiter__(self) -> Stream"))
      .def(
          "__anext__",
          [](nb::handle self) {
            return nb::module_::import_("o80.base.awaiting").attr("next_of")(self);
          },
          nb::sig("def __anext__(self) "
                  "-> collections.abc.Coroutine[typing.Any, typing.Any, Observation]"))
      .def_prop_ro(
          "_ready", [](const Stream& self) { return self.frontend->published() >= self.next; },
          "Whether the next observation is there.")
      .def("_await_row",
           [](const Stream& self) { await_row(*self.frontend, self.next, self.timeout); });
  refuse_to_pickle(stream, "a stream", "its frontend, and open a stream of that");

  def_verb(frontend, verbs::latest, &latest);
  def_verb(frontend, verbs::wait_for, &wait_for, "iteration"_a.none(), "timeout"_a = nb::none());
  def_verb(frontend, verbs::wait_for_next, &wait_for_next, "timeout"_a = nb::none());
  def_verb(frontend, verbs::stream, &open_stream, "since"_a = nb::none(), "timeout"_a = nb::none());
  def_noun(frontend, verbs::published, &of_core<&UntypedFrontend::published>);
  def_noun(frontend, verbs::oldest, &of_core<&UntypedFrontend::oldest>);
  m.def("wait_for_first", &wait_for_first, "wanted"_a, "timeout"_a.none());
  frontend.def_prop_ro("_next", &next_of)
      .def(
          "_await_row",
          [](const Frontend& self, Iteration k, Patience timeout) {
            await_row(*self.shared(), k, timeout);
          },
          "iteration"_a, "timeout"_a.none())
      .def(
          "_iteration_at",
          [](const Frontend& self, std::int64_t time) { return self.untyped().iteration_at(time); },
          "time"_a)
      .def(
          "_at_time",
          [](const Frontend& self, std::int64_t time) {
            return Observation(self.decoder(), self.shared()->at_time(time));
          },
          "time"_a)
      .def("_read_rows", &read_rows, "first"_a, "array"_a, "parts"_a = nb::bytes("", 0),
           "packed"_a = 0);
}
