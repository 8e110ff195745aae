// Many backends want one name at the same moment.

#include <gmock/gmock.h>
#include <sys/mman.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <memory>
#include <new>
#include <optional>
#include <string>
#include <vector>

#include "memory/child_process.hpp"
#include "memory/segments.hpp"
#include "o80/base/error.hpp"

namespace o80 {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr int kStarters = 8;
constexpr int kRounds = 24;

/// What the starters of one round tell; shared by the processes.
struct Round {
  std::atomic<int> ready{0};
  std::atomic<int> begin{0};
  std::atomic<int> ended{0};
  std::atomic<int> winner{0};  // pid
  std::atomic<int> winners{0};
  std::array<std::array<char, 400>, kStarters> refusals{};
};

class StartRaceTest : public SegmentTest {
 protected:
  StartRaceTest() {
    void* memory = mmap(nullptr, sizeof(Round) * kRounds, PROT_READ | PROT_WRITE,
                        MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    rounds_ = static_cast<Round*>(memory);
    for (int i = 0; i < kRounds; ++i) new (&rounds_[i]) Round;
  }
  ~StartRaceTest() override { munmap(rounds_, sizeof(Round) * kRounds); }

  /// All at once, from processes that are there already.
  void race(Round& round) {
    std::vector<std::unique_ptr<ChildProcess>> starters;
    for (int i = 0; i < kStarters; ++i)
      starters.push_back(std::make_unique<ChildProcess>(
          [&round, i](const ChildProcess::Ready&) { start(round, static_cast<std::size_t>(i)); }));
    while (round.ready < kStarters) usleep(100);
    round.begin = 1;
    while (round.ended < kStarters) usleep(100);

    ASSERT_EQ(round.winners, 1);
    for (const auto& refusal : round.refusals) {
      const std::string text = refusal.data();
      if (text == "won") continue;
      EXPECT_THAT(text, AllOf(HasSubstr("'arm' already has a backend (pid " +
                                        std::to_string(round.winner.load())),
                              HasSubstr("o80 stop arm")));
    }
    EXPECT_EQ(attach().header().pid, round.winner);
    EXPECT_EQ(directory_.files(), 2U) << "a loser left a file";
  }

  Round* rounds_ = nullptr;

 private:
  static void start(Round& round, std::size_t index) {
    ++round.ready;
    while (round.begin == 0) usleep(50);
    std::string said = "won";
    try {
      const OwnedSegment segment = running_segment();
      round.winner = getpid();
      ++round.winners;
      tell(round, index, said);
      pause_for_ever();
    } catch (const SegmentTaken& taken) {
      said = taken.what();
    }
    tell(round, index, said);
  }
  static void tell(Round& round, std::size_t index, const std::string& text) {
    text.copy(round.refusals[index].data(), round.refusals[index].size() - 1);
    ++round.ended;
  }
};

TEST_F(StartRaceTest, IsWonByExactlyOneProcessAndTheOthersLearnWhoItIs) {
  std::optional<AttachedSegment> last;
  for (int i = 0; i < kRounds; ++i) {
    race(rounds_[i]);
    if (HasFatalFailure()) return;
    if (last) {
      EXPECT_EQ(last->life(), Life::superseded);
    }
    // the winner was killed with the others: from here on the name is that of a dead one
    last.emplace(AttachedSegment::attach("arm", Access::read_only, patient(), {.dead = true}));
  }
}

}  // namespace
}  // namespace o80
