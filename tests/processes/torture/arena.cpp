#include "torture/arena.hpp"

#include <fcntl.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <stdexcept>

#include "o80/memory/segment_list.hpp"

namespace torture {

namespace {

Round* map_round(const std::string& path) {
  const int file = open(path.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
  if (file < 0 || ftruncate(file, sizeof(Round)) != 0)
    throw std::runtime_error("no board: " + path);
  void* memory = mmap(nullptr, sizeof(Round), PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
  close(file);
  if (memory == MAP_FAILED) throw std::runtime_error("the board cannot be mapped: " + path);
  return static_cast<Round*>(memory);
}

}  // namespace

Arena::~Arena() {
  if (round_ != nullptr) munmap(round_, sizeof(Round));
}

void Arena::fail(Fault fault, const std::string& text) {
  ++tally_.failures[fault];
  std::printf("FAILED (%s): %s\n  in %s\n", name_of(fault).c_str(), text.c_str(), replay_.c_str());
  std::fflush(stdout);
}

// ------------------------------------------------------------------------------ a round

void Arena::begin(std::uint64_t seed, const std::string& replay) {
  replay_ = replay;
  chance_ = Chance(seed);
  std::filesystem::create_directories(directory_ + "/segments");
  round_ = map_round(directory_ + "/board");
  round_->seed = seed;
  round_->stolen = stolen_time();
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
  for (std::uint32_t i = 0; i < segments_; ++i)
    if (chance_.percent(60)) add(Role::halter, chance_.between(1, 2), i);
  next_kill_ = now + chance_.between(20, 100) * kMillisecond;
  next_stop_ = now + chance_.between(20, 300) * kMillisecond;
  begin_phase(Phase::act, now);
}

void Arena::begin_phase(Phase phase, std::int64_t now) {
  round_->phase = static_cast<std::uint32_t>(phase);
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
  if (now - steal_looked_ > 20 * kMillisecond) {
    steal_looked_ = now;
    round_->stolen = stolen_time();
  }
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
    if (running.stopped && running.usurper == 0 && now >= running.go_on_at) go_on(running);

  const auto phase = static_cast<Phase>(round_->phase.load());
  if (phase == Phase::act) {
    strike(now);
    const bool used_up = actors_ + 16 > kMaxActors || round_->generations + 4 > kMaxGenerations;
    if (now < phase_ends_ && !used_up) return watch_for_hangs(now);
    to_start_.clear();
    return begin_phase(Phase::settle, now);
  }
  if (now >= phase_ends_) {
    for (const auto& [pid, running] : running_) {
      const char* call = running.slot->call;
      fail(Fault::hang, name_of(running.slot->role) + " (pid " + std::to_string(pid) +
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
  count_halts(*round_, tally_.halts);
  for (std::uint32_t i = 0; i < actors_; ++i) {
    const Slot& slot = round_->slots[i];
    tally_.calls += slot.calls;
    tally_.timeouts += slot.timeouts;
    tally_.rows += slot.rows;
    tally_.orphans += slot.orphans;
  }
  const auto collect = [](const Samples& samples, std::vector<std::int64_t>& into) {
    const std::uint32_t count = std::min(samples.count.load(), kMaxSamples);
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
