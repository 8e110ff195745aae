#include "base/ring.hpp"

#include <gtest/gtest.h>

#include <deque>
#include <random>

namespace o80 {
namespace {

TEST(RingTest, DoesWhatADequeDoes) {
  Ring<int> ring;
  std::deque<int> deque;
  std::mt19937 random(1);
  for (int i = 0; i < 20'000; ++i) {
    // longer and shorter phases, so that it grows while its elements wrap around its end
    const bool adds = random() % 100 < (i / 500 % 2 == 0 ? 60U : 40U);
    const bool at_front = random() % 3 == 0;
    if (adds) {
      at_front ? ring.push_front(i) : ring.push_back(i);
      at_front ? deque.push_front(i) : deque.push_back(i);
    } else if (!deque.empty()) {
      at_front ? ring.pop_back() : ring.pop_front();
      at_front ? deque.pop_back() : deque.pop_front();
    }
    ASSERT_EQ(ring.size(), deque.size());
    ASSERT_EQ(ring.empty(), deque.empty());
    if (deque.empty()) continue;
    ASSERT_EQ(ring.front(), deque.front());
    ASSERT_EQ(ring.back(), deque.back());
  }
}

}  // namespace
}  // namespace o80
