// A burst that is repeated: its options are checked and its buffers looked up once.

#include <nanobind/stl/optional.h>
#include <nanobind/stl/vector.h>

#include <utility>

#include "arguments.hpp"
#include "bindings.hpp"
#include "buffer.hpp"
#include "enums.hpp"
#include "frontend.hpp"
#include "pickling.hpp"
#include "waiting.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace {

/// The options of the burst, and the caller's memory for its targets and rows.
class PreparedBurst {
 public:
  PreparedBurst(std::vector<std::uint32_t> actuators, std::uint32_t steps, nb::handle each,
                nb::handle mode, nb::handle profile, nb::handle start, nb::handle targets,
                nb::handle rows)
      : actuators_(std::move(actuators)),
        steps_(steps),
        options_{.pace = pace_of(nb::none(), nb::none(), nb::none(), each),
                 .mode = mode_of(mode),
                 .profile = profile_of(profile),
                 .start = start_of(start)},
        targets_(targets),
        rows_(rows, PyBUF_WRITABLE) {}

  o80::Iteration run(const Frontend& self, nb::handle timeout, nb::handle at,
                     nb::handle late) const {
    const o80::PulseOptions options = pulse_options(at, late);
    const o80::Timeout patience = timeout_of(timeout);
    const auto frontend = self.shared();
    if (is_each_iteration(options_.pace)) {
      frontend->add_set_points(actuators_, steps_, targets_.span(), options_.mode);
    } else {
      frontend->add_trajectories(actuators_, steps_, targets_.span(), options_);
    }
    const Waiting waiting;
    return frontend->burst_rows(rows_.writable(), patience, Waiting::keep_waiting, options);
  }

 private:
  std::vector<std::uint32_t> actuators_;
  std::uint32_t steps_;
  o80::CommandOptions options_;
  Bytes targets_;
  Bytes rows_;
};

}  // namespace

void bind_prepared_burst(nb::module_& m) {
  nb::class_<PreparedBurst> burst(m, "PreparedBurst", "The compiled half of o80.PreparedBurst.");
  refuse_to_pickle(burst, "a prepared burst", "its targets and its rows");
  burst
      .def(nb::init<std::vector<std::uint32_t>, std::uint32_t, nb::handle, nb::handle, nb::handle,
                    nb::handle, nb::handle, nb::handle>(),
           "actuators"_a, "steps"_a, "each"_a, "mode"_a, "profile"_a, "start"_a, "targets"_a,
           "rows"_a)
      .def("run", &PreparedBurst::run, "frontend"_a, "timeout"_a.none(), "at"_a.none(), "late"_a,
           nb::sig("def run(self, frontend: Frontend, timeout: float | None, at: int | None, "
                   "late: str) -> int"));
}
