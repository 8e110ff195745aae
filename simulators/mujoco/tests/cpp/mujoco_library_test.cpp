// The robot library of the simulator, and the MuJoCo library that it loads.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "engine/version.hpp"
#include "memory/private_directory.hpp"
#include "places.hpp"
#include "robot/driver/library.hpp"

namespace o80::mujoco {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

class MujocoLibraryTest : public testing::Test {
 protected:
  PrivateDirectory directory_;
};

TEST_F(MujocoLibraryTest, IsARobotLibraryThatNamesItsMujoco) {
  const RobotLibrary library = RobotLibrary::load(test::kPrefix + "/lib/o80/robots/mujoco.so");

  EXPECT_STREQ(library.table->name, "mujoco");
  EXPECT_THAT(library.table->built_with, HasSubstr(built_with()));
}

TEST_F(MujocoLibraryTest, SaysBothVersionsAndTheCureIfItsMujocoIsNotInstalled) {
  // the robot as if built for another version, laid out as in a wheel
  namespace fs = std::filesystem;
  const fs::path site = directory_.path();
  fs::create_directories(site / "o80/lib/o80/robots");
  fs::create_directories(site / "mujoco");
  std::ofstream(site / "mujoco/libmujoco.so.4.0.1") << "there";
  std::ifstream in(test::kPrefix + "/lib/o80/robots/mujoco.so", std::ios::binary);
  std::string bytes{std::istreambuf_iterator<char>(in), {}};
  const std::string wanted = "libmujoco.so.4.0.1";
  std::size_t replaced = 0;
  for (auto at = bytes.find(wanted); at != std::string::npos; at = bytes.find(wanted, at)) {
    bytes.replace(at, wanted.size(), "libmujoco.so.3.9.0");
    ++replaced;
  }
  ASSERT_GT(replaced, 0u);
  const std::string path = site / "o80/lib/o80/robots/mujoco.so";
  std::ofstream(path, std::ios::binary) << bytes;

  EXPECT_THAT([&] { RobotLibrary::load(path); },
              ThrowsMessage<DriverError>(AllOf(HasSubstr("built for libmujoco.so.3.9.0"),
                                               HasSubstr("installed is libmujoco.so.4.0.1"),
                                               HasSubstr("Install the version it was built for"))));
}

}  // namespace
}  // namespace o80::mujoco
