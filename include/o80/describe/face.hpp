#pragma once

#include <algorithm>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "o80/describe/schema_bytes.hpp"

namespace o80 {

/// The described side of a robot (groups, states, limits, sensor values, requests), as a field of a
/// Config: a simulator takes the face of another robot. Users give a robot's name, a segment, a
/// recording or a file; o80's Python converts it to a text, so that a replay needs nothing else.
struct Face {
  Schema schema;  // of the other robot, period included; empty if the option is not given
  bool empty() const { return schema.actuators.empty() && schema.head.extended == kNoType; }
};
inline constexpr std::string_view kFaceKind = "face";

namespace describing {

/// The schema of a text: "face:", then the hash and the bytes of the schema in base64. o80 checks
/// the text before it reaches a driver (check_face); this function throws for a damaged one.
inline Schema face_from(std::string_view text) {
  constexpr std::string_view kBegin = "face:";
  constexpr std::string_view kDigits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  if (!text.starts_with(kBegin)) {
    throw InvalidArgument(
        "'" + std::string(text.substr(0, 40)) +
        "' is not the text of a face: give a robot's name to `o80 run` or o80.robots");
  }
  std::vector<std::byte> bytes;
  std::uint32_t bits = 0;
  int count = 0;
  for (const char digit : text.substr(kBegin.size(), text.find('=') - kBegin.size())) {
    bits = bits << 6 | static_cast<std::uint32_t>(kDigits.find(digit) % 64);
    count += 6;
    if (count < 8) continue;
    count -= 8;
    bytes.push_back(static_cast<std::byte>(bits >> count));
  }
  const auto table = std::span(bytes).subspan(std::min(bytes.size(), sizeof(std::uint64_t)));
  const std::uint64_t hash = hash_of(table);
  if (table.empty() || std::memcmp(bytes.data(), &hash, sizeof hash) != 0) {
    throw InvalidArgument("the text of the face is damaged");
  }
  try {
    return schema_in(table);
  } catch (const InvalidArgument&) {
    throw InvalidArgument("the face is of another version of o80");
  }
}

}  // namespace describing
}  // namespace o80
