
#include <optional>

#include "runtime/manual_backend.hpp"

namespace o80::test {
namespace {

class WaitForFirstTest : public ManualBackendTest {
 protected:
  std::vector<RowWish> wish(Iteration of_left, Iteration of_right) const {
    return {{&left_, of_left}, {&right_, of_right}};
  }

  BurstingBackend left_manual_{"left"};
  std::optional<BurstingBackend> right_manual_{std::in_place, "right"};
  UntypedFrontend left_{"left"};
  UntypedFrontend right_{"right"};
};

TEST_F(WaitForFirstTest, SaysWhereEachOneStandsAfterATimeout) {
  const std::string said = message_of<TimeoutError>([&] { wait_for_first(wish(1, 2), kAtOnce); });
  EXPECT_THAT(said, HasSubstr("'left' is at row 0 of 1 (it waits for a burst)"));
  EXPECT_THAT(said, HasSubstr("'right' is at row 0 of 2"));
}

TEST_F(WaitForFirstTest, NamesTheBackendThatHasStopped) {
  right_manual_.reset();
  EXPECT_THAT(message_of<BackendStopped>([&] { wait_for_first(wish(1, 1), kPatience); }),
              HasSubstr("'right'"));
  EXPECT_THAT(wait_for_first(wish(0, 1), kPatience), ElementsAre(0));
}

TEST_F(WaitForFirstTest, RefusesNothingAndRowsThatCannotBe) {
  EXPECT_THROW(wait_for_first({}, kAtOnce), InvalidArgument);
  EXPECT_THROW(wait_for_first(wish(0, -1), kAtOnce), InvalidArgument);
}

}  // namespace
}  // namespace o80::test
