#include "arms/serial_port.hpp"

#include <fcntl.h>
#include <linux/serial.h>
#include <poll.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <termios.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <utility>
#include <vector>

namespace o80::arms {
namespace {

namespace fs = std::filesystem;

/// Sets raw bytes at 1 Mbaud; false if this is no terminal.
bool set_line(int descriptor) noexcept {
  termios line{};
  if (tcgetattr(descriptor, &line) != 0) return false;
  cfmakeraw(&line);
  line.c_cflag |= CLOCAL | CREAD;
  line.c_cflag &= ~static_cast<tcflag_t>(CRTSCTS);
  line.c_cc[VMIN] = 1;
  line.c_cc[VTIME] = 0;
  if (cfsetspeed(&line, B1000000) != 0 || tcsetattr(descriptor, TCSANOW, &line) != 0) return false;
  // FTDI adapters delay bytes for 16 ms without it; others and pseudo-terminals lack the setting
  serial_struct serial{};
  if (ioctl(descriptor, TIOCGSERIAL, &serial) == 0) {
    serial.flags |= ASYNC_LOW_LATENCY;
    static_cast<void>(ioctl(descriptor, TIOCSSERIAL, &serial));
  }
  return true;
}

/// A pseudo-terminal would stay exclusive while its other side is open, even after a kill.
bool is_pseudo_terminal(int descriptor) noexcept {
  constexpr unsigned kFirst = 136, kLast = 143;  // major numbers
  struct stat file{};
  return fstat(descriptor, &file) == 0 && major(file.st_rdev) >= kFirst &&
         major(file.st_rdev) <= kLast;
}

/// Opens, locks and sets a line; a negative errno if that fails.
int opened(const char* path) noexcept {
  int descriptor = ::open(path, O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  // with closed standard descriptors, messages would be written to the servos
  if (descriptor >= 0 && descriptor <= STDERR_FILENO) {
    const int low =
        std::exchange(descriptor, fcntl(descriptor, F_DUPFD_CLOEXEC, STDERR_FILENO + 1));
    ::close(low);
  }
  if (descriptor < 0) return -errno;
  // the lock excludes o80, TIOCEXCL programs that do not lock
  int failed = 0;
  if (flock(descriptor, LOCK_EX | LOCK_NB) != 0) {
    failed = EBUSY;
  } else if (!set_line(descriptor)) {
    failed = ENOTTY;
  }
  if (failed != 0) {
    ::close(descriptor);
    return -failed;
  }
  if (!is_pseudo_terminal(descriptor)) static_cast<void>(ioctl(descriptor, TIOCEXCL));
  tcflush(descriptor, TCIOFLUSH);
  return descriptor;
}

/// Names a process that has this file open, "'lerobot-teleoperate' (pid 4711)", if visible to this
/// user.
std::string owner_of(const fs::path& file) {
  std::error_code error;
  const std::string own = std::to_string(getpid());
  for (const auto& process : fs::directory_iterator("/proc", error)) {
    const std::string pid = process.path().filename();
    if (pid.find_first_not_of("0123456789") != std::string::npos || pid == own) continue;
    for (const auto& open : fs::directory_iterator(process.path() / "fd", error)) {
      if (fs::read_symlink(open.path(), error) != file) continue;
      std::string name;
      std::getline(std::ifstream(process.path() / "comm"), name);
      return "'" + name + "' (pid " + pid + ")";
    }
  }
  return {};
}

std::vector<std::string> ports() {
  std::vector<std::string> found;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator("/dev", error)) {
    const std::string name = entry.path().filename();
    if (name.starts_with("ttyACM") || name.starts_with("ttyUSB")) found.push_back(entry.path());
  }
  return found;
}

}  // namespace

SerialPort::SerialPort(int descriptor) noexcept : descriptor_(descriptor) {}
SerialPort::SerialPort(SerialPort&& other) noexcept
    : descriptor_(std::exchange(other.descriptor_, -1)) {}
SerialPort& SerialPort::operator=(SerialPort&& other) noexcept {
  std::swap(descriptor_, other.descriptor_);
  return *this;
}

SerialPort SerialPort::open(const std::string& path) {
  std::error_code error;
  const fs::path file = fs::canonical(path, error);
  if (error) {
    throw std::runtime_error("there is no port " + path + ": `o80 arms` lists the ports");
  }
  const std::string owner = owner_of(file);
  if (!owner.empty()) {
    const bool modems = owner.starts_with("'ModemManager'");
    throw std::runtime_error(owner + " has " + path + " open: " +
                             (modems ? "`sudo systemctl stop ModemManager`" : "stop it first"));
  }
  const int result = opened(path.c_str());
  if (result >= 0) return SerialPort(result);
  switch (-result) {
    case EACCES:
      throw std::runtime_error("no permission for " + path +
                               ": run `sudo usermod -aG dialout $USER`, then log in again");
    case EBUSY:
      throw std::runtime_error("a process of another user has " + path + " open: `sudo fuser -v " +
                               path + "` names it");
    case ENOTTY:
      throw std::runtime_error(path + " is not a serial line for 1 Mbaud");
    default:
      throw std::runtime_error("cannot open " + path + " (" + std::strerror(-result) + ")");
  }
}

bool SerialPort::reopen(const char* path) noexcept {
  close();
  const int result = opened(path);
  if (result >= 0) descriptor_ = result;
  return result >= 0;
}

void SerialPort::close() noexcept {
  if (descriptor_ >= 0) ::close(descriptor_);
  descriptor_ = -1;
}

std::size_t SerialPort::read(std::span<std::uint8_t> room) noexcept {
  if (!is_open()) return 0;
  const ssize_t got = ::read(descriptor_, room.data(), room.size());
  if (got > 0) return static_cast<std::size_t>(got);
  const bool nothing = got < 0 && (errno == EAGAIN || errno == EINTR);
  if (!nothing && !room.empty()) close();  // end of file or EIO: unplugged
  return 0;
}

bool SerialPort::write(std::span<const std::uint8_t> bytes) noexcept {
  if (!is_open()) return false;
  const ssize_t left = ::write(descriptor_, bytes.data(), bytes.size());
  if (left < 0 && errno != EAGAIN && errno != EINTR) close();
  return left == static_cast<ssize_t>(bytes.size());
}

bool SerialPort::discard_input() noexcept {
  std::array<std::uint8_t, 256> dropped{};
  bool some = false;
  while (read(dropped) > 0) some = true;
  return some;
}

bool SerialPort::wait_readable(std::int64_t deadline) const noexcept {
  pollfd wanted{descriptor_, POLLIN, 0};
  while (is_open()) {
    const std::int64_t left = deadline - now();
    const std::int64_t sleep = left > 0 ? left : 0;
    const timespec timeout{sleep / 1'000'000'000, sleep % 1'000'000'000};
    const int ready = ppoll(&wanted, 1, &timeout, nullptr);
    if (ready > 0) return true;
    if (left <= 0 || (ready < 0 && errno != EINTR)) return false;
  }
  return false;
}

std::string only_port() {
  const std::vector<std::string> found = ports();
  if (found.empty()) {
    throw std::runtime_error(
        "no serial adapter was found: check its USB cable and its power, or give a port of "
        "another name with --port");
  }
  if (found.size() > 1) {
    throw std::runtime_error("there are " + std::to_string(found.size()) + " ports (" + found[0] +
                             ", " + found[1] + "): `o80 arms` lists them, --port chooses one");
  }
  return found[0];
}

std::string lasting_name(const std::string& port) {
  std::error_code error;
  const fs::path file = fs::canonical(port, error);
  for (const auto& link : fs::directory_iterator("/dev/serial/by-id", error)) {
    std::error_code broken;
    if (fs::canonical(link.path(), broken) == file) return link.path();
  }
  return port;
}

}  // namespace o80::arms
