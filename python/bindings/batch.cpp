#include "batch.hpp"

#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <optional>

#include "bindings.hpp"
#include "enums.hpp"
#include "o80/base/error.hpp"
#include "pickling.hpp"
#include "waiting.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using o80::Batch;
using o80::Handle;

namespace {

/// What `await` asks of an object: the iterator of a coroutine of o80.awaiting.
nb::object awaited(nb::handle self) {
  return nb::module_::import_("o80.awaiting").attr("end_of")(self).attr("__await__")();
}

/// None stands for "not yet".
std::optional<o80::Iteration> known(o80::Iteration iteration) {
  if (iteration < 0) return {};
  return iteration;
}

o80::Iteration reached(o80::Iteration iteration, const char* not_yet) {
  if (iteration >= 0) return iteration;
  throw o80::Error(std::string("the batch ") + not_yet + ", or was empty: wait for it first");
}

/// A handle that was pickled.
Handle* handle_of(o80::CommandId id, int status, int reason, o80::Iteration iteration,
                  std::string text, std::string progress) {
  return new Handle{id,
                    static_cast<o80::Status>(status),
                    static_cast<o80::Reason>(reason),
                    iteration,
                    std::move(text),
                    std::move(progress)};
}

std::string text_of(const Handle& handle) {
  std::string text =
      "<o80.Handle " + std::to_string(handle.id) + ": " + std::string(o80::to_text(handle.status));
  if (handle.iteration >= 0) text += " at iteration " + std::to_string(handle.iteration);
  if (!handle.text.empty()) text += ", " + handle.text;
  if (!handle.progress.empty()) text += ", " + handle.progress;
  return text + ">";
}

nb::list statuses_of(const Batch& batch) {
  nb::list statuses;
  for (std::size_t i = 0; i < batch.size(); ++i) {
    statuses.append(python_word(batch.handle(i).status));
  }
  return statuses;
}

}  // namespace

void bind_batch(nb::module_& m) {
  nb::class_<Handle>(m, "Handle", "What became of one command or request, when it was asked.")
      .def(nb::new_(&handle_of), "id"_a, "status"_a, "reason"_a, "iteration"_a, "text"_a,
           "progress"_a)
      .def(
          "__reduce__",
          [](nb::handle self) {
            const auto* handle = nb::inst_ptr<Handle>(self);
            return nb::make_tuple(
                self.type(), nb::make_tuple(handle->id, static_cast<int>(handle->status),
                                            static_cast<int>(handle->reason), handle->iteration,
                                            handle->text, handle->progress));
          },
          nb::sig("def __reduce__(self) -> tuple[typing.Any, ...]"))
      .def_ro("id", &Handle::id, "Names it within its frontend.")
      .def_prop_ro(
          "status", [](const Handle& self) { return python_word(self.status); },
          nb::sig("def status(self) -> Status"), "What became of it.")
      .def_prop_ro(
          "reason", [](const Handle& self) { return python_word(self.reason); },
          nb::sig("def reason(self) -> Reason"), "Why.")
      .def_prop_ro(
          "iteration", [](const Handle& self) { return known(self.iteration); },
          "The iteration at which the status changed; None while it is queued.")
      .def_ro("text", &Handle::text, "Why it was rejected or dropped, in words.")
      .def_ro("progress", &Handle::progress, "What the driver says of a request that runs.")
      .def_prop_ro(
          "ended", [](const Handle& self) { return o80::is_end(self.status); },
          "Whether the status changes no more.")
      .def("__repr__", &text_of);

  nb::class_<Batch> batch(m, "Batch", "What one pulse sent. Its length is that of its records.");
  refuse_to_pickle(batch, "a batch", "its handles, its first_iteration or its last_iteration");
  batch.def("__len__", &Batch::size)
      .def("__bool__", [](const Batch&) { return true; })
      .def_prop_ro("handles", &Batch::handles,
                   "A handle for each command, request and purge, in the order they were added.")
      .def_prop_ro("statuses", &statuses_of, nb::sig("def statuses(self) -> list[Status]"),
                   "The status of each, in the order they were added.")
      .def_prop_ro("ended", &Batch::ended, "Whether every record has an end status.")
      .def_prop_ro(
          "taken", [](const Batch& self) { return self.first_iteration() >= 0; },
          "Whether the backend has taken (or rejected) it.")
      .def_prop_ro(
          "first_iteration",
          [](const Batch& self) { return reached(self.first_iteration(), "was not taken yet"); },
          "The iteration at which it was taken. Raises Error if it was not yet; see `taken`.")
      .def_prop_ro(
          "last_iteration",
          [](const Batch& self) { return reached(self.last_iteration(), "has not ended yet"); },
          "The iteration at which the last of its commands ended. Raises Error if they have not "
          "all; see `ended` and `wait`.")
      .def(
          "wait",
          [](const Batch& self, nb::handle timeout) {
            const o80::Timeout patience = timeout_of(timeout);
            carrying(self, [&] {
              const Waiting waiting;
              self.wait(patience, Waiting::keep_waiting);
            });
          },
          "timeout"_a = nb::none(),
          R"(Waits until every record has an end status.

A bursting backend must be burst for that. Raises TimeoutError after `timeout` [s], which carries
this batch, and BackendGone.)")
      .def("__await__", &awaited,
           nb::sig("def __await__(self) -> collections.abc.Generator[typing.Any, None, Batch]"),
           "Waits as a task of asyncio: `await arm.pulse()` gives the batch when it has ended.")
      .def("__repr__", [](const Batch& self) {
        const std::string what = "<o80.Batch of " + std::to_string(self.size());
        try {
          return what + (self.ended() ? ", ended>" : ", under way>");
        } catch (const o80::UsedAfterFork&) {
          return what + ", of the parent process>";
        }
      });

  nb::class_<PendingBurst> burst(m, "Burst", "A burst under way.");
  refuse_to_pickle(burst, "a burst", "the observation that its wait returns");
  burst
      .def_prop_ro(
          "batch", [](const PendingBurst& self) { return self.burst.batch(); },
          "What was sent with it.")
      .def_prop_ro(
          "done", [](const PendingBurst& self) { return self.burst.done(); },
          "Whether its last iteration is done.")
      .def(
          "cancel", [](const PendingBurst& self) { self.burst.cancel(); },
          R"(Ends it: the backend stands still after the iteration under way.

A burst that has not begun runs no iteration. What was sent with it stays queued. Its wait then
returns the last row there was.)")
      .def(
          "wait",
          [](const PendingBurst& self, nb::handle timeout) {
            const o80::Timeout patience = timeout_of(timeout);
            return carrying(self.burst.batch(), [&] {
              o80::UntypedObservation row = [&] {
                const Waiting waiting;
                return self.burst.wait(patience, Waiting::keep_waiting);
              }();
              return Observation(self.decoder, std::move(row));
            });
          },
          "timeout"_a = nb::none(),
          R"(Waits for its last iteration and returns the observation of it.

Raises TimeoutError after `timeout` [s], and BackendGone. After a timeout it goes on, and can be
waited for again, or cancelled.)")
      .def("__await__", &awaited,
           nb::sig("def __await__(self) "
                   "-> collections.abc.Generator[typing.Any, None, Observation]"),
           "Waits as a task of asyncio for the observation of its last iteration. A task that is "
           "cancelled leaves it under way.");
}
