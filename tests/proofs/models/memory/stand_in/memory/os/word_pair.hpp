#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstring>

namespace o80 {

/// Two words, one after the other: the model has no pairs.
inline void store_pair(std::uint64_t* shared, const std::byte* from) noexcept {
  for (int i = 0; i < 2; ++i) {
    std::uint64_t word;
    std::memcpy(&word, from + 8 * i, 8);
    std::atomic_ref(shared[i]).store(word, std::memory_order_relaxed);
  }
}

inline void load_pair(std::byte* to, const std::uint64_t* shared) noexcept {
  auto* words = const_cast<std::uint64_t*>(shared);
  for (int i = 0; i < 2; ++i) {
    const std::uint64_t word = std::atomic_ref(words[i]).load(std::memory_order_relaxed);
    std::memcpy(to + 8 * i, &word, 8);
  }
}

}  // namespace o80
