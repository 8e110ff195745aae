#include "engine/version.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mujoco/mujoco.h>

#include "o80/base/error.hpp"

namespace o80::mujoco {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

TEST(Version, NamesBothVersionsWhenAnotherLibraryIsLoaded) {
  EXPECT_THAT([] { check_version(3'009'000, "3.9.0"); },
              ThrowsMessage<DriverError>(AllOf(HasSubstr("built for MuJoCo 4.0.1"),
                                               HasSubstr("MuJoCo 3.9.0 is loaded"),
                                               HasSubstr("pip install mujoco-core==4.0.1"))));
  EXPECT_NO_THROW(check_version(mj_version(), mj_versionString()));
  EXPECT_STREQ(built_with(), "mujoco 4.0.1");
}

}  // namespace
}  // namespace o80::mujoco
