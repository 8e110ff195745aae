#include "torture/arena.hpp"

#include <fcntl.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <stdexcept>

#include "o80/base/crash_point.hpp"
#include "o80/memory/segment_list.hpp"
#include "torture/labels.hpp"

namespace torture {

namespace {

constexpr std::int64_t kPatience = 180'000 * kMillisecond;  // with what does not get on

Round* map_round(const std::string& path) {
  const int file = open(path.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
  if (file < 0 || ftruncate(file, sizeof(Round)) != 0)
    throw std::runtime_error("no board: " + path);
  void* memory = mmap(nullptr, sizeof(Round), PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
  close(file);
  if (memory == MAP_FAILED) throw std::runtime_error("the board cannot be mapped: " + path);
  return static_cast<Round*>(memory);
}

// of the process that is an actor: where it is told of its own crash point
Round* own_round = nullptr;
Slot* own_slot = nullptr;

void before_label() {
  own_slot->label_reached = 1;
  const std::int64_t now = o80::monotonic_now();
  if (own_slot->label_signal == SIGSTOP) {
    own_slot->stopped_at = now;
    return;
  }
  own_slot->doomed_at = now;
  if (is_backend(own_slot->role)) own_round->lives[own_slot->generation].doomed_at = now;
}

void after_label() {
  own_slot->stopped.fetch_add(o80::monotonic_now() - own_slot->stopped_at.exchange(0));
}

}  // namespace

Arena::~Arena() {
  if (round_ != nullptr) munmap(round_, sizeof(Round));
}

void Arena::fail(Fault fault, const std::string& text) {
  ++tally_.failures[fault];
  std::printf("FAILED (%s): %s\n  in %s\n", name_of(fault), text.c_str(), replay_.c_str());
  std::fflush(stdout);
}

// ------------------------------------------------------------------------------ a round

void Arena::begin(std::uint64_t seed, const std::string& replay) {
  replay_ = replay;
  chance_ = Chance(seed);
  std::filesystem::create_directories(directory_ + "/segments");
  round_ = map_round(directory_ + "/board");
  round_->seed = seed;
  actors_ = 0;
  worked_ = 0;
  running_.clear();
  to_start_.clear();

  const std::int64_t now = o80::monotonic_now();
  const auto add = [&](Role role, std::int64_t count, std::uint32_t segment = 0) {
    for (; count > 0; --count) to_start_.push_back({now, role, segment, 0});
  };
  const std::uint64_t kind = chance_.below(3);
  segments_ = kind == 2 ? 2 : 1;
  add(Role::auditor, 1);
  if (nursery_ != nullptr) {
    add(Role::python_reader, chance_.between(0, 1), segments_ - 1);
    add(Role::python_commander, chance_.between(0, 2));
  }
  if (kind == 0) {
    add(Role::backend, 1);
    add(Role::commander, chance_.between(2, 4));
    add(Role::reader, chance_.between(2, 3));
  } else if (kind == 1) {
    add(Role::bursting_backend, 1);
    add(Role::burster, chance_.between(1, 3));
    add(Role::commander, chance_.between(0, 1));
    add(Role::reader, chance_.between(1, 2));
  } else {
    for (std::uint32_t i = 0; i < 2; ++i) {
      add(Role::bursting_backend, 1, i);
      add(Role::reader, 1, i);
      add(Role::burster, chance_.between(0, 1), i);
    }
    add(Role::group_burster, chance_.between(1, 2));
  }
  next_kill_ = now + chance_.between(20, 100) * kMillisecond;
  next_stop_ = now + chance_.between(20, 300) * kMillisecond;
  begin_phase(Phase::act, now);
}

void Arena::begin_phase(Phase phase, std::int64_t now) {
  const auto former =
      static_cast<std::size_t>(round_->phase.exchange(static_cast<std::uint32_t>(phase)));
  if (phase != Phase::act)
    tally_.longest_phase[former] = std::max(tally_.longest_phase[former], now - phase_began_);
  phase_began_ = now;
  phase_ends_ =
      phase == Phase::act ? now + chance_.between(1500, 3000) * kMillisecond : now + kPatience;
}

/// Takes in who came from the nursery.
void Arena::adopt() {
  std::erase_if(expected_, [&](Slot* slot) {
    if (slot->pid == 0) return false;
    running_.emplace(slot->pid, Running{slot});
    return true;
  });
}

bool Arena::anybody(Role first, Role last) const {
  if (std::any_of(expected_.begin(), expected_.end(),
                  [&](const Slot* slot) { return slot->role >= first && slot->role <= last; }))
    return true;
  return std::any_of(running_.begin(), running_.end(), [&](const auto& entry) {
    return entry.second.slot->role >= first && entry.second.slot->role <= last;
  });
}

std::uint64_t Arena::progress_so_far() const {
  std::uint64_t progress = 0;
  for (std::uint32_t i = 0; i < actors_; ++i)
    progress += round_->slots[i].calls + round_->slots[i].rows;
  for (std::uint32_t i = 0; i < round_->generations; ++i)
    progress += static_cast<std::uint64_t>(round_->lives[i].rows);
  return progress;
}

void Arena::work(std::int64_t now) {
  if (idle()) return;
  // while the conductor had no processor, the others had none either
  const std::int64_t gap = now - worked_;
  if (worked_ != 0 && gap > 100 * kMillisecond) phase_ends_ += gap;
  worked_ = now;
  adopt();
  for (std::size_t i = 0; i < to_start_.size();) {
    if (to_start_[i].at > now) {
      ++i;
      continue;
    }
    const Start due = to_start_[i];
    to_start_.erase(to_start_.begin() + static_cast<std::ptrdiff_t>(i));
    start(due);
  }
  for (auto& [pid, running] : running_)
    if (running.stopped && running.usurper == 0 && now >= running.go_on_at) go_on(running, now);

  const auto phase = static_cast<Phase>(round_->phase.load());
  if (phase == Phase::act) {
    strike(now);
    const bool used_up = actors_ + 16 > kMostActors || round_->generations + 4 > kMostGenerations;
    if (now < phase_ends_ && !used_up) return watch_for_hangs(now);
    to_start_.clear();
    return begin_phase(Phase::settle, now);
  }
  if (now >= phase_ends_) {
    for (const auto& [pid, running] : running_) {
      const char* call = running.slot->call;
      fail(Fault::hang, std::string(name_of(running.slot->role)) + " (pid " + std::to_string(pid) +
                            ") did not come to its end" +
                            (call != nullptr ? std::string("; last call: ") + call : ""));
    }
    return abandon();
  }
  watch_for_hangs(now);
  switch (phase) {
    case Phase::settle:
      if (!anybody(Role::commander, Role::reader) && !anybody(Role::usurper, Role::count))
        begin_phase(Phase::audit, now);
      break;
    case Phase::audit:
      if (!anybody(Role::auditor, Role::auditor)) begin_phase(Phase::end, now);
      break;
    default:
      if (running_.empty() && expected_.empty()) finish();
  }
}

// ------------------------------------------------------------------------------ starting

void Arena::arm(Slot& slot) {
  const auto labels = labels_of(slot.role);
  if (labels.empty() || !chance_.percent(55)) return;
  const Label& label = labels[chance_.below(labels.size())];
  std::snprintf(slot.label, sizeof slot.label, "%s", label.name);
  slot.passages = static_cast<std::uint32_t>(chance_.between(1, label.passages));
  slot.label_signal = chance_.percent(80) ? SIGKILL : SIGSTOP;
}

void Arena::start(const Start& start) {
  Slot& slot = round_->slots[actors_];
  slot.role = start.role;
  slot.segment = start.segment;
  slot.seed = mix(round_->seed, ++actors_);
  arm(slot);
  ++tally_.starts;
  if (is_backend(start.role)) {
    slot.generation = round_->generations.fetch_add(1);
    Generation& life = round_->lives[slot.generation];
    life.actor = actors_ - 1;
    life.follows_kill = start.follows_kill;
    life.begun_at = o80::monotonic_now();
    life.used = 1;
  }
  std::fflush(stdout);
  if (start.role == Role::python_commander || start.role == Role::python_reader) {
    nursery_->order(*round_, slot, directory_);
    expected_.push_back(&slot);
    return;
  }
  const pid_t parent = getpid();
  const pid_t pid = fork();
  if (pid < 0) throw std::runtime_error("cannot fork");
  if (pid == 0) {
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (getppid() != parent) _exit(0);
    act(slot);
  }
  slot.pid = pid;
  running_.emplace(pid, Running{&slot});
}

void Arena::act(Slot& slot) {
  signal(SIGINT, SIG_DFL);
  signal(SIGTERM, SIG_DFL);
  setenv("O80_DIRECTORY", (directory_ + "/segments").c_str(), 1);
  own_round = round_;
  own_slot = &slot;
  o80::CrashPlan& plan = o80::crash_plan();
  plan.label = slot.label;
  plan.passages_left = slot.passages;
  plan.signal = slot.label_signal;
  plan.before = before_label;
  plan.after = after_label;
  Actor actor(*round_, slot, directory_);
  int code = 0;
  try {
    switch (slot.role) {
      case Role::backend:
      case Role::bursting_backend:
        be_a_backend(actor, slot.role == Role::bursting_backend);
        break;
      case Role::commander:
        be_a_commander(actor);
        break;
      case Role::burster:
        be_a_burster(actor);
        break;
      case Role::group_burster:
        be_a_group_burster(actor);
        break;
      case Role::reader:
        be_a_reader(actor);
        break;
      case Role::auditor:
        be_an_auditor(actor, segments_);
        break;
      case Role::usurper:
        be_a_usurper(actor);
        break;
      default:
        break;
    }
  } catch (const Orphan&) {
    // lives on for a while, with all objects of its parent gone
    for (int i = 0; i < 80 && round_->closing == 0; ++i) actor.pause(5 * kMillisecond);
  } catch (const Broken&) {
    code = 1;
  } catch (const std::exception& error) {
    try {
      actor.fail(Fault::bad_error, "%s", error.what());
    } catch (const Broken&) {
      code = 1;
    }
  }
  _exit(code);
}

void Arena::start_again(const Slot& slot, std::int64_t now) {
  if (static_cast<Phase>(round_->phase.load()) != Phase::act || slot.role == Role::auditor ||
      slot.role == Role::usurper)
    return;
  if (!is_backend(slot.role)) {
    to_start_.push_back({now + chance_.between(0, 20) * kMillisecond, slot.role, slot.segment, 0});
    return;
  }
  // a dead one is taken over at once, or found dead by whoever comes
  const bool at_once = chance_.percent(70);
  to_start_.push_back({at_once ? now : now + chance_.between(20, 150) * kMillisecond, slot.role,
                       slot.segment, at_once ? slot.doomed_at.load() : 0});
}

// ------------------------------------------------------------------------------ striking

void Arena::strike(std::int64_t now) {
  std::vector<Running*> candidates;
  for (auto& [pid, running] : running_) {
    const Role role = running.slot->role;
    if (role == Role::auditor || role == Role::usurper || running.killed || running.usurper != 0)
      continue;
    candidates.push_back(&running);
  }
  if (candidates.empty()) return;
  if (now >= next_kill_) {
    next_kill_ = now + chance_.between(5, 75) * kMillisecond;
    kill_one(*candidates[chance_.below(candidates.size())], now);
  }
  if (now >= next_stop_) {
    next_stop_ = now + chance_.between(20, 250) * kMillisecond;
    Running& victim = *candidates[chance_.below(candidates.size())];
    if (!victim.stopped && !victim.killed && victim.slot->label_signal != SIGSTOP)
      stop(victim, now);
  }
}

void Arena::kill_one(Running& running, std::int64_t now) {
  running.killed = true;
  running.slot->doomed_at = now;
  if (is_backend(running.slot->role)) round_->lives[running.slot->generation].doomed_at = now;
  ::kill(running.slot->pid, SIGKILL);
}

void Arena::stop(Running& running, std::int64_t now) {
  running.stopped = true;
  running.slot->stopped_at = now;
  ::kill(running.slot->pid, SIGSTOP);
  ++tally_.stops;
  const bool long_one = chance_.percent(25);
  running.go_on_at = now + chance_.between(long_one ? 300 : 5, long_one ? 1100 : 60) * kMillisecond;
  // nobody may take the place of a backend that is only stopped
  const Slot& slot = *running.slot;
  const bool has_its_name = is_backend(slot.role) && round_->lives[slot.generation].epoch != 0;
  if (!long_one || !has_its_name || slot.label_signal == SIGKILL) return;
  start({now, Role::usurper, slot.segment, 0});
  Slot& usurper = round_->slots[actors_ - 1];
  usurper.generation = slot.generation;
  running.usurper = usurper.pid;
  ++tally_.usurpers;
}

void Arena::go_on(Running& running, std::int64_t now) {
  running.stopped = false;
  const std::int64_t since = running.slot->stopped_at;
  if (running.slot->label_signal != SIGSTOP || running.slot->label_reached == 0) {
    running.slot->stopped.fetch_add(now - since);
    running.slot->stopped_at = 0;
  }
  ::kill(running.slot->pid, SIGCONT);
}

bool Arena::told(pid_t pid, int status, std::int64_t now) {
  if (idle()) return false;
  adopt();
  const auto found = running_.find(pid);
  if (found == running_.end()) return false;
  Running& running = found->second;
  Slot& slot = *running.slot;
  if (WIFSTOPPED(status)) {
    if (slot.label_reached == 0 || running.stopped) return true;
    running.stopped = true;
    running.go_on_at = now + chance_.between(5, 400) * kMillisecond;
    ++tally_.stops;
    ++tally_.stops_by_label[slot.label];
    return true;
  }
  if (WIFCONTINUED(status)) return true;

  if (slot.fault != 0) {
    fail(static_cast<Fault>(slot.fault.load()),
         std::string(slot.fault_text) + " (actor " + std::to_string(&slot - round_->slots.data()) +
             ", " + name_of(slot.role) + ", " + (slot.label[0] != 0 ? slot.label : "no label") +
             ":" + std::to_string(slot.passages) + ")");
  } else if (WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL) {
    ++tally_.kills;
    ++tally_.kills_by_role[slot.role];
    const bool by_label = slot.label_reached != 0 && slot.label_signal == SIGKILL;
    ++tally_.kills_by_label[by_label ? slot.label : "(at random)"];
  } else if (WIFSIGNALED(status)) {
    fail(Fault::crash,
         std::string(name_of(slot.role)) + " died of signal " + std::to_string(WTERMSIG(status)));
  } else if (WEXITSTATUS(status) != 0) {
    fail(Fault::crash,
         std::string(name_of(slot.role)) + " ended with " + std::to_string(WEXITSTATUS(status)));
  }
  if (is_backend(slot.role)) round_->lives[slot.generation].dead_at = now;
  for (auto& [other, entry] : running_)
    if (entry.usurper == pid) entry.usurper = 0;
  running_.erase(found);
  start_again(slot, now);
  return true;
}

/// A call that never returns is not judged by who made it.
void Arena::watch_for_hangs(std::int64_t now) {
  if (now < looked_) return;
  looked_ = now + 100 * kMillisecond;
  // nothing is late that gets on, however slowly
  const std::uint64_t progress = progress_so_far();
  if (progress != progress_ && static_cast<Phase>(round_->phase.load()) != Phase::act)
    phase_ends_ = now + kPatience;
  progress_ = progress;
  for (auto& [pid, running] : running_) {
    Slot& slot = *running.slot;
    const std::int64_t ends = slot.call_ends;
    if (ends == 0 || running.stopped || running.killed || slot.stopped_at != 0) continue;
    if (now - ends - slot.stopped < kPatience) continue;
    fail(Fault::hang, std::string(name_of(slot.role)) + " (pid " + std::to_string(pid) +
                          ") is in " + (slot.call != nullptr ? slot.call.load() : "a call") +
                          " since long");
    kill_one(running, now);
  }
}

// ------------------------------------------------------------------------------ the end

void Arena::check_directory() {
  const std::string segments = directory_ + "/segments";
  setenv("O80_DIRECTORY", segments.c_str(), 1);
  o80::clean_dead();
  for (const auto& entry : std::filesystem::directory_iterator(segments)) {
    fail(Fault::left_over, entry.path().filename().string() + " cannot be cleaned");
    std::filesystem::remove_all(entry.path());
  }
}

void Arena::finish() {
  check_directory();
  for (const Failure& failure : judge(*round_)) fail(failure.fault, failure.text);
  ++tally_.rounds;
  tally_.commands += commands_of(*round_);
  for (std::uint32_t i = 0; i < actors_; ++i) {
    const Slot& slot = round_->slots[i];
    tally_.calls += slot.calls;
    tally_.timeouts += slot.timeouts;
    tally_.rows += slot.rows;
    tally_.orphans += slot.orphans;
  }
  const auto collect = [](const Samples& samples, std::vector<std::int64_t>& into) {
    const std::uint32_t count = std::min(samples.count.load(), kMostSamples);
    into.insert(into.end(), samples.values.begin(), samples.values.begin() + count);
  };
  collect(round_->noticed, tally_.noticed);
  collect(round_->recovered, tally_.recovered);
  abandon();
}

void Arena::abandon() {
  if (idle()) return;
  round_->closing = 1;
  adopt();
  expected_.clear();
  for (const auto& [pid, running] : running_) {
    ::kill(pid, SIGKILL);
    waitpid(pid, nullptr, 0);
  }
  running_.clear();
  to_start_.clear();
  munmap(round_, sizeof(Round));
  round_ = nullptr;
  std::filesystem::remove_all(directory_);
}

}  // namespace torture
