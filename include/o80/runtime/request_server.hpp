#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string_view>

#include "o80/base/time.hpp"

namespace o80 {

/// Result of a request.
struct Served {
  enum class Kind : std::uint8_t { done, rejected, start_afresh, failed, running };
  Kind kind = Kind::done;
  std::array<char, 248> text{};

  static Served done() { return {}; }
  /// Rejects the request; the sender reads `why`.
  static Served rejected(std::string_view why) { return with(Kind::rejected, why); }
  /// Makes a fresh start: drops all queues, reads the robot again, and publishes an extra row with
  /// desired = observed.
  static Served start_afresh() { return with(Kind::start_afresh, {}); }
  /// Ends the loop as failed.
  static Served failed(std::string_view why) { return with(Kind::failed, why); }

  /// The request runs and ends in a later iteration; the sender reads `progress` meanwhile. At most
  /// one request of a kind runs: another one is rejected without a call of the handler.
  static Served running(std::string_view progress = {}) { return with(Kind::running, progress); }

  static Served with(Kind kind, std::string_view why) {
    Served served;
    served.kind = kind;
    const std::size_t size = why.size() < served.text.size() ? why.size() : served.text.size() - 1;
    if (size > 0) std::memcpy(served.text.data(), why.data(), size);
    return served;
  }

  /// The reason of a rejection or failure, or the progress of a running request.
  std::string_view why() const { return {text.data(), strnlen(text.data(), text.size())}; }
};

/// A snapshot of a robot.
struct KeptState {
  std::uint32_t slot = 0;
  std::span<const std::byte> bytes{};
};

/// Memory for the reading of a fresh start, laid out as in the schema.
struct FreshReading {
  std::byte* observed;
  std::byte* extended;
  std::byte* desired;  // used if has_desired is set; otherwise desired = observed
  bool has_desired = false;
  bool follows = false;    // actuators without a command follow until the next fresh start
  bool may_fail = false;   // a robot that cannot be read now stays halted
  std::string_view why{};  // why it could not be read
};

/// Serves requests between two iterations: the driver, or the program with an embedded backend.
class RequestServer {
 public:
  virtual Served serve(std::uint32_t request, std::span<const std::byte> payload) noexcept = 0;
  /// Returns the state stored by this request, for the journal, so that a replay can begin with it;
  /// empty if the request stores none. Called after `serve` has answered `done`.
  virtual KeptState kept_state(std::uint32_t /*request*/,
                               std::span<const std::byte> /*payload*/) noexcept {
    return {};
  }
  /// Reads the robot for a fresh start; false if that failed.
  virtual bool read_fresh(FreshReading& reading) noexcept = 0;
  /// Called at the begin of a halt: commands have ended, the actuators brake. False if the robot
  /// failed.
  virtual bool halt() noexcept { return true; }
  /// Called before a halt is cleared; `rejected` keeps the halt, and the sender reads the reason.
  virtual Served resume() noexcept { return Served::done(); }

 protected:
  ~RequestServer() = default;
};

}  // namespace o80
