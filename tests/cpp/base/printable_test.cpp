#include "base/printable.hpp"

#include <gtest/gtest.h>

#include <array>

namespace o80 {
namespace {

TEST(Printable, LeavesAllLettersAsTheyAre) {
  for (const char* text : {"", " ~", "die Tür klemmt", "дверь", "門", "🚪", "é"}) {
    EXPECT_EQ(printable(text), text);
  }
}

TEST(Printable, MakesOneQuestionMarkOfEachInvalidPart) {
  for (int byte = 0x80; byte < 256; ++byte) {
    const std::string text{'a', static_cast<char>(byte), 'z'};
    EXPECT_EQ(printable(text), "a?z") << byte;
  }
  EXPECT_EQ(printable("\xED\xB3\xBC"), "?") << "a surrogate";
  EXPECT_EQ(printable("\xC0\xAF|\xE0\x80\xAF|\xF4\x90\x80\x80|"), "??|?|?|")
      << "overlong, too high";
}

TEST(Printable, LetsNothingControlATerminal) {
  EXPECT_EQ(printable("\x1b[31mred\x07\r\n\x7f"), "?[31mred????");
  EXPECT_EQ(printable(std::string_view("ad\0a", 4)), "ad?a");
  EXPECT_EQ(printable("\xC2\x9B|\xE2\x80\xAE|\xE2\x80\x8B|\xEF\xBB\xBF|\xE2\x80\xA8|"),
            "?|?|?|?|?|");
  EXPECT_EQ(printable("\xEE\x80\x80|\xEF\xBF\xBE|\xF3\xA0\x80\x81|"), "?|?|?|");
}

TEST(Printable, EndsBeforeACharacterThatWasCutOrDoesNotFit) {
  EXPECT_EQ(printable("T\xC3"), "T");
  EXPECT_EQ(printable("T\xF0\x9F\x9A"), "T");
  std::array<char, 4> room{};
  EXPECT_EQ(printable("aüü", room.data(), room.size()), 3U);
  EXPECT_EQ(printable("", room.data(), 0), 0U);
}

}  // namespace
}  // namespace o80
