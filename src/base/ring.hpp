#pragma once

#include <cstddef>
#include <utility>
#include <vector>

namespace o80 {

/// A queue with two ends that keeps its memory: once it has had its largest size, it allocates
/// nothing. (std::deque allocates again and again while elements pass through it.)
template <class T>
class Ring {
 public:
  bool empty() const noexcept { return size_ == 0; }
  std::size_t size() const noexcept { return size_; }
  T& front() noexcept { return places_[begin_]; }
  T& back() noexcept { return places_[place(size_ - 1)]; }

  void push_back(const T& value) {
    grow_if_full();
    places_[place(size_++)] = value;
  }
  void push_front(const T& value) {
    grow_if_full();
    begin_ = place(places_.size() - 1);
    ++size_;
    places_[begin_] = value;
  }
  void pop_front() noexcept {
    begin_ = place(1);
    --size_;
  }
  void pop_back() noexcept { --size_; }

 private:
  /// The place of the i-th element. The number of places is a power of two.
  std::size_t place(std::size_t i) const noexcept { return (begin_ + i) & (places_.size() - 1); }
  void grow_if_full() {
    if (size_ < places_.size()) return;
    std::vector<T> larger(places_.empty() ? 8 : 2 * places_.size());
    for (std::size_t i = 0; i < size_; ++i) larger[i] = places_[place(i)];
    places_ = std::move(larger);
    begin_ = 0;
  }

  std::vector<T> places_;
  std::size_t begin_ = 0;
  std::size_t size_ = 0;
};

}  // namespace o80
