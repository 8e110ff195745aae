// How actors of an arena begin, what they do, and how they end.

#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <stdexcept>

#include "base/crash_point.hpp"
#include "torture/arena.hpp"
#include "torture/labels.hpp"

namespace torture {

namespace {

// of the process that is an actor: where it is told of its own crash point
Round* own_round = nullptr;
Slot* own_slot = nullptr;

void before_label() {
  own_slot->label_reached = 1;
  const std::int64_t now = o80::monotonic_now();
  if (own_slot->label_signal == SIGSTOP) {
    own_slot->stops(now);
    return;
  }
  own_slot->doomed_at = now;
  if (is_backend(own_slot->role)) own_round->lives[own_slot->generation].doomed_at = now;
}

void after_label() { own_slot->continued_at(o80::monotonic_now()); }

}  // namespace

void Arena::arm(Slot& slot) {
  const bool as_any_backend = slot.role == Role::bursting_backend && chance_.percent(70);
  const auto labels = labels_of(as_any_backend ? Role::backend : slot.role);
  if (labels.empty() || !chance_.percent(55)) return;
  const Label& label = labels[chance_.below(labels.size())];
  std::snprintf(slot.label, sizeof slot.label, "%s", label.name);
  slot.passages = static_cast<std::uint32_t>(chance_.between(1, label.passages));
  slot.label_signal = chance_.percent(80) ? SIGKILL : SIGSTOP;
}

/// `usurped`: the generation whose name a usurper is to take.
void Arena::start(const Start& start, std::uint32_t usurped) {
  Slot& slot = round_->slots[actors_];
  slot.role = start.role;
  slot.generation = usurped;
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
      case Role::halter:
        be_a_halter(actor);
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
    fail(Fault::crash, name_of(slot.role) + " died of signal " + std::to_string(WTERMSIG(status)));
  } else if (WEXITSTATUS(status) != 0) {
    fail(Fault::crash, name_of(slot.role) + " ended with " + std::to_string(WEXITSTATUS(status)));
  }
  if (is_backend(slot.role)) round_->lives[slot.generation].dead_at = now;
  for (auto& [other, entry] : running_)
    if (entry.usurper == pid) entry.usurper = 0;
  running_.erase(found);
  start_again(slot, now);
  return true;
}

}  // namespace torture
