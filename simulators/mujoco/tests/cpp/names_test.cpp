#include "engine/names.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace o80::mujoco {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

TEST(Names, AreTheEntriesOfAListWithoutTheSpacesAroundThem) {
  EXPECT_THAT(entries_of("a, b c ,,d=1 2 "), ElementsAre("a", "b c", "d=1 2"));
  EXPECT_THAT(entries_of(" , "), IsEmpty());
  EXPECT_THAT(entries_of(""), IsEmpty());
}

}  // namespace
}  // namespace o80::mujoco
