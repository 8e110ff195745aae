// Whom an arena kills or stops, and when.

#include <signal.h>

#include <vector>

#include "torture/arena.hpp"

namespace torture {

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
  running.slot->stops(now);
  ::kill(running.slot->pid, SIGSTOP);
  ++tally_.stops;
  const bool long_one = chance_.percent(25);
  running.go_on_at = now + chance_.between(long_one ? 300 : 5, long_one ? 1100 : 60) * kMillisecond;
  // nobody may take the place of a backend that is only stopped
  const Slot& slot = *running.slot;
  const bool has_its_name = is_backend(slot.role) && round_->lives[slot.generation].epoch != 0;
  if (!long_one || !has_its_name || slot.label_signal == SIGKILL) return;
  start({now, Role::usurper, slot.segment, 0}, slot.generation);
  running.usurper = round_->slots[actors_ - 1].pid;
  ++tally_.usurpers;
}

void Arena::go_on(Running& running) {
  running.stopped = false;
  ::kill(running.slot->pid, SIGCONT);
  // we may have been without a processor until now; who stopped itself tells it itself
  if (running.slot->label_signal != SIGSTOP || running.slot->label_reached == 0)
    running.slot->continued_at(o80::monotonic_now());
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
    if (ends == 0 || running.stopped || running.killed || slot.is_stopped()) continue;
    if (now - ends - slot.stopped_for(now) < kPatience) continue;
    fail(Fault::hang, name_of(slot.role) + " (pid " + std::to_string(pid) + ") is in " +
                          (slot.call != nullptr ? slot.call.load() : "a call") + " since long");
    kill_one(running, now);
  }
}

}  // namespace torture
