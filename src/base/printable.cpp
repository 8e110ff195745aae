#include "base/printable.hpp"

#include <algorithm>
#include <cstring>
#include <iterator>

namespace o80 {

namespace {

struct CodeRange {
  char32_t first;
  char32_t last;
};

/// Categories Cc, Cf, Co, noncharacters, and the separators of lines and paragraphs. Surrogates are
/// no UTF-8.
constexpr CodeRange kControls[] = {
    {0x0000, 0x001F},   {0x007F, 0x009F},   {0x00AD, 0x00AD},   {0x0600, 0x0605},
    {0x061C, 0x061C},   {0x06DD, 0x06DD},   {0x070F, 0x070F},   {0x0890, 0x0891},
    {0x08E2, 0x08E2},   {0x180E, 0x180E},   {0x200B, 0x200F},   {0x2028, 0x202E},
    {0x2060, 0x206F},   {0xE000, 0xF8FF},   {0xFDD0, 0xFDEF},   {0xFEFF, 0xFEFF},
    {0xFFF0, 0xFFFB},   {0x110BD, 0x110BD}, {0x110CD, 0x110CD}, {0x13430, 0x1343F},
    {0x1BCA0, 0x1BCA3}, {0x1D173, 0x1D17A}, {0x40000, 0xE00FF}, {0xE01F0, 0x1FFFFF},
};

bool controls(char32_t code) noexcept {
  if (code >= ' ' && code <= '~') return false;
  if ((code & 0xFFFE) == 0xFFFE) return true;  // noncharacters at the end of each plane
  return std::ranges::any_of(
      kControls, [code](CodeRange range) { return range.first <= code && code <= range.last; });
}

struct Character {
  std::size_t bytes;
  bool is_valid;
  bool is_cut;  // the text ends inside it
  char32_t code;
};

/// The first character of a text that is not empty; of invalid bytes those that belong together.
Character first_character(std::string_view text) noexcept {
  constexpr char32_t kLeast[] = {0, 0, 0x80, 0x800, 0x10000};  // shorter forms are invalid
  const auto lead = static_cast<unsigned char>(text[0]);
  if (lead < 0x80) return {1, true, false, lead};
  if (lead < 0xC2 || lead > 0xF4) return {1, false, false, 0};
  const std::size_t bytes = lead >= 0xF0 ? 4 : lead >= 0xE0 ? 3 : 2;
  char32_t code = lead & (0x7FU >> bytes);
  for (std::size_t i = 1; i < bytes; ++i) {
    if (i == text.size()) return {i, false, true, 0};
    const auto next = static_cast<unsigned char>(text[i]);
    if ((next & 0xC0U) != 0x80) return {i, false, false, 0};
    code = code << 6 | (next & 0x3FU);
  }
  const bool is_valid =
      code >= kLeast[bytes] && code <= 0x10FFFF && (code < 0xD800 || code > 0xDFFF);
  return {bytes, is_valid, false, code};
}

}  // namespace

std::size_t printable(std::string_view text, char* to, std::size_t room) noexcept {
  std::size_t size = 0;
  while (!text.empty()) {
    const Character next = first_character(text);
    const bool stays = next.is_valid && !controls(next.code);
    const std::size_t added = stays ? next.bytes : 1;
    if (next.is_cut || added > room - size) break;
    std::memcpy(to + size, stays ? text.data() : "?", added);
    size += added;
    text.remove_prefix(next.bytes);
  }
  return size;
}

bool is_utf8(std::string_view text) noexcept {
  bool is_valid = true;
  while (is_valid && !text.empty()) {
    const Character next = first_character(text);
    is_valid = next.is_valid;
    text.remove_prefix(next.bytes);
  }
  return is_valid;
}

std::string printable(std::string_view text) {
  std::string clean(text.size(), '\0');
  clean.resize(printable(text, clean.data(), clean.size()));
  return clean;
}

}  // namespace o80
