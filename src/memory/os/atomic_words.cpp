#include "memory/os/atomic_words.hpp"

#include <algorithm>

namespace o80 {

void store_text(std::atomic<std::uint64_t>* words, std::size_t count,
                std::string_view text) noexcept {
  text = text.substr(0, 8 * count - 1);
  for (std::size_t i = 0; i < count; ++i) {
    std::uint64_t word = 0;
    if (8 * i < text.size())
      std::memcpy(&word, text.data() + 8 * i, std::min<std::size_t>(8, text.size() - 8 * i));
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
  text.resize(std::min(text.find('\0'), text.size()));
  return text;
}

}  // namespace o80
