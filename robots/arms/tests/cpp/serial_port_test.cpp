#include "arms/serial_port.hpp"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <stdlib.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

#include <array>
#include <cstdio>
#include <fstream>
#include <stdexcept>
#include <string>

namespace o80::arms {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

/// The side of a pseudo-terminal on which the servos are.
class Terminal {
 public:
  Terminal() : descriptor_(posix_openpt(O_RDWR | O_NOCTTY)) {
    grantpt(descriptor_);
    unlockpt(descriptor_);
  }
  Terminal(const Terminal&) = delete;
  ~Terminal() { unplug(); }
  std::string path() const { return ptsname(descriptor_); }
  int descriptor() const { return descriptor_; }
  void unplug() {
    if (descriptor_ >= 0) ::close(descriptor_);
    descriptor_ = -1;
  }

 private:
  int descriptor_;
};

TEST(SerialPort, CarriesEveryByteUnchangedAtOneMegabaud) {
  const Terminal terminal;
  SerialPort port = SerialPort::open(terminal.path());
  std::array<std::uint8_t, 256> bytes{};
  for (std::size_t i = 0; i < bytes.size(); ++i) bytes[i] = static_cast<std::uint8_t>(i);
  ASSERT_EQ(::write(terminal.descriptor(), bytes.data(), bytes.size()), 256);
  std::array<std::uint8_t, 512> arrived{};
  std::size_t count = 0;
  while (count < 256 && port.wait_readable(now() + 60'000'000'000)) {
    count += port.read(std::span(arrived).subspan(count));
  }
  ASSERT_EQ(count, 256U);
  EXPECT_TRUE(std::equal(bytes.begin(), bytes.end(), arrived.begin()));
  termios line{};
  ASSERT_EQ(tcgetattr(terminal.descriptor(), &line), 0);
  EXPECT_EQ(cfgetospeed(&line), static_cast<speed_t>(B1000000));
}

TEST(SerialPort, GetsNoneOfTheStandardDescriptorsOfAHostThatLacksThem) {
  const Terminal terminal;
  const int input = fcntl(STDIN_FILENO, F_DUPFD_CLOEXEC, 3);
  ::close(STDIN_FILENO);
  {
    const SerialPort port = SerialPort::open(terminal.path());
    EXPECT_LT(fcntl(STDIN_FILENO, F_GETFD), 0);
  }
  dup2(input, STDIN_FILENO);
  ::close(input);
}

TEST(SerialPort, IsOpenForOneOnly) {
  const Terminal terminal;
  const SerialPort port = SerialPort::open(terminal.path());
  EXPECT_THAT([&] { SerialPort::open(terminal.path()); },
              ThrowsMessage<std::runtime_error>(HasSubstr("open")));
}

// the flag outlives a killed process there; root may open the line all the same, so it is asked
TEST(SerialPort, MakesNoPseudoTerminalExclusive) {
  const Terminal terminal;
  const SerialPort port = SerialPort::open(terminal.path());
  const int other = ::open(terminal.path().c_str(), O_RDWR | O_NOCTTY | O_CLOEXEC);
  int exclusive = 1;
  EXPECT_EQ(ioctl(other, TIOCGEXCL, &exclusive), 0);
  EXPECT_EQ(exclusive, 0);
  ::close(other);
}

TEST(SerialPort, SaysWhatToDoIfThereIsNone) {
  EXPECT_THAT([] { SerialPort::open("/dev/ttyNONE"); },
              ThrowsMessage<std::runtime_error>(HasSubstr("`o80 arms` lists")));
  const std::string file = testing::TempDir() + "o80_no_line_" + std::to_string(getpid());
  std::ofstream(file) << "no line";  // one that no other process has open
  EXPECT_THAT([&] { SerialPort::open(file); },
              ThrowsMessage<std::runtime_error>(HasSubstr("not a serial line")));
  std::remove(file.c_str());
}

TEST(SerialPort, IsClosedWhenTheAdapterIsUnpluggedAndOpensAgain) {
  Terminal terminal;
  SerialPort port = SerialPort::open(terminal.path());
  terminal.unplug();
  std::array<std::uint8_t, 8> room{};
  EXPECT_EQ(port.read(room), 0U);
  EXPECT_FALSE(port.is_open());
  EXPECT_FALSE(port.write(room));
  const Terminal again;
  EXPECT_TRUE(port.reopen(again.path().c_str()));
  EXPECT_TRUE(port.write(room));
}

}  // namespace
}  // namespace o80::arms
