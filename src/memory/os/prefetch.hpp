#pragma once

namespace o80 {

/// Prefetches a cache line for writing, so that the next store does not wait for it.
inline void prefetch_to_write(const void* line) noexcept {
#if defined(__x86_64__)
  // __builtin_prefetch fetches for reading, unless compiled with -mprfchw
  asm volatile("prefetchw %0" : : "m"(*static_cast<const char*>(line)));
#else
  __builtin_prefetch(line, 1);
#endif
}

}  // namespace o80
