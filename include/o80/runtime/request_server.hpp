#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string_view>

#include "o80/base/time.hpp"

namespace o80 {

/// How a request was served, or has ended.
struct Served {
  enum class Kind : std::uint8_t { done, rejected, start_afresh, failed, running };
  Kind kind = Kind::done;
  std::array<char, 248> text{};

  static Served done() { return {}; }
  /// The sender reads `why`.
  static Served rejected(std::string_view why) { return with(Kind::rejected, why); }
  /// Queues are purged, the robot is read anew, desired = observed, in a row of its own.
  static Served start_afresh() { return with(Kind::start_afresh, {}); }
  /// The loop ends: the driver can go on no more.
  static Served failed(std::string_view why) { return with(Kind::failed, why); }

  /// It takes time: it ends later, and its sender sees the progress meanwhile. At most one request
  /// of a kind runs: another one is rejected before its handler is asked.
  static Served running(std::string_view progress = {}) { return with(Kind::running, progress); }

  /// Of a rejection or a failure; the progress of one that runs.
  std::string_view why() const { return {text.data(), strnlen(text.data(), text.size())}; }

 private:
  static Served with(Kind kind, std::string_view why) {
    Served served;
    served.kind = kind;
    const std::size_t size = why.size() < served.text.size() ? why.size() : served.text.size() - 1;
    if (size > 0) std::memcpy(served.text.data(), why.data(), size);
    return served;
  }
};

/// Where a fresh reading of the robot goes; the blocks are laid out as the schema says.
struct FreshReading {
  std::byte* observed;
  std::byte* extended;
  std::byte* desired;  // holds a copy of `observed` only if it is left alone
  bool has_desired = false;
};

/// Who serves requests between two iterations: the driver, or the owner of an embedded backend.
class RequestServer {
 public:
  virtual Served serve(std::uint32_t request, std::span<const std::byte> payload) noexcept = 0;
  /// Reads the robot anew after `start_afresh`; false if it failed.
  virtual bool read_fresh(FreshReading& reading) noexcept = 0;
  /// A halt begins: commands have ended, the actuators brake. False if the robot failed.
  virtual bool halt() noexcept { return true; }
  /// A halt is to be cleared; `rejected` keeps it, and its sender reads why.
  virtual Served resume() noexcept { return Served::done(); }

 protected:
  ~RequestServer() = default;
};

}  // namespace o80
