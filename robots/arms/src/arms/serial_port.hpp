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
  /// Owns a descriptor that was opened elsewhere: a socket of a test.
  explicit SerialPort(int descriptor) noexcept;
  SerialPort(SerialPort&& other) noexcept;
  SerialPort& operator=(SerialPort&& other) noexcept;
  ~SerialPort() { close(); }

  /// Opens it for this process alone. Throws std::runtime_error, whose text names the cure.
  static SerialPort open(const std::string& path);
  /// The same without a word and without memory: false if it cannot be opened.
  bool reopen(const char* path) noexcept;
  void close() noexcept;
  /// False before it is opened, and from the moment at which the adapter is found unplugged.
  bool is_open() const noexcept { return descriptor_ >= 0; }

  /// Bytes that have arrived, as far as there is room; 0 if there are none.
  std::size_t read(std::span<std::uint8_t> room) noexcept;
  /// All of them or none: false if they did not leave.
  bool write(std::span<const std::uint8_t> bytes) noexcept;
  /// Drops what has arrived; true if there was something.
  bool discard_input() noexcept;
  /// Sleeps until something may have arrived; false at this moment of the monotonic clock [ns].
  bool wait_readable(std::int64_t deadline) const noexcept;

 private:
  int descriptor_ = -1;
};

/// The only adapter for servos that is plugged in. Throws std::runtime_error if there is none, or
/// several.
std::string only_port();
/// Its name in /dev/serial/by-id, which stays when it is plugged in again; `port` if it has none.
std::string lasting_name(const std::string& port);

}  // namespace o80::arms
