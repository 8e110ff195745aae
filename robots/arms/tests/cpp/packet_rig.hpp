#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace o80::arms {

using Bytes = std::vector<std::uint8_t>;

inline Bytes operator+(Bytes first, const Bytes& second) {
  first.insert(first.end(), second.begin(), second.end());
  return first;
}

/// An answer as the codec finds it.
struct Heard {
  std::uint8_t id, status;
  Bytes data;
  bool operator==(const Heard&) const = default;
};

/// Answers in bytes that arrive `step` at a time.
template <class Answers>
std::vector<Heard> heard(Answers& answers, const Bytes& bytes, std::size_t step) {
  std::vector<Heard> all;
  for (std::size_t at = 0; at < bytes.size(); at += step) {
    const std::size_t count = std::min(step, bytes.size() - at);
    std::copy_n(bytes.begin() + static_cast<std::ptrdiff_t>(at), count, answers.room().begin());
    answers.arrived(count);
    while (const auto each = answers.next()) {
      all.push_back({each->id, each->status, {each->data.begin(), each->data.end()}});
    }
  }
  return all;
}

}  // namespace o80::arms
