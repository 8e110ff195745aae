#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>

#include "memory/os/word_pair.hpp"

namespace o80 {

// Copies between private and shared memory in relaxed atomic words of 8 bytes: another process may
// write the shared side during the copy. `shared` is aligned to 8, `bytes` is a multiple of 8, the
// private side needs no alignment. Unrolled by hand, because compilers do not unroll loops over
// atomics: every row is copied here.

inline void store_words(std::byte* shared, const std::byte* from, std::size_t bytes) noexcept {
  auto* words = reinterpret_cast<std::uint64_t*>(shared);
  std::size_t i = 0;
  for (; i + 4 <= bytes / 8; i += 4) {
    store_pair(words + i, from + 8 * i);
    store_pair(words + i + 2, from + 8 * i + 16);
  }
  for (std::size_t left = bytes / 8 % 4; left > 0; --left, ++i) {
    std::uint64_t word;
    std::memcpy(&word, from + 8 * i, 8);
    std::atomic_ref(words[i]).store(word, std::memory_order_relaxed);
  }
}

inline void load_words(std::byte* to, const std::byte* shared, std::size_t bytes) noexcept {
  auto* words = reinterpret_cast<std::uint64_t*>(const_cast<std::byte*>(shared));
  std::size_t i = 0;
  for (; i + 4 <= bytes / 8; i += 4) {
    load_pair(to + 8 * i, words + i);
    load_pair(to + 8 * i + 16, words + i + 2);
  }
  for (std::size_t left = bytes / 8 % 4; left > 0; --left, ++i) {
    const std::uint64_t word = std::atomic_ref(words[i]).load(std::memory_order_relaxed);
    std::memcpy(to + 8 * i, &word, 8);
  }
}

/// The same from any place: bytes begin .. begin + size - 1 behind `shared`.
inline void load_bytes(std::byte* to, const std::byte* shared, std::size_t begin,
                       std::size_t size) noexcept {
  if (begin % 8 == 0 && size % 8 == 0) return load_words(to, shared + begin, size);
  while (size > 0) {
    const std::size_t skipped = begin % 8;
    const std::size_t got = skipped + size < 8 ? size : 8 - skipped;
    std::byte word[8];
    load_words(word, shared + begin - skipped, 8);
    std::memcpy(to, word + skipped, got);
    begin += got;
    to += got;
    size -= got;
  }
}

inline constexpr std::size_t kMostTextWords = 128;

/// Writes a text with a terminating zero, made printable; excess characters are dropped. Release:
/// see `load_text`.
void store_text(std::atomic<std::uint64_t>* words, std::size_t count,
                std::string_view text) noexcept;

/// Reads a text up to its zero, never out of bounds, and makes it printable. During a write it may
/// mix old and new words.
std::string load_text(const std::atomic<std::uint64_t>* words, std::size_t count);

/// The same, into a buffer of 8 * count bytes with a terminating zero.
void load_text(const std::atomic<std::uint64_t>* words, std::size_t count, char* to) noexcept;

}  // namespace o80
