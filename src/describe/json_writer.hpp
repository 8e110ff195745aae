#pragma once

#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <iomanip>
#include <sstream>
#include <string>
#include <string_view>

namespace o80 {

/// Writes JSON and sets the commas.
class JsonWriter {
 public:
  void open(char bracket) {
    separate();
    text_ << bracket;
    first_ = true;
  }
  void close(char bracket) {
    text_ << bracket;
    first_ = false;
  }
  void key(std::string_view name) {
    separate();
    quote(name);
    text_ << ": ";
    after_key_ = true;
  }
  void value(std::string_view text) {
    separate();
    quote(text);
  }
  void value(bool yes) {
    separate();
    text_ << (yes ? "true" : "false");
  }
  void value(std::int64_t number) {
    separate();
    text_ << number;
  }
  void value(std::uint64_t number) {
    separate();
    text_ << number;
  }
  void value(double number) {
    separate();
    if (std::isfinite(number)) {
      text_ << std::setprecision(17) << number;
    } else {
      text_ << "null";
    }
  }
  /// A finite number, with the fewest digits that read back as the same number.
  void value(float number) {
    separate();
    std::array<char, 24> digits{};
    const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), number).ptr;
    text_.write(digits.data(), end - digits.data());
  }
  std::string str() const { return text_.str(); }

 private:
  void separate() {
    if (!first_ && !after_key_) text_ << ", ";
    first_ = false;
    after_key_ = false;
  }
  void quote(std::string_view text) {
    text_ << '"';
    for (const char c : text) {
      if (c == '"' || c == '\\') {
        text_ << '\\' << c;
      } else if (static_cast<unsigned char>(c) < 32) {
        text_ << "\\u" << std::hex << std::setw(4) << std::setfill('0') << static_cast<int>(c)
              << std::dec;
      } else {
        text_ << c;
      }
    }
    text_ << '"';
  }

  std::ostringstream text_;
  bool first_ = true;
  bool after_key_ = false;
};

}  // namespace o80
