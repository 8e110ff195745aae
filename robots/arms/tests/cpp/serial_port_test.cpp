#include "arms/serial_port.hpp"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <stdlib.h>
#include <termios.h>
#include <unistd.h>

#include <array>
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

TEST(SerialPort, IsOpenForOneOnly) {
  const Terminal terminal;
  const SerialPort port = SerialPort::open(terminal.path());
  EXPECT_THAT([&] { SerialPort::open(terminal.path()); },
              ThrowsMessage<std::runtime_error>(HasSubstr("open")));
}

TEST(SerialPort, SaysWhatToDoIfThereIsNone) {
  EXPECT_THAT([] { SerialPort::open("/dev/ttyNONE"); },
              ThrowsMessage<std::runtime_error>(HasSubstr("`o80 arms` lists")));
  EXPECT_THAT([] { SerialPort::open("/dev/full"); },
              ThrowsMessage<std::runtime_error>(HasSubstr("no serial line")));
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
