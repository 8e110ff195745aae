// What a service manager (systemd) hears from a robot's process.

#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstddef>
#include <cstdlib>
#include <string>

#include "robot/fake_driver.hpp"

namespace o80::test {
namespace {

/// The service manager's end of the socket that NOTIFY_SOCKET names.
class Manager {
 public:
  explicit Manager(const std::string& path) : path_(path) {
    socket_ = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    path.copy(address.sun_path, sizeof address.sun_path - 1);
    if (path[0] == '@') address.sun_path[0] = 0;
    const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + path.size());
    EXPECT_EQ(bind(socket_, reinterpret_cast<const sockaddr*>(&address), size), 0);
  }
  Manager& operator=(Manager&&) = delete;
  ~Manager() { ::close(socket_); }

  void invite() const { setenv("NOTIFY_SOCKET", path_.c_str(), 1); }
  /// The next message; empty if none comes.
  std::string hears() const {
    pollfd wanted{socket_, POLLIN, 0};
    if (poll(&wanted, 1, 60'000) != 1) return "";
    char text[1024];
    const ssize_t size = recv(socket_, text, sizeof text, 0);
    return {text, static_cast<std::size_t>(size > 0 ? size : 0)};
  }

 private:
  std::string path_;
  int socket_ = -1;
};

class ServiceManagerTest : public ManualBackendTest {
 protected:
  static std::string abstract_name() { return "@o80-test-" + std::to_string(getpid()); }
};

TEST_F(ServiceManagerTest, IsToldWhenTheRobotRunsAndHowItEnds) {
  const Manager manager(abstract_name());
  Program program({kRunProgram, kTwoJoints}, [&] { manager.invite(); });
  ASSERT_TRUE(program.says("runs on segment"));
  EXPECT_THAT(manager.hears(), AllOf(HasSubstr("READY=1"), HasSubstr("STATUS=runs on segment")));
  program.signal(SIGTERM);
  EXPECT_THAT(manager.hears(), AllOf(HasSubstr("STOPPING=1"), HasSubstr("STATUS=stopped")));
  EXPECT_EQ(program.end().code, 0);
}

TEST_F(ServiceManagerTest, IsToldThatTheRobotIsHaltedAndResumed) {
  const Manager manager(abstract_name());
  Program program({kRunProgram, kTwoJoints}, [&] { manager.invite(); });
  ASSERT_TRUE(program.says("runs on segment"));
  EXPECT_THAT(manager.hears(), HasSubstr("READY=1"));
  UntypedFrontend frontend("two_joints");
  const std::uint64_t number = frontend.halt("the ball is on the floor");
  EXPECT_THAT(manager.hears(), AllOf(HasSubstr("STATUS=halted"), HasSubstr("on the floor")));
  frontend.resume(number, kPatience);
  EXPECT_THAT(manager.hears(), HasSubstr("STATUS=resumed"));
}

TEST_F(ServiceManagerTest, HearsOfNoReadinessFromARobotThatCannotStart) {
  const Manager manager(abstract_name());
  Program program({kRunProgram, kTwoJoints, "--reach", "-1"}, [&] { manager.invite(); });
  EXPECT_NE(program.end().code, 0);
  Program other({kRunProgram, kTwoJoints}, [&] { manager.invite(); });
  EXPECT_THAT(manager.hears(), HasSubstr("READY=1")) << "the first message is the second robot's";
}

TEST_F(ServiceManagerTest, ARobotRunsAlthoughItsServiceManagerDoesNotListen) {
  for (const char* path : {"/nowhere/socket", "nonsense", "", "@"}) {
    Program program({kRunProgram, kTwoJoints}, [&] { setenv("NOTIFY_SOCKET", path, 1); });
    EXPECT_TRUE(program.says("runs on segment")) << path;
    program.signal(SIGTERM);
    EXPECT_EQ(program.end().code, 0) << path;
  }
}

}  // namespace
}  // namespace o80::test
