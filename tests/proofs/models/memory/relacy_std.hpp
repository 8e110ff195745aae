#pragma once

/// Included before every file of the product that a model is made of: `std` becomes a namespace
/// that is std but for its atomics, which are Relacy's. The files themselves stay as they are.

// whatever the product includes, before `std` means something else
#include <fcntl.h>
#include <sys/types.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <deque>
#include <functional>
#include <iostream>
#include <limits>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <relacy/atomic.hpp>
#include <relacy/atomic_fence.hpp>
#include <relacy/backoff.hpp>
#include <relacy/base.hpp>
#include <relacy/context.hpp>
#include <relacy/context_base_impl.hpp>
#include <relacy/stdlib/condition_variable.hpp>
#include <relacy/stdlib/event.hpp>
#include <relacy/stdlib/mutex.hpp>
#include <relacy/stdlib/semaphore.hpp>
#include <relacy/test_suite.hpp>
#include <relacy/thread_local.hpp>
#include <relacy/var.hpp>

#define memory_order_relaxed mo_relaxed, RL_INFO
#define memory_order_acquire mo_acquire, RL_INFO
#define memory_order_release mo_release, RL_INFO
#define memory_order_acq_rel mo_acq_rel, RL_INFO
#define memory_order_seq_cst mo_seq_cst, RL_INFO

namespace model {
class Word;
/// The word of the segment at this address.
Word& word_at(const void* address);
std::uint64_t load_word(Word& word, rl::memory_order order, rl::debug_info_param info);
void store_word(Word& word, std::uint64_t value, rl::memory_order order, rl::debug_info_param info);
}  // namespace model

namespace model_std {

using namespace ::std;
using rl::atomic;
using rl::atomic_thread_fence;
using rl::mo_acq_rel;
using rl::mo_acquire;
using rl::mo_relaxed;
using rl::mo_release;
using rl::mo_seq_cst;

template <class T>
class atomic_ref {
 public:
  explicit atomic_ref(T& word) : word_(&model::word_at(&word)) {}
  T load(rl::memory_order order, rl::debug_info_param info) const {
    return model::load_word(*word_, order, info);
  }
  void store(T value, rl::memory_order order, rl::debug_info_param info) {
    model::store_word(*word_, value, order, info);
  }

 private:
  model::Word* word_;
};
template <class T>
atomic_ref(T&) -> atomic_ref<T>;

}  // namespace model_std

#define std model_std
// sizes are of real atomics
#define static_assert(...) static_assert(true)
