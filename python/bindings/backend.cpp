#include "o80/runtime/backend.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstring>
#include <exception>
#include <memory>
#include <optional>
#include <span>
#include <thread>
#include <utility>

#include "arguments.hpp"
#include "bindings.hpp"
#include "loop_options.hpp"
#include "memory/os/fork.hpp"
#include "o80/runtime/observation.hpp"
#include "schema_builder.hpp"
#include "waiting.hpp"

using o80::InvalidArgument;

namespace {

constexpr std::int64_t kLook = 50'000'000;  // between checks of signals [ns]

/// The compiled half of o80.Backend.
///
/// Python fills the buffers `observed`, `extended` and `fresh_desired`; `publish` and a fresh start
/// copy them into the row. Members are guarded by the GIL.
class Backend final : public o80::RequestServer {
 public:
  Backend(const SchemaBuilder& builder, const o80::BackendOptions& options)
      : backend_(std::make_shared<o80::UntypedBackend>(builder.schema, options, this)),
        name_(options.segment),
        observed_(zeros(backend_->layout().block)),
        extended_(zeros(backend_->layout().extended_size)),
        fresh_desired_(zeros(backend_->layout().block)),
        watches_pace_(options.max_overruns > 0 && !options.bursting) {}

  const nb::bytearray& observed() const { return observed_; }
  const nb::bytearray& extended() const { return extended_; }
  const nb::bytearray& fresh_desired() const { return fresh_desired_; }
  /// Called with index and payload of a request; returns a number of o80::Served and a text. So do
  /// its methods `halt` and `resume`.
  nb::object serve_with = nb::none();

  /// Throws Closed or UsedAfterFork.
  o80::UntypedBackend& checked() const {
    guard_.check("the backend of segment '" + name_ + "'");
    if (!backend_) {
      throw o80::Closed("the backend of segment '" + name_ + "' was closed: make a new one");
    }
    return *backend_;
  }

  /// The backend for functions that must not be called during `step`. Throws Error then.
  o80::UntypedBackend& between_steps() const {
    o80::UntypedBackend& backend = checked();
    if (!stepping_) return backend;
    throw o80::Error("the backend of segment '" + name_ +
                     "' is inside step: use it in one thread, and not from the handler of a "
                     "request (stop and close may be called from anywhere)");
  }

  /// The backend for functions that a handler of a request may call too. Throws Error during a
  /// `step` of another thread.
  o80::UntypedBackend& in_its_thread() const {
    const bool is_handler = stepping_ && stepping_thread_ == std::this_thread::get_id();
    return is_handler ? checked() : between_steps();
  }

  void publish() {
    o80::UntypedBackend& backend = between_steps();
    if (watches_pace_) watch_pace(backend);
    copy(observed_, backend.observed());
    copy(extended_, backend.extended());
    if (!backend.publish()) {
      throw InvalidArgument("'" + name_ + "' cannot begin: " + std::string(backend.failure()));
    }
    begun_ = true;
  }

  /// True if an iteration has begun, false if the backend must end.
  bool step(Patience timeout) {
    between_steps();
    if (!begun_) throw InvalidArgument("publish row 0 before the first step");
    const Stepping stepping(*this);
    o80::Step step = stepping.backend->try_step();
    if (step == o80::Step::standing) step = wait(*stepping.backend, timeout);
    if (raised_) std::rethrow_exception(std::exchange(raised_, nullptr));
    if (guard_.forked()) checked();  // a signal handler may have forked: raises in the child
    if (!backend_) {
      throw o80::Closed("the backend of segment '" + name_ + "' was closed while it was in step");
    }
    if (step == o80::Step::ended && backend_->phase() == o80::Phase::unreadable) {
      throw InvalidArgument("'" + name_ + "' cannot continue: " + std::string(backend_->failure()));
    }
    return step == o80::Step::run;
  }

  void interrupt(std::uint32_t actuator) const { between_steps().interrupt(actuator); }
  bool runs(std::uint32_t request) const { return checked().runs(request); }
  void show_progress(std::uint32_t request, nb::handle text) const {
    in_its_thread().show_progress(request, shown_text(text));
  }
  void end_request(std::uint32_t request, bool afresh, nb::handle rejected) const {
    const o80::Served done = afresh ? o80::Served::start_afresh() : o80::Served::done();
    in_its_thread().end_request(
        request, rejected.is_none() ? done : o80::Served::rejected(shown_text(rejected)));
  }
  void halt_by_driver(nb::handle text) const {
    checked().halt(o80::HaltCause::driver, shown_text(text, ""));
  }

  bool closed() const { return !backend_; }
  /// The reason why `step` returned false without a stop; empty if there is none.
  std::string failure() const {
    return backend_ && !guard_.forked() ? std::string(backend_->failure()) : "";
  }

  /// Ends the backend. A `step` in another thread raises Closed, and the backend ends when that
  /// `step` returns.
  void end(bool failed, nb::handle text) {
    if (!backend_ || guard_.forked()) return;
    last_words_ = {failed ? o80::BackendState::failed : o80::BackendState::stopped,
                   shown_text(text)};
    const std::shared_ptr<o80::UntypedBackend> ended = std::move(backend_);
    if (!stepping_) return finish(*ended);
    ended->ask_to_stop();
    if (stepping_thread_ == std::this_thread::get_id()) return;  // called from a handler
    const o80::Deadline deadline(kPatience);
    const Waiting waiting;
    while (stepping_) {
      if (deadline.over()) {
        throw o80::TimeoutError("the backend of segment '" + name_ +
                                "' has not ended: the handler of a request has not returned");
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
      Waiting::keep_waiting();
    }
  }

  static int traverse(PyObject* self, visitproc visit, void* arg) {
    Py_VISIT(Py_TYPE(self));
    if (nb::inst_ready(self)) Py_VISIT(nb::inst_ptr<Backend>(self)->serve_with.ptr());
    return 0;
  }
  static int clear(PyObject* self) {
    if (nb::inst_ready(self)) nb::inst_ptr<Backend>(self)->serve_with.reset();
    return 0;
  }

 private:
  static constexpr std::chrono::seconds kPatience{5};

  /// Marks a step; keeps the backend alive until the step ends.
  struct Stepping {
    explicit Stepping(Backend& whose) : owner(whose), backend(whose.backend_) {
      owner.stepping_thread_ = std::this_thread::get_id();
      owner.stepping_ = true;
    }
    Stepping(const Stepping&) = delete;
    Stepping& operator=(const Stepping&) = delete;
    ~Stepping() {
      if (!owner.backend_) owner.finish(*backend);
      owner.stepping_ = false;
    }
    Backend& owner;
    std::shared_ptr<o80::UntypedBackend> backend;
  };

  void finish(o80::UntypedBackend& backend) {
    backend.end(last_words_.first, last_words_.second);
    serve_with = nb::none();
  }

  static nb::bytearray zeros(std::size_t size) {
    const std::vector<std::byte> bytes(size);
    return nb::bytearray(bytes.data(), size);
  }

  static void copy(const nb::bytearray& from, std::byte* to) {
    if (from.size() > 0) std::memcpy(to, from.c_str(), from.size());
  }

  o80::Step wait(o80::UntypedBackend& backend, o80::Timeout timeout) {
    const o80::Deadline deadline(timeout);
    const Waiting waiting;
    while (true) {
      const o80::Step step = backend.step_within(deadline.left(kLook));
      if (step != o80::Step::standing) return step;
      if (deadline.over()) {
        throw o80::TimeoutError("no frontend requested an iteration of '" + name_ +
                                "' in time: it is bursting, call burst() in a frontend");
      }
      Waiting::keep_waiting();
    }
  }

  o80::Served serve(std::uint32_t request, std::span<const std::byte> payload) noexcept override {
    return answered([&] { return serve_with(request, nb::bytes(payload.data(), payload.size())); });
  }

  bool halt() noexcept override {
    const o80::Served how = answered([&] { return serve_with.attr("halt")(); });
    return how.kind == o80::Served::Kind::done;
  }

  o80::Served resume() noexcept override {
    return answered([&] { return serve_with.attr("resume")(); });
  }

  /// What a function of Python answers, as `serve_with`; its exception is raised by `step`.
  template <class Call>
  o80::Served answered(Call&& call) noexcept {
    const WithGil locked;
    try {
      const auto [kind, text] = nb::cast<std::pair<std::uint8_t, nb::object>>(call_python(call));
      o80::Served answer = o80::Served::running(shown_text(text));
      answer.kind = static_cast<o80::Served::Kind>(kind);
      return answer;
    } catch (nb::python_error& error) {
      raised_ = std::current_exception();
      const std::string type = shown_text(error.type().attr("__name__"));
      return o80::Served::failed(type + ": " + shown_text(error.value()));
    } catch (std::exception& error) {
      raised_ = std::current_exception();
      return o80::Served::failed(error.what());
    }
  }

  /// Copies the reading that the handler of a request has put into the buffers.
  bool read_fresh(o80::FreshReading& reading) noexcept override {
    const WithGil locked;
    copy(observed_, reading.observed);
    copy(extended_, reading.extended);
    copy(fresh_desired_, reading.desired);
    reading.has_desired = true;
    return true;
  }

  /// The program keeps the pace: a row that comes half a period late, or later, is an overrun.
  void watch_pace(o80::UntypedBackend& backend) {
    const std::int64_t now = o80::monotonic_now();
    const std::int64_t period = backend.schema().head.period;
    const std::int64_t late = now - due_;
    due_ = now + period;
    if (!begun_) return;
    timing_.lateness = late;
    const std::int64_t missed = std::max<std::int64_t>(0, (late + period / 2) / period);
    timing_.skipped += static_cast<std::uint32_t>(missed);
    if (missed > 0) ++timing_.overruns;
    backend.set_timing(timing_);
  }

  std::shared_ptr<o80::UntypedBackend> backend_;
  std::string name_;
  nb::bytearray observed_, extended_, fresh_desired_;
  bool watches_pace_;
  std::int64_t due_ = 0;  // of the next row [ns]
  o80::Timing timing_;
  o80::ForkGuard guard_;
  std::exception_ptr raised_;
  bool begun_ = false;
  std::atomic<bool> stepping_{false};
  std::thread::id stepping_thread_;
  std::pair<o80::BackendState, std::string> last_words_;
};

PyType_Slot backend_slots[] = {{Py_tp_traverse, reinterpret_cast<void*>(&Backend::traverse)},
                               {Py_tp_clear, reinterpret_cast<void*>(&Backend::clear)},
                               {0, nullptr}};

Backend* make(const SchemaBuilder& builder, const std::string& segment,
              const o80::OptionValues& loop) {
  o80::BackendOptions options = loop_options_of(loop).backend;
  options.segment = segment;
  return new Backend(builder, options);
}

}  // namespace

void bind_backend(nb::module_& m) {
  bind_schema_builder(m);

  nb::class_<Backend> bound(m, "Backend", nb::type_slots(backend_slots),
                            "The compiled half of o80.Backend.");
  bound.def(nb::new_(&make), "builder"_a, "segment"_a, "loop"_a)
      .def_rw("serve_with", &Backend::serve_with, nb::arg().none())
      .def_prop_ro("description",
                   [](const Backend& self) {
                     const o80::UntypedBackend& backend = self.checked();
                     return std::make_shared<o80::Description>(
                         o80::Description{backend.schema(), backend.layout()});
                   })
      .def_prop_ro("observed", &Backend::observed)
      .def_prop_ro("extended", &Backend::extended)
      .def_prop_ro("fresh_desired", &Backend::fresh_desired)
      .def("desired",
           [](const Backend& self) {
             const o80::UntypedBackend& backend = self.checked();
             return nb::bytearray(backend.desired(), backend.layout().block);
           })
      .def("active",
           [](const Backend& self) {
             const o80::UntypedBackend& backend = self.checked();
             return nb::bytes(backend.active(), backend.layout().mask_words * 8);
           })
      .def("check", [](const Backend& self) { self.checked(); })
      .def("publish", &Backend::publish)
      .def("step", &Backend::step, "timeout"_a.none())
      .def("interrupt", &Backend::interrupt, "actuator"_a)
      .def("runs", &Backend::runs, "request"_a)
      .def("show_progress", &Backend::show_progress, "request"_a, "text"_a)
      .def("end_request", &Backend::end_request, "request"_a, "afresh"_a, "rejected"_a.none())
      .def("halt", &Backend::halt_by_driver, "text"_a)
      .def("ask_to_stop", [](const Backend& self) { self.checked().ask_to_stop(); })
      .def("end", &Backend::end, "failed"_a, "text"_a)
      .def_prop_ro("failure", &Backend::failure)
      .def_prop_ro("closed", &Backend::closed)
      .def_prop_ro("iteration", [](const Backend& self) { return self.checked().iteration(); })
      .def_prop_ro("time", [](const Backend& self) { return self.checked().time(); });
}
