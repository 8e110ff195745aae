#include "memory/segment/running_slot.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <string>
#include <thread>
#include <vector>

namespace o80::test {
namespace {

using ::testing::IsEmpty;

/// Counters without a file.
class RunningSlotTest : public ::testing::Test {
 protected:
  RunningSlotTest() { view_.base = reinterpret_cast<std::byte*>(memory_.data()); }

  static RunningRequest request(std::uint64_t id, char text) {
    RunningRequest request;
    request.request = static_cast<std::uint32_t>(text);
    request.lane = 3;
    request.id = id;
    request.since = static_cast<Iteration>(id);
    std::fill_n(request.who.begin(), request.who.size() - 1, text);
    std::fill_n(request.progress.begin(), request.progress.size() - 1, text);
    return request;
  }
  RunningSlot& slot(std::size_t place) { return view_.counters().running[place]; }

  struct alignas(kLineBytes) Line {
    std::array<std::byte, kLineBytes> bytes{};
  };
  std::vector<Line> memory_ = std::vector<Line>(sizeof(Counters) / kLineBytes);
  SegmentView view_;
};

TEST_F(RunningSlotTest, ListsWhatRunsTheOldestFirst) {
  EXPECT_THAT(running_requests(view_), IsEmpty());
  show_running(slot(5), 1, request(7, 'a'));
  show_running(slot(2), 2, request(9, 'b'));
  ASSERT_EQ(running_requests(view_).size(), 2U);
  EXPECT_EQ(running_requests(view_)[0].id, 7U);
  EXPECT_EQ(running_requests(view_)[1].progress_text(), std::string(247, 'b'));
  hide_running(slot(5));
  EXPECT_EQ(running_requests(view_).size(), 1U);
}

TEST_F(RunningSlotTest, FindsARequestByLaneAndId) {
  show_running(slot(0), 1, request(7, 'a'));
  ASSERT_TRUE(running_request(view_, 3, 7));
  EXPECT_EQ(running_request(view_, 3, 7)->who_text(), std::string(63, 'a'));
  EXPECT_FALSE(running_request(view_, 2, 7));
  EXPECT_FALSE(running_request(view_, 3, 8));
}

TEST_F(RunningSlotTest, WhoseWriterWasKilledInTheMiddleReadsAsUnused) {
  show_running(slot(0), 1, request(7, 'a'));
  slot(0).number.store(0);  // the first store of a write
  EXPECT_THAT(running_requests(view_), IsEmpty());
  EXPECT_FALSE(running_request(view_, 3, 7));
}

TEST_F(RunningSlotTest, IsNeverReadTorn) {
  show_running(slot(0), 1, request(1, 'a'));
  std::atomic<bool> over{false};
  std::thread writer([&] {
    for (std::uint64_t i = 2; !over; ++i) {
      show_running(slot(0), i, request(i, static_cast<char>('a' + i % 26)));
    }
  });
  for (int read = 0; read < 1000;) {
    for (const RunningRequest& seen : running_requests(view_)) {
      ++read;
      const char text = static_cast<char>(seen.request);
      ASSERT_EQ(seen.progress_text(), std::string(247, text));
      ASSERT_EQ(seen.who_text(), std::string(63, text));
      ASSERT_EQ(seen.since, static_cast<Iteration>(seen.id));
      ASSERT_EQ('a' + (seen.id == 1 ? 0 : seen.id % 26), static_cast<std::uint64_t>(text));
    }
  }
  over = true;
  writer.join();
}

}  // namespace
}  // namespace o80::test
