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

/// A backend inside one's own program: `publish` row 0, then `step` and `publish` for ever.
///
/// R is any struct that names Actuators and, if there are, Extended and Requests.
///
/// Writer:   one thread.
/// Realtime: step and publish.
template <class R>
class Backend final : private RequestServer {
 public:
  using Actuators = ActuatorsOf<R>;
  using Extended = ExtendedOf<R>;
  using Describe = std::function<void(Schema&)>;

  /// Takes the name; `describe` may give names, limits and when_idle.
  explicit Backend(const BackendOptions& options, const Describe& describe = {})
      : backend_(schema_of(options, describe), options, this) {}

  /// Serves a request between two iterations.
  template <Shareable Request>
  void on(std::function<Served(const Request&)> serve) {
    servers_[index_of<Request>()] = [serve = std::move(serve)](const std::byte* payload) {
      return serve(unpack<Request>(payload));
    };
  }
  /// A request of this kind was answered `running` and has not ended; a halt may have ended it.
  template <Shareable Request>
  bool runs() const {
    return backend_.runs(index_of<Request>());
  }
  /// What frontends see of it while it runs.
  template <Shareable Request>
  void progress(std::string_view text) {
    backend_.show_progress(index_of<Request>(), text);
  }
  /// It ends with the row that is published next, or, if it starts afresh, in the next step. If
  /// none of this kind runs, nothing happens.
  template <Shareable Request>
  void ended(const Served& how) {
    backend_.end_request(index_of<Request>(), how);
  }
  /// Reads the robot anew after a request answered `start_afresh`.
  void on_fresh_start(std::function<void(Actuators&, Extended&)> read) { read_ = std::move(read); }

  /// Told when a halt begins: commands have ended, the desired states brake.
  void on_halt(std::function<void()> halt) { halt_ = std::move(halt); }
  /// Asked before a halt is cleared; `Served::rejected` keeps it.
  void on_resume(std::function<Served()> resume) { resume_ = std::move(resume); }
  /// Halts in the program's own name, as a driver's reading may.
  void halt(std::string_view why) noexcept { backend_.halt(HaltCause::driver, why); }

  /// Publishes what was observed in the iteration under way; the first call makes row 0. That one
  /// throws InvalidArgument if a number of it is NaN or infinite; none after it throws.
  void publish(const Actuators& observed, const Extended& extended = {}) {
    if constexpr (!std::is_same_v<Actuators, NoActuators>) pack(observed, backend_.observed());
    if constexpr (!std::is_same_v<Extended, NoExtended>) pack(extended, backend_.extended());
    if (!backend_.publish()) {
      throw InvalidArgument("'" + backend_.name() +
                            "' cannot begin: " + std::string(backend_.failure()));
    }
  }
  /// The desired states of the next iteration; empty when a stop was asked for, or when it failed:
  /// `untyped().failure()` says why. Bursting, waits for a grant.
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
    if (server == servers_.end()) return Served::rejected("nobody serves this request");
    try {
      return server->second(payload.data());
    } catch (const std::exception& error) {
      return Served::failed(error.what());
    } catch (...) {
      return Served::failed("a request's server threw");
    }
  }
  bool read_fresh(FreshReading& reading) noexcept override {
    if (!read_) return true;  // what was observed last holds
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
    try {
      return resume_ ? resume_() : Served::done();
    } catch (const std::exception& error) {
      return Served::failed(error.what());
    } catch (...) {
      return Served::failed("the handler of a resume threw");
    }
  }

  std::map<std::uint32_t, std::function<Served(const std::byte*)>> servers_;
  std::function<void(Actuators&, Extended&)> read_;
  std::function<void()> halt_;
  std::function<Served()> resume_;
  UntypedBackend backend_;
};

}  // namespace o80
