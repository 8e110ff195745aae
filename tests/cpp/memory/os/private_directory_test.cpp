#include "memory/private_directory.hpp"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <thread>

#include "memory/segments.hpp"

namespace o80 {
namespace {

/// True as soon as there is no such folder, false after a minute.
bool goes(const std::string& path) {
  for (const Deadline end = patient(); !end.over();) {
    if (!std::filesystem::exists(path)) return true;
    std::this_thread::yield();
  }
  return false;
}

TEST(PrivateDirectoryTest, GoesAlsoIfTheTestIsKilled) {
  int told[2];
  ASSERT_EQ(pipe(told), 0);
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    const PrivateDirectory directory;
    std::ofstream(directory.file_of("arm")) << "rows";
    static_cast<void>(!write(told[1], directory.path().data(), directory.path().size()));
    while (true) pause();
  }
  char path[64] = {};
  ASSERT_GT(read(told[0], path, sizeof path - 1), 0);
  EXPECT_TRUE(std::filesystem::exists(path));
  kill(child, SIGKILL);
  waitpid(child, nullptr, 0);
  EXPECT_TRUE(goes(path));
  close(told[0]);
  close(told[1]);
}

}  // namespace
}  // namespace o80
