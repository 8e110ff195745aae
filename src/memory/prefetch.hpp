#pragma once

namespace o80 {

/// Asks for a cache line that is about to be written, so that the store need not wait for it.
inline void prefetch_to_write(const void* line) noexcept {
#if defined(__x86_64__)
  // the builtin would ask for it to be read only, unless compiled for one kind of processor
  asm volatile("prefetchw %0" : : "m"(*static_cast<const char*>(line)));
#else
  __builtin_prefetch(line, 1);
#endif
}

}  // namespace o80
