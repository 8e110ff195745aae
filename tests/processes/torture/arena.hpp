#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "torture/actor.hpp"
#include "torture/judge.hpp"
#include "torture/nursery.hpp"

namespace torture {

/// What a campaign counts.
struct Tally {
  std::map<Role, std::uint64_t> kills_by_role;
  std::map<std::string, std::uint64_t> kills_by_label;
  std::map<std::string, std::uint64_t> stops_by_label;
  std::map<Fault, std::uint64_t> failures;
  std::uint64_t kills = 0;
  std::uint64_t stops = 0;
  std::uint64_t starts = 0;
  std::uint64_t rounds = 0;
  std::uint64_t usurpers = 0;
  std::uint64_t orphans = 0;
  std::uint64_t calls = 0;
  std::uint64_t timeouts = 0;
  std::uint64_t rows = 0;
  std::uint64_t commands = 0;
  HaltCount halts;
  std::vector<std::int64_t> noticed;
  std::vector<std::int64_t> recovered;
};

/// Plays one round after another: starts actors, kills and stops them, and judges.
///
/// Never waits: `work` does what is due.
class Arena {
 public:
  /// Without a nursery there are no actors in Python.
  Arena(std::string directory, Tally& tally, const Nursery* nursery)
      : directory_(std::move(directory)), tally_(tally), nursery_(nursery) {}
  Arena& operator=(Arena&&) = delete;
  ~Arena();

  bool idle() const { return round_ == nullptr; }
  void begin(std::uint64_t seed, const std::string& replay);
  void work(std::int64_t now);
  /// A process has changed its state; false if it is none of this arena.
  bool told(pid_t pid, int status, std::int64_t now);
  /// Ends what is going on, with no verdict.
  void abandon();

 private:
  static constexpr std::int64_t kPatience = 180'000 * kMillisecond;  // with what does not get on

  struct Running {
    Slot* slot;
    bool stopped = false;
    bool killed = false;  // by us
    std::int64_t go_on_at = 0;
    pid_t usurper = 0;  // it stays stopped until that one has tried
  };
  struct Start {
    std::int64_t at;
    Role role;
    std::uint32_t segment;
    std::int64_t follows_kill;
  };

  void begin_phase(Phase phase, std::int64_t now);
  /// Grows as long as any actor gets on; bounded, for journals are.
  std::uint64_t progress_so_far() const;
  bool anybody(Role first, Role last) const;
  void start(const Start& start, std::uint32_t usurped = 0);
  void arm(Slot& slot);
  void adopt();
  [[noreturn]] void act(Slot& slot);
  void strike(std::int64_t now);
  void stop(Running& running, std::int64_t now);
  void go_on(Running& running);
  void kill_one(Running& running, std::int64_t now);
  void start_again(const Slot& slot, std::int64_t now);
  void watch_for_hangs(std::int64_t now);
  void finish();
  void check_directory();
  void fail(Fault fault, const std::string& text);

  std::string directory_;
  Tally& tally_;
  const Nursery* nursery_;
  Round* round_ = nullptr;
  std::string replay_;
  Chance chance_{0};
  std::uint32_t segments_ = 1;
  std::uint32_t actors_ = 0;
  std::map<pid_t, Running> running_;
  std::vector<Slot*> expected_;  // ordered from the nursery
  std::vector<Start> to_start_;
  std::int64_t phase_ends_ = 0;
  std::int64_t worked_ = 0;
  std::uint64_t progress_ = 0;
  std::int64_t next_kill_ = 0;
  std::int64_t next_stop_ = 0;
  std::int64_t looked_ = 0;
  std::int64_t steal_looked_ = 0;
};

}  // namespace torture
