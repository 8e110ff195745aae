#include "memory/os/atomic_words.hpp"

#include <algorithm>
#include <array>

#include "base/printable.hpp"

namespace o80 {

void store_text(std::atomic<std::uint64_t>* words, std::size_t count,
                std::string_view text) noexcept {
  std::array<char, 8 * kMostTextWords> chars{};
  count = std::min(count, kMostTextWords);
  printable(text, chars.data(), 8 * count - 1);
  for (std::size_t i = 0; i < count; ++i) {
    std::uint64_t word = 0;
    std::memcpy(&word, chars.data() + 8 * i, 8);
    words[i].store(word, std::memory_order_release);  // sync text
  }
}

void load_text(const std::atomic<std::uint64_t>* words, std::size_t count, char* to) noexcept {
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint64_t word = words[i].load(std::memory_order_acquire);  // sync text
    std::memcpy(to + 8 * i, &word, 8);
  }
  to[8 * count - 1] = 0;
}

std::string load_text(const std::atomic<std::uint64_t>* words, std::size_t count) {
  std::string text(8 * count, '\0');
  load_text(words, count, text.data());
  return printable(text.substr(0, text.find('\0')));
}

}  // namespace o80
