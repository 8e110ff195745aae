#pragma once

// Counts every `new` of a test program: to be included by one of its files only.

#include <atomic>
#include <cstddef>
#include <cstdlib>
#include <new>

namespace {
thread_local std::size_t allocations = 0;  // of the calling thread
std::atomic<std::size_t> allocations_of_all{0};
}  // namespace

// clang's thread sanitizer brings operators of its own, which nobody may replace: nothing is
// counted
#ifdef O80_TEST_THREAD_SANITIZED
constexpr bool kAllocationsAreCounted = false;
#else
constexpr bool kAllocationsAreCounted = true;
// never inlined: g++ 12 would take the pairs apart and call them mismatched
[[gnu::noinline]] void* operator new(std::size_t bytes) {
  ++allocations, ++allocations_of_all;
  if (void* memory = std::malloc(bytes == 0 ? 1 : bytes)) return memory;
  throw std::bad_alloc();
}
[[gnu::noinline]] void* operator new(std::size_t bytes, std::align_val_t alignment) {
  ++allocations, ++allocations_of_all;
  const auto step = static_cast<std::size_t>(alignment);
  if (void* memory = std::aligned_alloc(step, (bytes + step - 1) / step * step)) return memory;
  throw std::bad_alloc();
}
[[gnu::noinline]] void operator delete(void* memory) noexcept { std::free(memory); }
[[gnu::noinline]] void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
[[gnu::noinline]] void operator delete(void* memory, std::align_val_t) noexcept {
  std::free(memory);
}
[[gnu::noinline]] void operator delete(void* memory, std::size_t, std::align_val_t) noexcept {
  std::free(memory);
}
#endif
