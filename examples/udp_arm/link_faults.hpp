#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

namespace udp_arm {

/// What goes wrong between the fake arm and its driver, by ticks since the first connect:
/// "drop 50-52, late 60, twice 70, swap 80, deaf 90-120, restart 200-300, fail 400".
class LinkFaults {
 public:
  enum class What : std::uint8_t {
    drop,     // the states of these ticks are lost
    late,     // the state arrives with the next one, before it
    twice,    // the state arrives twice
    swap,     // the state arrives with the next one, after it
    deaf,     // commands that arrive in these ticks are lost
    restart,  // the arm is off in these ticks, then has a new session
    fail      // the arm reports a failure from here on
  };

  LinkFaults() = default;
  /// Throws std::invalid_argument.
  explicit LinkFaults(const std::string& script) {
    std::istringstream parts(script);
    for (std::string part; std::getline(parts, part, ',');) spans_.push_back(parse(part));
  }

  bool has(What what, std::uint64_t tick) const {
    return std::ranges::any_of(spans_, [&](const Span& span) {
      return span.what == what && span.first <= tick && tick <= span.last;
    });
  }

 private:
  struct Span {
    What what;
    std::uint64_t first, last;
  };
  static constexpr std::array kNames = {"drop", "late", "twice", "swap", "deaf", "restart", "fail"};

  static Span parse(const std::string& part) {
    std::istringstream words(part);
    std::string name;
    Span span{};
    words >> name >> span.first;
    const auto* const found = std::ranges::find(kNames, name);
    const bool complete = !words.fail() && found != kNames.end();
    char dash = 0;
    span.what = static_cast<What>(found - kNames.begin());
    span.last = span.what == What::fail ? UINT64_MAX : span.first;
    if (complete && words >> dash) words >> span.last;
    if (!complete || (dash != 0 && (dash != '-' || words.fail()))) {
      throw std::invalid_argument("'" + part +
                                  "' is not a fault: write \"drop 50-52\" or \"late 60\"");
    }
    return span;
  }

  std::vector<Span> spans_;
};

}  // namespace udp_arm
