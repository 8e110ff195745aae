#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstring>

#if defined(__SANITIZE_THREAD__) || defined(__SANITIZE_ADDRESS__)
#define O80_SANITIZED
#elif defined(__has_feature)
#if __has_feature(thread_sanitizer) || __has_feature(address_sanitizer)
#define O80_SANITIZED
#endif
#endif

#if defined(__x86_64__) && !defined(O80_SANITIZED)
#include <emmintrin.h>
#endif

namespace o80 {

// Copies two words between private and shared memory, as two relaxed atomic words.
//
// On x86-64 by one instruction of 16 bytes: it keeps the order of all other loads and stores, as
// relaxed words do there, and no part of an aligned word of 8 bytes is seen alone. It is written in
// assembler, because an ordinary vector access would be a data race. Sanitizers get the words.

#if defined(__x86_64__) && !defined(O80_SANITIZED)

inline void store_pair(std::uint64_t* shared, const std::byte* from) noexcept {
  const __m128i pair = _mm_loadu_si128(reinterpret_cast<const __m128i*>(from));
  asm volatile("movups %1, %0" : "=m"(*reinterpret_cast<__m128i_u*>(shared)) : "x"(pair));
}

inline void load_pair(std::byte* to, const std::uint64_t* shared) noexcept {
  __m128i pair;
  asm volatile("movups %1, %0" : "=x"(pair) : "m"(*reinterpret_cast<const __m128i_u*>(shared)));
  _mm_storeu_si128(reinterpret_cast<__m128i*>(to), pair);
}

#else

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

#endif

}  // namespace o80
