#pragma once

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "o80/runtime/backend.hpp"
#include "o80/runtime/request_server.hpp"
#include "o80/runtime/robot_types.hpp"

namespace o80 {

/// A backend inside a C++ program. Call `publish` for row 0, then `step` and `publish` in turn.
///
/// R is any struct with a member type Actuators and, optionally, Extended and Requests.
///
/// Writer:   one thread.
/// Realtime: step and publish.
template <class R>
class Backend final : private RequestServer {
 public:
  using Actuators = ActuatorsOf<R>;
  using Extended = ExtendedOf<R>;
  using Describe = std::function<void(Schema&)>;

  /// Takes the segment's name; `describe` may set names, limits and when_idle.
  explicit Backend(const BackendOptions& options, const Describe& describe = {})
      : backend_(schema_of(options, describe), options, this) {}

  /// Sets the handler of a request, which `step` calls between two iterations.
  template <Shareable Request>
  void on(std::function<Served(const Request&)> serve) {
    servers_[index_of<Request>()] = [serve = std::move(serve)](const std::byte* payload) {
      return serve(unpack<Request>(payload));
    };
  }
  /// True if a request of this kind was answered `running` and neither `ended` nor a halt has ended
  /// it.
  template <Shareable Request>
  bool runs() const {
    return backend_.runs(index_of<Request>());
  }
  /// Sets the progress text that frontends read while the request runs.
  template <Shareable Request>
  void progress(std::string_view text) {
    backend_.show_progress(index_of<Request>(), text);
  }
  /// Ends the request with the next published row; `start_afresh` ends it in the next step. No
  /// effect if none of this kind runs.
  template <Shareable Request>
  void ended(const Served& how) {
    backend_.end_request(index_of<Request>(), how);
  }
  /// Sets the function that reads the robot for a fresh start.
  void on_fresh_start(std::function<void(Actuators&, Extended&)> read) { read_ = std::move(read); }

  /// Sets a function that is called when a halt begins: commands have ended, the desired states
  /// brake.
  void on_halt(std::function<void()> halt) { halt_ = std::move(halt); }
  /// Sets a function that is called before a halt is cleared; `Served::rejected` keeps the halt.
  void on_resume(std::function<Served()> resume) { resume_ = std::move(resume); }
  /// Halts on behalf of the program, like a driver in a reading.
  void halt(std::string_view why) noexcept { backend_.halt(HaltCause::driver, why); }

  /// Publishes the reading of the current iteration; the first call publishes row 0. Throws
  /// InvalidArgument for row 0 if a number is NaN, infinite or, in real time, too far outside its
  /// bounds, and for the next row if the robot cannot have moved there, see
  /// BackendOptions::accept_reading.
  void publish(const Actuators& observed, const Extended& extended = {}) {
    if constexpr (!std::is_same_v<Actuators, NoActuators>) pack(observed, backend_.observed());
    if constexpr (!std::is_same_v<Extended, NoExtended>) pack(extended, backend_.extended());
    if (!backend_.publish()) {
      throw InvalidArgument("'" + backend_.name() +
                            "' cannot begin: " + std::string(backend_.failure()));
    }
  }
  /// Begins an iteration and returns the desired states; nothing when the backend must end, after a
  /// stop or a failure: see `untyped().failure()`. Waits for a burst in bursting mode.
  std::optional<Actuators> step() noexcept {
    if (backend_.step() != Step::run) return std::nullopt;
    return unpack<Actuators>(backend_.desired());
  }
  UntypedBackend& untyped() { return backend_; }

 private:
  template <Shareable Request>
  static constexpr std::uint32_t index_of() {
    constexpr std::uint32_t kIndex = index_of_request<Request>(RequestsOf<R>{});
    static_assert(kIndex != kNoRequest, "this struct is not among the Requests of the robot");
    return kIndex;
  }
  static Schema schema_of(const BackendOptions& options, const Describe& describe) {
    Schema schema;
    schema.head.robot = NameText(options.segment);
    describe_types<R>(schema);
    if (describe) describe(schema);
    return schema;
  }
  Served serve(std::uint32_t request, std::span<const std::byte> payload) noexcept override {
    const auto server = servers_.find(request);
    if (server == servers_.end()) {
      return Served::rejected("this request has no handler: call on<Request>(...)");
    }
    return caught("request", [&] { return server->second(payload.data()); });
  }
  /// The answer of a handler; failed if it throws.
  template <class Handler>
  static Served caught(const char* of, Handler&& handler) noexcept {
    try {
      return handler();
    } catch (const std::exception& error) {
      return Served::failed(error.what());
    } catch (...) {
      return Served::failed("the handler of a " + std::string(of) +
                            " threw something that is not a std::exception");
    }
  }
  bool read_fresh(FreshReading& reading) noexcept override {
    if (!read_) return true;  // keeps the last reading
    try {
      Actuators observed = unpack<Actuators>(reading.observed);
      Extended extended = unpack<Extended>(reading.extended);
      read_(observed, extended);
      if constexpr (!std::is_same_v<Actuators, NoActuators>) pack(observed, reading.observed);
      if constexpr (!std::is_same_v<Extended, NoExtended>) pack(extended, reading.extended);
      return true;
    } catch (...) {
      return false;
    }
  }

  bool halt() noexcept override {
    try {
      if (halt_) halt_();
      return true;
    } catch (...) {
      return false;
    }
  }
  Served resume() noexcept override {
    return caught("resume", [&] { return resume_ ? resume_() : Served::done(); });
  }

  std::map<std::uint32_t, std::function<Served(const std::byte*)>> servers_;
  std::function<void(Actuators&, Extended&)> read_;
  std::function<void()> halt_;
  std::function<Served()> resume_;
  UntypedBackend backend_;
};

}  // namespace o80
