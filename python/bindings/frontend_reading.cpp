// How a frontend reads what the backend published.

#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>

#include <algorithm>
#include <utility>

#include "arguments.hpp"
#include "buffer.hpp"
#include "frontend.hpp"
#include "pickling.hpp"
#include "runtime/link.hpp"
#include "waiting.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using o80::Iteration;
using o80::UntypedFrontend;

namespace {

Observation latest(const Frontend& self) {
  Observation observation = self.blank();
  self.untyped().latest(observation.row.bytes());
  return observation;
}

Observation wait_for(const Frontend& self, nb::handle iteration, Seconds timeout) {
  const Iteration wanted = count_of(iteration, "the iteration to wait for");
  Observation observation = self.blank();
  const auto frontend = self.shared();
  const Waiting waiting;
  frontend->wait_for(wanted, observation.row.bytes(), timeout_of(timeout), Waiting::keep_waiting);
  return observation;
}

/// Moves the position on.
Observation next_row(const std::shared_ptr<UntypedFrontend>& frontend,
                     const std::shared_ptr<const Decoder>& decoder, Iteration& position,
                     Seconds timeout) {
  Observation observation(decoder);
  const Waiting waiting;
  observation.missed = frontend->wait_for_next(position, observation.row.bytes(),
                                               timeout_of(timeout), Waiting::keep_waiting);
  return observation;
}

Observation wait_for_next(Frontend& self, Seconds timeout) {
  const auto frontend = self.shared();
  if (self.next < 0) self.next = frontend->published() + 1;
  Iteration next = self.next;
  Observation observation = next_row(frontend, self.decoder(), next, timeout);
  // another thread may have been here, or attached again
  if (frontend == self.shared()) self.next = std::max(self.next, next);
  return observation;
}

/// Rows in sequence, from a position of its own.
struct Stream {
  std::shared_ptr<UntypedFrontend> frontend;
  std::shared_ptr<const Decoder> decoder;
  Iteration next;
  Seconds timeout;
};

Stream open_stream(const Frontend& self, nb::handle since, Seconds timeout) {
  const Iteration next = self.untyped().published() + 1;
  const Iteration first = since.is_none() ? next : count_of(since, "since");
  return {self.shared(), self.decoder(), std::max<Iteration>(first, 0), timeout};
}

/// Fills an array of rows; gives the first iteration and how many there were.
std::pair<Iteration, std::size_t> read_rows(const Frontend& self, Iteration first,
                                            nb::handle array) {
  const Bytes bytes(array, PyBUF_WRITABLE);
  const auto frontend = self.shared();
  const Waiting waiting;
  const std::size_t rows = bytes.span().size() / frontend->layout().size;
  const o80::HistoryReader::Range range =
      frontend->link()->history.read_range(first, rows, static_cast<std::byte*>(bytes.view.buf));
  return {range.first, range.count};
}

}  // namespace

void bind_reading(nb::module_& m, nb::class_<Frontend>& frontend) {
  nb::class_<Stream> stream(m, "Stream", "Every observation, in order.");
  stream
      .def(
          "__iter__", [](nb::object self) { return self; }, nb::sig("def __iter__(self) -> Stream"))
      .def("__next__", [](Stream& self) {
        Iteration next = self.next;
        Observation observation = next_row(self.frontend, self.decoder, next, self.timeout);
        self.next = std::max(self.next, next);
        return observation;
      });
  refuse_to_pickle(stream, "a stream", "its frontend, and open a stream of that");

  frontend.def("latest", &latest, "The newest observation.")
      .def("wait_for", &wait_for, "iteration"_a.none(), "timeout"_a = nb::none(),
           nb::sig("def wait_for(self, iteration: int, timeout: float | None = None) "
                   "-> Observation"),
           R"(The observation of an iteration, as soon as it is there (a past one: at once).

Raises RowOverwritten if the history no longer holds it, TimeoutError after `timeout` [s],
BackendGone.)")
      .def("wait_for_next", &wait_for_next, "timeout"_a = nb::none(),
           R"(The observation after the one this call returned before; the first time, the next one.

If the reader fell behind, `missed` of the observation says how many were overwritten unread. The
position belongs to this frontend: threads that all need every row use a stream each.

Raises TimeoutError after `timeout` [s], BackendGone.)")
      .def("stream", &open_stream, "since"_a = nb::none(), "timeout"_a = nb::none(),
           nb::sig("def stream(self, since: int | None = None, timeout: float | None = None) "
                   "-> Stream"),
           R"(Iterates over every observation, in order, from `since` (None: the next one).

timeout: longest wait for one of them [s].)")
      .def("_read_rows", &read_rows, "first"_a, "array"_a)
      .def_prop_ro(
          "published", [](const Frontend& self) { return self.untyped().published(); },
          "The iteration of the newest observation.")
      .def_prop_ro(
          "oldest", [](const Frontend& self) { return self.untyped().oldest(); },
          "The iteration of the oldest observation still there.");
}
