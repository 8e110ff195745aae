#include "balls/surface_list.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "o80/base/error.hpp"

namespace o80::mujoco {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

BallOptions options(const std::string& surfaces, const std::string& watched = "") {
  BallOptions options;
  options.surfaces = surfaces;
  options.watched = watched;
  return options;
}

TEST(SurfaceList, GivesEachGeomItsRestitutionOrTheCommonOne) {
  BallOptions three = options("floor, left wall = 0.5, bat=0.7  0.6 0.9", "bat");
  three.restitution = {0.1, 0.2, 0.3};
  const std::vector<SurfaceEntry> surfaces = surfaces_of(three);

  ASSERT_EQ(surfaces.size(), 3u);
  EXPECT_EQ(surfaces[0].geom, "floor");
  EXPECT_EQ(surfaces[0].restitution, (Restitution{0.1, 0.2, 0.3}));
  EXPECT_FALSE(surfaces[0].watched);
  EXPECT_EQ(surfaces[1].geom, "left wall");
  EXPECT_EQ(surfaces[1].restitution, (Restitution{0.5, 0.5, 0.5}));
  EXPECT_EQ(surfaces[2].restitution, (Restitution{0.7, 0.6, 0.9}));
  EXPECT_TRUE(surfaces[2].watched);
  EXPECT_EQ(surfaces[0].friction, kNoSliding);
  EXPECT_TRUE(surfaces_of(options("")).empty());
}

TEST(SurfaceList, TakesAFourthNumberAsTheFriction) {
  const std::vector<SurfaceEntry> surfaces = surfaces_of(options("floor=0.7 0.6 0.9 0.25"));
  EXPECT_EQ(surfaces[0].restitution, (Restitution{0.7, 0.6, 0.9}));
  EXPECT_EQ(surfaces[0].friction, 0.25);
  for (const char* text : {"floor=0.7 0.7 0.7 -0.1", "floor=0.7 0.7 0.7 nan"}) {
    EXPECT_THAT([&] { surfaces_of(options(text)); },
                ThrowsMessage<DriverError>(HasSubstr("friction of 'floor' must not be negative")))
        << text;
  }
}

TEST(SurfaceList, RefusesRestitutionsThatAreNotOneThreeOrFourNumbers) {
  for (const char* text : {"floor=", "floor=0.7 0.7", "floor=0.7 0.7 0.7 0.2 0.1", "floor=bouncy",
                           "floor=0.7x", "floor=0.7;0.7;0.9", "floor=0.5=0.6"}) {
    EXPECT_THAT([&] { surfaces_of(options(text)); },
                ThrowsMessage<DriverError>(AllOf(HasSubstr(std::string("'") + text + "'"),
                                                 HasSubstr("one number after '='"))))
        << text;
  }
  for (const char* text : {"floor=1.5", "floor=0.7 -0.1 0.5", "floor=nan", "floor=inf"}) {
    EXPECT_THAT([&] { surfaces_of(options(text)); },
                ThrowsMessage<DriverError>(HasSubstr("must be shares from 0 to 1")))
        << text;
  }
}

TEST(SurfaceList, RefusesASurfaceThatIsNamedTwice) {
  EXPECT_THAT([] { surfaces_of(options("floor=0.5, wall, floor=0.6")); },
              ThrowsMessage<DriverError>(HasSubstr("names 'floor' twice")));
}

TEST(SurfaceList, AnswersAWatchedSurfaceThatIsNotThereWithTheNearestOne) {
  EXPECT_THAT([] { surfaces_of(options("floor, paddle", "padle")); },
              ThrowsMessage<DriverError>(AllOf(HasSubstr("'padle' is not among the surfaces"),
                                               HasSubstr("Did you mean 'paddle'?"))));
}

}  // namespace
}  // namespace o80::mujoco
