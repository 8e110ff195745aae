#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace o80 {

/// Makes one line of valid UTF-8 from any bytes: safe for a terminal, a file and Python.
///
/// All letters stay. Invalid UTF-8, all characters of the Unicode categories Cc, Cf, Cs and Co,
/// noncharacters, and separators of lines and paragraphs become question marks; other unassigned
/// characters stay. A text that was cut inside a character ends before it. The result is not longer
/// than the text.
std::string printable(std::string_view text);

/// The same into `to`, with at most `room` bytes and whole characters only; returns its size.
///
/// Realtime: yes.
std::size_t printable(std::string_view text, char* to, std::size_t room) noexcept;

/// True for valid UTF-8: no stray byte, no overlong form, no surrogate, nothing above 0x10FFFF.
bool is_utf8(std::string_view text) noexcept;

}  // namespace o80
