#include "batch.hpp"

#include <optional>

#include "arguments.hpp"
#include "bindings.hpp"
#include "enums.hpp"
#include "o80/base/error.hpp"
#include "pickling.hpp"
#include "waiting.hpp"

using o80::Batch;
using o80::Handle;

namespace {

/// The iterator of a coroutine of o80.base.awaiting, for `__await__`.
nb::object awaited(nb::handle self) {
  return nb::module_::import_("o80.base.awaiting").attr("end_of")(self).attr("__await__")();
}

/// The iteration; nothing (None) if there is none yet.
std::optional<o80::Iteration> known(o80::Iteration iteration) {
  if (iteration < 0) return {};
  return iteration;
}

o80::Iteration reached(o80::Iteration iteration, const char* not_yet) {
  if (iteration >= 0) return iteration;
  throw o80::Error(std::string("the batch ") + not_yet + ", or was empty: wait for it first");
}

/// Makes a handle from its pickled values.
Handle* handle_of(o80::CommandId id, int status, int reason, o80::Iteration iteration,
                  std::int64_t late, std::string text, std::string progress) {
  return new Handle{id,
                    static_cast<o80::Status>(status),
                    static_cast<o80::Reason>(reason),
                    iteration,
                    late,
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

/// As in a list: negative places count from the end.
Handle handle_at(const Batch& batch, std::int64_t place) {
  const auto size = static_cast<std::int64_t>(batch.size());
  if (place < -size || place >= size) {
    throw nb::index_error(
        ("the batch has " + std::to_string(size) + " records, there is no " + std::to_string(place))
            .c_str());
  }
  return batch.handle(static_cast<std::size_t>(place < 0 ? place + size : place));
}

nb::list statuses_of(const Batch& batch) {
  nb::list statuses;
  for (std::size_t i = 0; i < batch.size(); ++i) {
    statuses.append(python_word(batch.handle(i).status));
  }
  return statuses;
}

std::string text_of_seen(const o80::Seen& seen) {
  return "<o80.Seen row " + std::to_string(seen.iteration) + " of run " +
         std::to_string(seen.epoch) + ">";
}

constexpr std::string_view kClocks[] = {"monotonic", "simulated"};  // in their order

o80::Seen seen_from(std::uint64_t epoch, o80::Iteration iteration, std::int64_t time,
                    nb::handle clock, o80::Iteration since) {
  const auto known = static_cast<o80::Clock>(place_of(clock, kClocks, "clock"));
  return {epoch, iteration, time, known, since};
}

void bind_seen(nb::module_& m) {
  using o80::DecisionLatency;
  using o80::Seen;
  const auto clock_of = [](const Seen& self) {
    return kClocks[static_cast<std::size_t>(self.clock)];
  };
  nb::class_<Seen>(m, "Seen", "The row by which a batch was decided, of any segment.")
      .def(nb::new_(&seen_from), "epoch"_a, "iteration"_a, "time"_a, "clock"_a, "since"_a = -1)
      .def(
          "__reduce__",
          [clock_of](nb::handle self) {
            const auto& seen = *nb::inst_ptr<Seen>(self);
            return nb::make_tuple(self.type(), nb::make_tuple(seen.epoch, seen.iteration, seen.time,
                                                              clock_of(seen), seen.since));
          },
          nb::sig("def __reduce__(self) -> tuple[typing.Any, ...]"))
      .def_ro("epoch", &Seen::epoch, "The number of the run that published it.")
      .def_ro("iteration", &Seen::iteration, "Its iteration.")
      .def_ro("time", &Seen::time,
              "When it was captured [ns]; for devices their `capture_time`. -1: not known.")
      .def_prop_ro("clock", clock_of, "The clock of that time: monotonic or simulated.")
      .def_prop_ro(
          "since", [](const Seen& self) { return known(self.since); },
          "The newest iteration of the commanded robot at or before that capture, from which the "
          "latency of the decision counts. None: not known.")
      .def("__repr__", &text_of_seen);
  nb::class_<DecisionLatency>(
      m, "DecisionLatency",
      "Delay from the capture of a row to the first iteration of the batch that it decided.")
      .def_prop_ro(
          "iterations", [](const DecisionLatency& self) { return known(self.iterations); },
          "Iterations of the robot that took the batch; None: not known.")
      .def_prop_ro(
          "seconds",
          [](const DecisionLatency& self) -> std::optional<double> {
            if (self.time < 0) return {};
            return static_cast<double>(self.time) / 1e9;
          },
          "Time between the rows [s]; None: not known, as if their clocks differ.");
}

}  // namespace

void bind_batch(nb::module_& m) {
  bind_seen(m);
  nb::class_<Handle>(m, "Handle", "Status of one command or request, when it was read.")
      .def(nb::new_(&handle_of), "id"_a, "status"_a, "reason"_a, "iteration"_a, "late"_a, "text"_a,
           "progress"_a)
      .def(
          "__reduce__",
          [](nb::handle self) {
            const auto* handle = nb::inst_ptr<Handle>(self);
            return nb::make_tuple(
                self.type(), nb::make_tuple(handle->id, static_cast<int>(handle->status),
                                            static_cast<int>(handle->reason), handle->iteration,
                                            handle->late, handle->text, handle->progress));
          },
          nb::sig("def __reduce__(self) -> tuple[typing.Any, ...]"))
      .def_ro("id", &Handle::id, "Its id, unique within its frontend.")
      .def_prop_ro(
          "status", [](const Handle& self) { return python_word(self.status); },
          nb::sig("def status(self) -> Status"), "Its status.")
      .def_prop_ro(
          "reason", [](const Handle& self) { return python_word(self.reason); },
          nb::sig("def reason(self) -> Reason"), "The reason of its status.")
      .def_prop_ro(
          "iteration", [](const Handle& self) { return known(self.iteration); },
          "The iteration in which the status changed; None while it is queued.")
      .def_ro("late", &Handle::late,
              "With the reason limits: by how many iterations it takes longer than requested.")
      .def_ro("text", &Handle::text, "The reason in words.")
      .def_ro("progress", &Handle::progress, "The driver's text about a running request.")
      .def_prop_ro(
          "ended", [](const Handle& self) { return o80::is_end(self.status); },
          "True if the status is final.")
      .def("__repr__", &text_of);

  nb::class_<Batch> batch(
      m, "Batch",
      "The commands, requests and purges that one pulse sent; its length is their number.");
  refuse_to_pickle(batch, "a batch", "its handles, its first_iteration or its last_iteration");
  batch.def("__len__", &Batch::size)
      .def("__bool__", [](const Batch&) { return true; })
      .def(
          "__iter__", [](const Batch& self) { return nb::iter(nb::cast(self.handles())); },
          nb::sig("def __iter__(self) -> collections.abc.Iterator[Handle]"),
          "A handle for each, in the order they were added.")
      .def("__getitem__", &handle_at, "place"_a,
           "The handle of one: `batch[arm.add_command(...)]`; -1 is the last.")
      .def_prop_ro("handles", &Batch::handles,
                   "A handle for each command, request and purge, in the order they were added.")
      .def_prop_ro("statuses", &statuses_of, nb::sig("def statuses(self) -> list[Status]"),
                   "The status of each, in the order they were added.")
      .def_prop_ro("_shift",
                   [](const Batch& self) {
                     const auto shift = self.shift();
                     return shift ? std::optional(std::pair(shift->iterations, shift->stood))
                                  : std::nullopt;
                   })
      .def_prop_ro("_take_over",
                   [](const Batch& self) {
                     const auto begun = self.take_over();
                     return begun ? std::optional(std::pair(begun->row, begun->needed))
                                  : std::nullopt;
                   })
      .def_prop_ro("clipped", &Batch::clipped,
                   "Numbers of its targets that `clip` has put inside their bounds.")
      .def_prop_ro("ended", &Batch::ended, "True if all of them have ended.")
      .def_prop_ro(
          "taken", [](const Batch& self) { return self.first_iteration() >= 0; },
          "True if the backend has taken or rejected it.")
      .def_prop_ro(
          "first_iteration",
          [](const Batch& self) { return reached(self.first_iteration(), "was not taken yet"); },
          "The iteration in which it was taken. Raises Error if it was not taken yet; see `taken`.")
      .def_prop_ro(
          "last_iteration",
          [](const Batch& self) { return reached(self.last_iteration(), "has not ended yet"); },
          "The iteration in which the last of its commands ended. Raises Error if some have not "
          "ended; see `ended` and `wait`.")
      .def_prop_ro(
          "seen", [](const Batch& self) { return self.seen(); },
          nb::sig("def seen(self) -> Seen | None"),
          "The row by which it was decided: `seen` of its pulse, or None.")
      .def_prop_ro("decision_latency", &Batch::decision_latency,
                   nb::sig("def decision_latency(self) -> DecisionLatency | None"),
                   R"(The delay from the capture of `seen` to the first row in which the batch acts.

None if it was pulsed without `seen`, was rejected, or if that row is not published yet. It is read
from the history, so ask while that holds the row.)")
      .def(
          "wait",
          [](const Batch& self, Patience timeout, nb::handle check) {
            const o80::WaitOptions options{.check = truth_of(check, "check")};
            carrying(self, [&] { self.wait(timeout, Waiting::keep_waiting, options); });
          },
          "timeout"_a = nb::none(), nb::kw_only(), "check"_a.none() = true,
          nb::sig("def wait(self, timeout: float | None = None, *, check: bool = True) -> None"),
          R"(Waits until every command, request and purge of it has ended.

In bursting mode a frontend must request the iterations for that. Raises NotCompleted if one of them
ended otherwise than completed (overwritten by a later command of the same frontend is no error),
BackendHalted if a halt ended one, TimeoutError after `timeout` [s], with this batch as its member,
and BackendGone. With `check=False` their ends raise nothing.)")
      .def("__await__", &awaited,
           nb::sig("def __await__(self) -> collections.abc.Generator[typing.Any, None, Batch]"),
           "Waits in asyncio: `await arm.pulse()` returns the batch when it has ended. Raises as "
           "`wait`.")
      .def("__repr__", [](const Batch& self) {
        const std::string what = "<o80.Batch of " + std::to_string(self.size());
        try {
          return what + (self.ended() ? ", ended>" : ", not ended>");
        } catch (const o80::UsedAfterFork&) {
          return what + ", of the parent process>";
        }
      });

  nb::class_<PendingBurst> burst(m, "Burst", "A burst that was requested.");
  refuse_to_pickle(burst, "a burst", "the observation that its wait returns");
  burst
      .def_prop_ro(
          "batch", [](const PendingBurst& self) { return self.burst.batch(); },
          "The batch that was sent with it.")
      .def_prop_ro(
          "done", [](const PendingBurst& self) { return self.burst.done(); },
          "True if its last iteration is done.")
      .def(
          "cancel", [](const PendingBurst& self) { self.burst.cancel(); },
          R"(Ends the burst after the current iteration.

A burst that has not begun runs no iteration. Commands sent with it stay queued. `wait` then returns
the last row that it published.)")
      .def(
          "wait",
          [](const PendingBurst& self, Patience timeout) {
            return Observation(self.decoder, carrying(self.burst.batch(), [&] {
                                 return self.burst.wait(timeout, Waiting::keep_waiting);
                               }));
          },
          "timeout"_a = nb::none(),
          R"(Waits for its last iteration and returns that observation.

Raises TimeoutError after `timeout` [s], and BackendGone. After a timeout the burst continues: wait
for it again, or cancel it.)")
      .def("__await__", &awaited,
           nb::sig("def __await__(self) "
                   "-> collections.abc.Generator[typing.Any, None, Observation]"),
           "Waits in asyncio for the observation of its last iteration. If the task is cancelled, "
           "the burst continues.");
}
