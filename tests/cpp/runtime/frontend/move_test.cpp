#include "o80/runtime/move.hpp"

#include <cmath>
#include <limits>
#include <memory>

#include "runtime/manual_backend.hpp"

namespace o80::test {
namespace {

constexpr std::array<std::uint32_t, 1> kShoulder{0};
constexpr std::array<std::uint32_t, 2> kBoth{0, 1};

template <std::size_t count>
std::span<const std::byte> bytes(const std::array<double, count>& states) {
  return std::as_bytes(std::span(states));
}

class MoveTest : public ManualBackendTest {};

/// The plant of a bursting manual backend follows what is desired with a lag: a half of the way in
/// each iteration.
void lag(ManualBackend& manual) {
  auto place = std::make_shared<std::array<double, 2>>();
  manual.before_publish = [&manual, place] {
    for (std::size_t i = 0; i < 2; ++i) {
      (*place)[i] += 0.5 * (manual.now[i] - (*place)[i]);
      manual.now[i] = (*place)[i];
    }
  };
}

// rule S5
TEST_F(MoveTest, WaitsUntilTheRobotIsObservedAtItsTarget) {
  BurstingBackend bursting("pair", lag);
  UntypedFrontend frontend("pair");
  const UntypedObservation row =
      frontend.move_to(kShoulder, bytes(std::array{1.0}),
                       {.command = {.pace = iterations(2)}, .tolerance = 0.1}, kPatience);
  EXPECT_EQ(desired(row), 1.0);
  EXPECT_LE(std::abs(observed(row) - 1.0), 0.1);
  const UntypedObservation before = frontend.wait_for(row.iteration() - 1, kAtOnce);
  EXPECT_GT(std::abs(observed(before) - 1.0), 0.1) << "it returns the first row that is there";
}

TEST_F(MoveTest, LeavesWhatWasAddedAndNotPulsed) {
  BurstingBackend bursting;
  UntypedFrontend frontend("pair");
  add(frontend, 1, 5.0);
  const UntypedObservation row =
      frontend.move_to(kShoulder, bytes(std::array{1.0}), {.tolerance = 0.0}, kPatience);
  EXPECT_EQ(frontend.added(), 1U);
  EXPECT_EQ(desired(row, 1), 0.0);
}

TEST_F(MoveTest, ThrowsIfItsCommandDoesNotComplete) {
  BurstingBackend bursting("pair", [](ManualBackend& manual) {
    manual.before_publish = [&manual] {
      if (manual.backend.iteration() == 4) manual.backend.interrupt(0);
    };
  });
  UntypedFrontend frontend("pair");
  EXPECT_THAT(message_of<NotCompleted>([&] {
                frontend.move_to(kShoulder, bytes(std::array{1.0}),
                                 {.command = {.pace = iterations(9)}, .tolerance = 9.0}, kPatience);
              }),
              HasSubstr("interrupted"));
}

TEST_F(MoveTest, InRealTimeItWaitsForTheRowsAsTheyCome) {
  auto [manual, frontend] = StartedPair();
  manual.before_publish = [&] {
    if (manual.backend.iteration() < 50) manual.now[0] = 0;  // it begins to move late
  };
  const Move move = frontend.start_move(kShoulder, bytes(std::array{1.0}), {.tolerance = 0.1});
  EXPECT_THAT(message_of<NotReached>([&] { frontend.wait_for_move(move, kAtOnce); }),
              HasSubstr("has not ended and continues"));
  std::thread runner([&] { manual.run(100); });
  const UntypedObservation row = frontend.wait_for_move(move, kPatience);
  EXPECT_EQ(row.iteration(), 50);
  runner.join();
}

TEST_F(MoveTest, AHaltWhileItSettlesEndsIt) {
  auto [manual, frontend] = StartedPair();
  manual.before_publish = [&] { manual.now[0] = 0; };  // it is stuck
  const Move move = frontend.start_move(kShoulder, bytes(std::array{1.0}), {.tolerance = 0.1});
  manual.run(3);
  ASSERT_EQ(move.batch().handle(0).status, Status::completed);
  manual.backend.halt(HaltCause::driver, "it is hot");
  manual.run(1);
  EXPECT_THAT(message_of<BackendHalted>([&] { frontend.wait_for_move(move, kPatience); }),
              HasSubstr("it is hot"));
}

TEST_F(MoveTest, RefusesTolerancesThatDoNotFit) {
  auto [manual, frontend] = StartedPair();
  const auto told = [&](const MoveOptions& options) {
    return message_of<InvalidArgument>(
        [&] { frontend.start_move(kBoth, bytes(std::array{1.0, 2.0}), options); });
  };
  EXPECT_THAT(told({}), HasSubstr("must be given"));
  EXPECT_THAT(told({.tolerance = -1.0}), HasSubstr("not negative"));
  EXPECT_THAT(told({.tolerances = {1.0}}), HasSubstr("'elbow' is missing"));
  EXPECT_THAT(told({.tolerances = {1.0, 1.0, 1.0}}), HasSubstr("3 tolerances for 2 numbers"));
  EXPECT_EQ(frontend.added(), 0U);
}

}  // namespace
}  // namespace o80::test
