#pragma once

#include <poll.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <functional>
#include <stdexcept>
#include <utility>

/// A forked process that runs a function, tells when it is ready, and is killed with its test.
class ChildProcess {
 public:
  /// Ends the child's word to its parent: `ready()` may be called once.
  using Ready = std::function<void()>;

  explicit ChildProcess(const std::function<void(const Ready&)>& body) {
    int pipe_ends[2];
    if (pipe(pipe_ends) != 0) throw std::runtime_error("no pipe");
    pid_ = fork();
    if (pid_ == 0) {
      ::close(pipe_ends[0]);
      int code = 0;
      try {
        body([&] {
          const char byte = 1;
          if (write(pipe_ends[1], &byte, 1) != 1) _exit(3);
        });
      } catch (...) {
        code = 1;
      }
      _exit(code);
    }
    ::close(pipe_ends[1]);
    said_ = pipe_ends[0];
  }
  ChildProcess& operator=(ChildProcess&&) = delete;
  ~ChildProcess() {
    if (pid_ > 0) kill_now();
    ::close(said_);
  }

  pid_t pid() const { return pid_; }
  /// False if it ended without a word.
  bool wait_until_ready() {
    char byte = 0;
    return read(said_, &byte, 1) == 1;
  }
  void kill_now() {
    ::kill(pid_, SIGKILL);
    wait();
  }
  void stop_and_wait_until_stopped() {
    ::kill(pid_, SIGSTOP);
    int status = 0;
    waitpid(pid_, &status, WUNTRACED);
  }
  /// Its exit code, or -1 if a signal ended it.
  int wait() {
    int status = 0;
    waitpid(std::exchange(pid_, -1), &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }

 private:
  pid_t pid_ = -1;
  int said_ = -1;
};

/// Exit code of a forked process that runs `body`, or -1 if a signal ended it.
inline int in_child(const std::function<int()>& body) {
  return ChildProcess([&](const ChildProcess::Ready&) { _exit(body()); }).wait();
}

inline constexpr uid_t kStranger = 65534;  // "nobody"

/// Goes on as another user and group; false if this user may not.
inline bool become_a_stranger() {
  return geteuid() != kStranger && setresgid(kStranger, kStranger, kStranger) == 0 &&
         setresuid(kStranger, kStranger, kStranger) == 0;
}

/// For ever, until killed.
[[noreturn]] inline void pause_for_ever() {
  while (true) pause();
}

/// A ChildProcess that is ready when it has been made.
class ReadyProcess : public ChildProcess {
 public:
  explicit ReadyProcess(const std::function<void(const Ready&)>& body) : ChildProcess(body) {
    if (!wait_until_ready()) throw std::runtime_error("the child process ended without a word");
  }
};

/// A ReadyProcess that does nothing from its `stand()` on.
class StandingProcess : public ReadyProcess {
 public:
  using Stand = std::function<void()>;

  explicit StandingProcess(const std::function<void(const Stand&)>& body)
      : ReadyProcess([&](const Ready& ready) {
          body([&] {
            ready();
            pause_for_ever();
          });
        }) {}
};
