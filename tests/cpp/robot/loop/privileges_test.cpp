#include <fcntl.h>
#include <gmock/gmock.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <sstream>

#include "memory/child_process.hpp"
#include "robot/fake_driver.hpp"

namespace o80::test {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr uid_t kNobody = 65534;

/// A copy of o80-run that belongs to root, has the set-user-ID bit, and is started by another user.
class PrivilegedTest : public testing::Test {
 protected:
  void SetUp() override {
#if defined(O80_TEST_SANITIZED) || defined(O80_TEST_EMULATOR)
    GTEST_SKIP() << "a sanitizer and an emulator have loaders of their own";
#endif
    if (geteuid() != 0) GTEST_SKIP() << "only root can make a program of root";
    char name[] = "/tmp/o80-privileges-XXXXXX";
    folder_ = mkdtemp(name);
    fs::permissions(folder_, fs::perms(0755));
    fs::copy(kPrefix + "/bin/o80-run", folder_ / "o80-run");
    fs::permissions(folder_ / "o80-run", fs::perms(04755));
    fs::copy(kTwoJoints, folder_ / "joints.so");
    if (run({"--help"}) != 0) GTEST_SKIP() << "the file system ignores set-user-ID: " << said_;
  }
  ~PrivilegedTest() override {
    if (!folder_.empty()) fs::remove_all(folder_);
  }

  /// The exit code; what was said is in `said_`.
  int run(std::vector<const char*> arguments, std::vector<const char*> environment = {}) {
    const fs::path output = folder_ / "said";
    std::ofstream(output).close();
    const std::string program = folder_ / "o80-run";
    arguments.insert(arguments.begin(), program.c_str());
    arguments.push_back(nullptr);
    environment.push_back(nullptr);
    ChildProcess child([&](const ChildProcess::Ready&) {
      const int file = open(output.c_str(), O_WRONLY);
      dup2(file, STDOUT_FILENO);
      dup2(file, STDERR_FILENO);
      dup2(open("/dev/null", O_RDONLY), STDIN_FILENO);
      if (setgid(kNobody) != 0 || setuid(kNobody) != 0) _exit(99);
      execve(program.c_str(), const_cast<char**>(arguments.data()),
             const_cast<char**>(environment.data()));
      _exit(98);
    });
    const int code = child.wait();
    std::stringstream text;
    text << std::ifstream(output).rdbuf();
    said_ = text.str();
    return code;
  }

  /// Starts the robot of the folder; it ends at once.
  int run_joints(std::vector<const char*> environment = {}) {
    const std::string robot = folder_ / "joints.so";
    const std::string segment = "--segment=privileges-" + std::to_string(getpid());
    return run({robot.c_str(), segment.c_str(), "--bursting", "--until-eof"},
               std::move(environment));
  }

  fs::path folder_;
  std::string said_;
};

TEST_F(PrivilegedTest, LoadOnlyRobotsThatNobodyButRootCanWrite) {
  EXPECT_EQ(run_joints(), 0) << said_;

  fs::permissions(folder_ / "joints.so", fs::perms(0666));
  EXPECT_EQ(run_joints(), 1);
  EXPECT_THAT(said_, HasSubstr("users other than root can write the library"));

  fs::permissions(folder_ / "joints.so", fs::perms(0644));
  ASSERT_EQ(chown((folder_ / "joints.so").c_str(), kNobody, kNobody), 0);
  EXPECT_EQ(run_joints(), 1);
  EXPECT_THAT(said_, HasSubstr("rtprio"));
}

TEST_F(PrivilegedTest, IgnoreTheEnvironment) {
  EXPECT_EQ(run_joints({"O80_DIRECTORY=/nowhere"}), 0) << said_;
  const std::string path = "O80_ROBOT_PATH=" + folder_.string();
  run({}, {path.c_str()});
  EXPECT_THAT(said_, Not(HasSubstr(folder_.string())));
}

}  // namespace
}  // namespace o80::test
