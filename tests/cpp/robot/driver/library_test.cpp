#include "robot/driver/library.hpp"

#include <sys/stat.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "robot/fake_driver.hpp"

namespace o80::test {
namespace {

namespace fs = std::filesystem;

class LibraryTest : public ManualBackendTest {
 protected:
  ~LibraryTest() override { unsetenv("O80_ROBOT_PATH"); }
};

TEST_F(LibraryTest, LoadsABundledRobotByName) {
  const RobotLibrary library = RobotLibrary::load("two_joints");
  EXPECT_STREQ(library.table->name, "two_joints");
  EXPECT_TRUE(fs::equivalent(library.path, kTwoJoints)) << library.path;
}

TEST_F(LibraryTest, FindsRobotsInThePathFirst) {
  fs::create_directories(directory_.path() + "/a");
  fs::create_directories(directory_.path() + "/b");
  fs::copy(kTwoJoints, directory_.path() + "/a/own.so");
  fs::copy(kTwoJoints, directory_.path() + "/b/two_joints.so");
  setenv("O80_ROBOT_PATH", (directory_.path() + "/a::" + directory_.path() + "/b").c_str(), 1);
  EXPECT_EQ(RobotLibrary::load("own").path, directory_.path() + "/a/own.so");
  EXPECT_EQ(RobotLibrary::load("two_joints").path, directory_.path() + "/b/two_joints.so");
  int seen = 0;
  for (const RobotFile& robot : find_robots()) seen += robot.name == "two_joints" ? 1 : 0;
  EXPECT_EQ(seen, 1) << "the first of a name hides the others";
}

TEST_F(LibraryTest, ListsRobotsOnly) {
  const std::string folder = directory_.path() + "/mixed";
  fs::create_directories(folder);
  fs::copy(kTwoJoints, folder + "/own.so");
  fs::copy(kPrefix + "/lib/libo80.so", folder + "/foreign.so");  // has the name as a text
  fs::create_directory(folder + "/folder.so");
  ASSERT_EQ(mkfifo((folder + "/pipe.so").c_str(), 0600), 0);
  std::ifstream file(kTwoJoints, std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(file), {}};
  for (std::size_t i = 0; i < 40; ++i) {
    std::string broken = bytes.substr(0, bytes.size() * (i + 1) / 41);
    if (i % 2 == 1) {  // whole, with a header that leads anywhere
      broken = bytes;
      broken[42 + i % 6] = static_cast<char>(0xFF);
    }
    std::ofstream(folder + "/broken" + std::to_string(i) + ".so", std::ios::binary) << broken;
  }
  setenv("O80_ROBOT_PATH", folder.c_str(), 1);
  for (const RobotFile& robot : find_robots()) {
    if (fs::path(robot.path).parent_path() == folder) {
      EXPECT_EQ(robot.name, "own");
    }
  }
  EXPECT_EQ(RobotLibrary::load("own").path, folder + "/own.so");
}

TEST_F(LibraryTest, SaysWhatThereIsAndWhereToLook) {
  EXPECT_THAT(
      message_of<DriverError>([] { RobotLibrary::load("three_joints"); }),
      AllOf(HasSubstr("'three_joints'"), HasSubstr("two_joints"), HasSubstr("O80_ROBOT_PATH")));
  EXPECT_THAT(message_of<DriverError>([] { RobotLibrary::load("/nowhere/arm.so"); }),
              HasSubstr("no robot library '/nowhere/arm.so'"));
}

TEST_F(LibraryTest, NamesThePackageOfARobotThatIsInstalledApart) {
  EXPECT_THAT(no_such_robot("pam", {"two_joints"}),
              AllOf(HasSubstr("`pip install o80-pam`"), HasSubstr("O80_ROBOT_PATH")));
  EXPECT_THAT(no_such_robot("mujoco", {"two_joints"}), HasSubstr("`pip install o80-mujoco`"));
}

TEST_F(LibraryTest, NamesTheInstalledVersionOfALibraryThatIsMissing) {
#ifdef O80_TEST_EMULATOR
  GTEST_SKIP() << "the compiler is not emulated";
#endif
  // packages side by side, as in a Python environment: foo has another version than the robot needs
  fs::create_directories(directory_.path() + "/foo");
  fs::create_directories(directory_.path() + "/foo_robot/lib");
  const std::string foo = directory_.path() + "/foo/libfoo.so.1";
  const std::string robot = directory_.path() + "/foo_robot/lib/robot.so";
  const std::string compiler = std::string(O80_TEST_COMPILER) + " -shared -fPIC -x c++ /dev/null ";
  // NOLINTBEGIN(bugprone-command-processor)
  ASSERT_EQ(std::system((compiler + "-Wl,-soname,libfoo.so.1 -o " + foo).c_str()), 0);
  const std::string linked = "-x none -Wl,--no-as-needed " + foo + " -o " + robot;
  ASSERT_EQ(std::system((compiler + linked).c_str()), 0);
  // NOLINTEND(bugprone-command-processor)
  fs::rename(foo, directory_.path() + "/foo/libfoo.so.2");

  EXPECT_THAT(message_of<DriverError>([&] { RobotLibrary::load(robot); }),
              AllOf(HasSubstr("built for libfoo.so.1"), HasSubstr("installed is libfoo.so.2")));
}

TEST_F(LibraryTest, RefusesWhatIsNoRobot) {
  const std::string text = directory_.path() + "/text.so";
  std::ofstream(text) << "no library";
  EXPECT_THAT(message_of<DriverError>([&] { RobotLibrary::load(text); }),
              HasSubstr("cannot be loaded"));
  // a library indeed, but not of a robot
  EXPECT_THAT(message_of<DriverError>([] { RobotLibrary::load(kPrefix + "/lib/libo80.so"); }),
              HasSubstr("have no O80_ROBOT(name, Driver)"));
}

}  // namespace
}  // namespace o80::test
