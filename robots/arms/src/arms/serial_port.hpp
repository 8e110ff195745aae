#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

namespace o80::arms {

/// CLOCK_MONOTONIC, which is std::chrono::steady_clock [ns].
inline std::int64_t now() noexcept {
  return std::chrono::nanoseconds(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/// A serial line at 1 Mbaud, or a pseudo-terminal. Move-only; nothing here blocks but
/// `wait_readable`.
class SerialPort {
 public:
  SerialPort() = default;
  /// Takes ownership of an open descriptor, for example a test's socket.
  explicit SerialPort(int descriptor) noexcept;
  SerialPort(SerialPort&& other) noexcept;
  SerialPort& operator=(SerialPort&& other) noexcept;
  ~SerialPort() { close(); }

  /// Opens the line exclusively. Throws std::runtime_error, whose text names the cure.
  static SerialPort open(const std::string& path);
  /// Opens the line again, without messages and allocations; false if that fails.
  bool reopen(const char* path) noexcept;
  void close() noexcept;
  /// False before the line is opened, and after the adapter was detected as unplugged.
  bool is_open() const noexcept { return descriptor_ >= 0; }

  /// Reads received bytes, as many as fit; 0 if there are none.
  std::size_t read(std::span<std::uint8_t> room) noexcept;
  /// Writes all bytes or none; false if none were written.
  bool write(std::span<const std::uint8_t> bytes) noexcept;
  /// Drops received bytes; true if there were any.
  bool discard_input() noexcept;
  /// Sleeps until bytes may have arrived; false at this time of the monotonic clock [ns].
  bool wait_readable(std::int64_t deadline) const noexcept;

 private:
  int descriptor_ = -1;
};

/// Finds the only servo adapter that is plugged in. Throws std::runtime_error for none or
/// several.
std::string only_port();
/// Returns the name in /dev/serial/by-id, which survives replugging; `port` if there is none.
std::string lasting_name(const std::string& port);

}  // namespace o80::arms
