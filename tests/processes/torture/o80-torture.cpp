// Kills and stops the processes around o80's segments at random and at labelled points, and judges
// whether the promises hold: nothing hangs, nothing tears, nothing is lost.

#include <signal.h>
#include <stdlib.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <list>
#include <map>
#include <optional>
#include <random>
#include <string_view>

#include "torture/arena.hpp"

namespace torture {
namespace {

constexpr std::uint64_t kEveryRound = ~0ULL;

struct Options {
  std::uint64_t kills = 2000;
  std::uint64_t halts = 0;
  std::uint64_t seed = 0;
  std::uint64_t round = kEveryRound;  // only this one, again and again
  std::uint64_t seconds = 0;          // 0: until there are enough kills
  std::uint64_t arenas = 3;
  std::string python{};  // interpreter that has o80; empty: no actors in Python
};

volatile sig_atomic_t interrupted = 0;
void interrupt(int) { interrupted = 1; }

class Campaign {
 public:
  Campaign(const Options& options, const std::string& directory) : options_(options) {
    if (!options.python.empty()) nursery_.emplace(options.python, O80_TORTURE_ACTOR);
    for (std::uint64_t i = 0; i < options.arenas; ++i)
      arenas_.emplace_back(directory + "/" + std::to_string(i), tally_,
                           nursery_ ? &*nursery_ : nullptr);
  }

  int run() {
    // orphans of actors become our children, and are waited for
    prctl(PR_SET_CHILD_SUBREAPER, 1);
    began_ = o80::monotonic_now();
    std::printf("seed %lu\n", static_cast<unsigned long>(options_.seed));
    while (interrupted == 0 && step()) {
    }
    for (Arena& arena : arenas_) arena.abandon();
    nursery_.reset();
    await_orphans();
    return report();
  }

 private:
  bool step() {
    const std::int64_t now = o80::monotonic_now();
    const bool enough = is_done() || failures() >= 20 || late(now);
    bool busy = false;
    for (Arena& arena : arenas_) {
      if (arena.idle() && !enough) begin(arena);
      arena.work(now);
      busy = busy || !arena.idle();
    }
    int status = 0;
    bool told = false;
    while (true) {
      const pid_t pid = waitpid(-1, &status, WNOHANG | WUNTRACED);
      if (pid <= 0) break;
      told = true;
      if (nursery_ && pid == nursery_->pid())
        throw std::runtime_error("the nursery of Python actors ended");
      for (Arena& arena : arenas_)
        if (arena.told(pid, status, o80::monotonic_now())) break;
    }
    if (!told) usleep(1000);
    return busy;
  }

  void begin(Arena& arena) {
    const std::uint64_t round = options_.round != kEveryRound ? options_.round : rounds_++;
    arena.begin(mix(options_.seed, round),
                "round " + std::to_string(round) + ", to be played again with --seed " +
                    std::to_string(options_.seed) + " --round " + std::to_string(round));
  }

  bool is_done() const {
    return tally_.kills >= options_.kills && tally_.halts.requested >= options_.halts;
  }

  bool late(std::int64_t now) const {
    const auto limit = static_cast<std::int64_t>(options_.seconds) * 1000 * kMillisecond;
    return limit > 0 && now - began_ > limit;
  }

  std::uint64_t failures() const {
    std::uint64_t count = 0;
    for (const auto& [fault, n] : tally_.failures) count += n;
    return count;
  }

  void await_orphans() {
    const std::int64_t end = o80::monotonic_now() + 10'000 * kMillisecond;
    while (waitpid(-1, nullptr, WNOHANG) >= 0) {
      if (o80::monotonic_now() > end) {
        ++tally_.failures[Fault::left_over];
        std::printf("FAILED (%s): a process does not end\n", name_of(Fault::left_over).c_str());
        return;
      }
      usleep(1000);
    }
  }

  static void print_times(const char* what, std::vector<std::int64_t>& times) {
    if (times.empty()) return;
    std::sort(times.begin(), times.end());
    const auto at = [&](std::size_t percent) {
      return static_cast<double>(times[(times.size() - 1) * percent / 100]) / 1e6;
    };
    std::printf("%-44s median %6.1f ms   99 %% %6.1f ms   most %6.1f ms   (%zu)\n", what, at(50),
                at(99), at(100), times.size());
  }

  int report() {
    const auto number = [](std::uint64_t n) { return static_cast<unsigned long>(n); };
    std::printf("\nkilled, by actor\n");
    for (const auto& [role, n] : tally_.kills_by_role)
      std::printf("  %-28s %6lu\n", name_of(role).c_str(), number(n));
    std::printf("killed, by crash point\n");
    for (const auto& [label, n] : tally_.kills_by_label)
      std::printf("  %-28s %6lu\n", label.c_str(), number(n));
    std::printf("stopped and continued: %lu, of these at crash points:\n", number(tally_.stops));
    for (const auto& [label, n] : tally_.stops_by_label)
      std::printf("  %-28s %6lu\n", label.c_str(), number(n));
    std::printf(
        "%lu rounds, %lu processes started, %lu second backends refused, %lu children left behind\n"
        "%lu blocking calls measured (%lu timed out), %lu rows verified, %lu commands compared\n",
        number(tally_.rounds), number(tally_.starts), number(tally_.usurpers),
        number(tally_.orphans), number(tally_.calls), number(tally_.timeouts), number(tally_.rows),
        number(tally_.commands));
    const HaltCount& halts = tally_.halts;
    std::printf(
        "%lu halts asked for, %lu of these by who had taken control, %lu more by who was killed "
        "meanwhile; %lu seen by drivers, %lu of these in motion\n"
        "%lu commands and %lu bursts ended by them, %lu resumes, %lu successors of the killed "
        "started halted\n",
        number(halts.requested), number(halts.controlled), number(halts.interrupted),
        number(halts.begun), number(halts.moving), number(halts.commands), number(halts.bursts),
        number(halts.resumed), number(halts.inherited));
    print_times("kill => a waiting frontend raises", tally_.noticed);
    print_times("kill => first row of the next one is seen", tally_.recovered);
    for (std::uint32_t i = 1; i < static_cast<std::uint32_t>(Fault::count); ++i) {
      const auto fault = static_cast<Fault>(i);
      std::printf("%-44s %6lu\n", name_of(fault).c_str(), number(tally_.failures[fault]));
    }
    if (interrupted != 0) std::printf("interrupted\n");
    const bool late_and_short = !is_done() && failures() == 0 && interrupted == 0;
    if (late_and_short)
      std::printf("only %lu of %lu kills and %lu of %lu halts in %lu s\n", number(tally_.kills),
                  number(options_.kills), number(halts.requested), number(options_.halts),
                  number(options_.seconds));
    std::printf("seed %lu, %.0f s\n%lu kills, %lu halts, %lu failures\n", number(options_.seed),
                static_cast<double>(o80::monotonic_now() - began_) / 1e9, number(tally_.kills),
                number(halts.requested), number(failures()));
    return failures() == 0 && !late_and_short && interrupted == 0 ? 0 : 1;
  }

  const Options& options_;
  Tally tally_;
  std::optional<Nursery> nursery_;
  std::list<Arena> arenas_;
  std::uint64_t rounds_ = 0;
  std::int64_t began_ = 0;
};

Options parse(int argc, char** argv) {
  Options options;
  options.seed = std::random_device()() % 1'000'000;
  const std::map<std::string_view, std::uint64_t*> numbers{
      {"--kills", &options.kills},   {"--halts", &options.halts},
      {"--seed", &options.seed},     {"--round", &options.round},
      {"--arenas", &options.arenas}, {"--seconds-limit", &options.seconds}};
  for (int i = 1; i < argc; i += 2) {
    const auto number = numbers.find(argv[i]);
    if (i + 1 < argc && number != numbers.end()) {
      *number->second = std::strtoull(argv[i + 1], nullptr, 10);
    } else if (i + 1 < argc && std::string_view(argv[i]) == "--python") {
      options.python = argv[i + 1];
    } else {
      std::printf(
          "o80-torture [--kills 2000] [--halts 0] [--seed S] [--round R] [--seconds-limit S] "
          "[--arenas 3] [--python INTERPRETER]\n");
      std::exit(2);
    }
  }
  return options;
}

pid_t campaign = 0;
void pass_on(int signal) { kill(campaign, signal); }

/// The campaign runs in a child, so that its folder goes whatever becomes of it.
int guard(const Options& options) {
  char directory[] = "/dev/shm/o80-torture-XXXXXX";
  if (mkdtemp(directory) == nullptr) {
    std::perror("no folder in /dev/shm");
    return 1;
  }
  signal(SIGINT, pass_on);
  signal(SIGTERM, pass_on);
  const pid_t parent = getpid();
  campaign = fork();
  if (campaign == 0) {
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (getppid() != parent) return 1;
    signal(SIGINT, interrupt);
    signal(SIGTERM, interrupt);
    return Campaign(options, directory).run();
  }
  int status = 0;
  while (waitpid(campaign, &status, 0) < 0 && errno == EINTR) {
  }
  std::filesystem::remove_all(directory);
  return WIFEXITED(status) ? WEXITSTATUS(status) : 1;
}

}  // namespace
}  // namespace torture

int main(int argc, char** argv) {
  const torture::Options options = torture::parse(argc, argv);
  return torture::guard(options);
}
