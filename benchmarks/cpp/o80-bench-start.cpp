// A robot's process: from its start to its first row, and a frontend that attaches to it.
// Arguments: rounds, path of o80-run, path of a robot library.

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>

#include "o80/o80.hpp"
#include "sample.hpp"

namespace o80::bench {
namespace {

/// `o80-run` in a process of its own; stopped with the object.
class RobotProcess {
 public:
  RobotProcess(const std::string& program, const std::string& robot, const std::string& segment) {
    posix_spawn_file_actions_t quiet;
    posix_spawn_file_actions_init(&quiet);
    posix_spawn_file_actions_addopen(&quiet, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
    std::vector<std::string> words{program, robot, "--bursting", "--segment", segment};
    std::vector<char*> arguments;
    for (std::string& word : words) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    if (posix_spawn(&pid_, program.c_str(), &quiet, nullptr, arguments.data(), environ) != 0) {
      std::perror(program.c_str());
      std::exit(1);
    }
    posix_spawn_file_actions_destroy(&quiet);
  }
  ~RobotProcess() {
    kill(pid_, SIGTERM);
    waitpid(pid_, nullptr, 0);
  }

 private:
  pid_t pid_ = 0;
};

void measure(int rounds, const std::string& program, const std::string& robot) {
  const std::string name = segment_name("start");
  for (int round = 0; round < rounds; ++round) {
    const std::int64_t begin = monotonic_now();
    const RobotProcess process(program, robot, name);
    const UntypedFrontend first(name);  // waits for row 0
    sample("backend_ready", "ms", static_cast<double>(monotonic_now() - begin) * 1e-6);
    sample("frontend_attached", "ms", nanoseconds([&] { UntypedFrontend second(name); }) * 1e-6);
  }
}

}  // namespace
}  // namespace o80::bench

int main(int argc, char** argv) {
  if (argc != 4) return 2;
  o80::bench::measure(o80::bench::rounds_of(argc, argv), argv[2], argv[3]);
}
