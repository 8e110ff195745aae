#include <unistd.h>

#include <filesystem>

#include "robot/fake_driver.hpp"

namespace o80::test {
namespace {

namespace fs = std::filesystem;
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
    const Outcome help = run({"--help"});
    if (help.code != 0) GTEST_SKIP() << "the file system ignores set-user-ID: " << help.err;
  }
  ~PrivilegedTest() override {
    if (!folder_.empty()) fs::remove_all(folder_);
  }

  Outcome run(std::vector<std::string> words, const std::vector<std::string>& environment = {}) {
    words.insert(words.begin(), folder_ / "o80-run");
    Program program(words, [&] {
      clearenv();
      for (const std::string& each : environment) putenv(const_cast<char*>(each.c_str()));
      if (setgid(kNobody) != 0 || setuid(kNobody) != 0) _exit(99);
    });
    program.close_input();
    return program.end();
  }
  /// Starts the robot of the folder; it ends at once.
  Outcome run_joints(const std::vector<std::string>& environment = {}) {
    const std::string segment = "--segment=privileges-" + std::to_string(getpid());
    return run({folder_ / "joints.so", segment, "--bursting", "--until-eof"}, environment);
  }

  fs::path folder_;
};

TEST_F(PrivilegedTest, LoadOnlyRobotsThatNobodyButRootCanWrite) {
  EXPECT_EQ(run_joints().code, 0);
  const auto refusal = [&] {
    const Outcome outcome = run_joints();
    EXPECT_EQ(outcome.code, 1);
    return outcome.err;
  };

  fs::permissions(folder_ / "joints.so", fs::perms(0666));
  EXPECT_THAT(refusal(), HasSubstr("users other than root can write the library"));

  fs::permissions(folder_ / "joints.so", fs::perms(0644));
  ASSERT_EQ(chown((folder_ / "joints.so").c_str(), kNobody, kNobody), 0);
  EXPECT_THAT(refusal(), HasSubstr("rtprio"));
}

TEST_F(PrivilegedTest, IgnoreTheEnvironment) {
  EXPECT_EQ(run_joints({"O80_DIRECTORY=/nowhere"}).code, 0);
  const Outcome outcome = run({}, {"O80_ROBOT_PATH=" + folder_.string()});
  EXPECT_THAT(outcome.out + outcome.err, Not(HasSubstr(folder_.string())));
}

}  // namespace
}  // namespace o80::test
