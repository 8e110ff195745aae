#include "base/sha256.hpp"

#include <gtest/gtest.h>

#include <random>
#include <string>

namespace o80::test {
namespace {

std::span<const std::byte> bytes_of(std::string_view text) {
  return {reinterpret_cast<const std::byte*>(text.data()), text.size()};
}

std::string sha256(std::string_view text) {
  Sha256 hash;
  hash.add(bytes_of(text));
  return hash.hex();
}

TEST(Sha256Test, AgreesWithThePublishedExamples) {
  EXPECT_EQ(sha256(""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  EXPECT_EQ(sha256("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(sha256("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq"),
            "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
  EXPECT_EQ(sha256(std::string(1'000'000, 'a')),
            "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
}

TEST(Sha256Test, DoesNotDependOnThePiecesInWhichBytesCome) {
  std::mt19937 random(1);
  for (std::size_t length = 0; length < 200; ++length) {
    std::string text;
    while (text.size() < length) text += static_cast<char>(random());
    Sha256 pieces;
    for (std::size_t at = 0; at < length;) {
      const std::size_t size = std::min<std::size_t>(random() % 80, length - at);
      pieces.add(bytes_of(text).subspan(at, size));
      at += size;
    }
    ASSERT_EQ(pieces.hex(), sha256(text)) << length;
  }
}

}  // namespace
}  // namespace o80::test
