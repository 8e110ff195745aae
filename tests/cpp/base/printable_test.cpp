#include "base/printable.hpp"

#include <gtest/gtest.h>

namespace o80 {
namespace {

TEST(Printable, LeavesEveryPrintableByteAsItIs) {
  std::string all;
  for (char c = ' '; c <= '~'; ++c) all += c;
  EXPECT_EQ(all.size(), 95U);
  EXPECT_EQ(printable(all), all);
  EXPECT_EQ(printable(""), "");
}

TEST(Printable, MakesQuestionMarksOfAllOtherBytesAndKeepsTheLength) {
  for (int byte = 0; byte < 256; ++byte) {
    if (byte >= ' ' && byte <= '~') continue;
    const std::string text{'a', static_cast<char>(byte), 'z'};
    EXPECT_EQ(printable(text), "a?z") << byte;
  }
}

TEST(Printable, LetsNoSequenceReachATerminal) {
  EXPECT_EQ(printable("\x1b[31mred\x07\r\n"), "?[31mred???");
  EXPECT_EQ(printable(std::string_view("ad\0a", 4)), "ad?a");
}

}  // namespace
}  // namespace o80
