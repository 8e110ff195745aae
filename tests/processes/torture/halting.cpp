#include "torture/halting.hpp"

#include <string>

namespace torture {

namespace {

RequestedHalt* note_halt(Actor& actor, std::uint32_t generation) {
  const std::uint32_t place = actor.slot.halts;
  if (place >= kMaxHalts) return nullptr;
  RequestedHalt& entry = actor.slot.requested_halts[place];
  entry.generation = generation;
  entry.began_at = o80::monotonic_now();
  entry.requested = static_cast<std::uint32_t>(Sent::under_way);
  actor.slot.halts = place + 1;
  return &entry;
}

void answered(RequestedHalt& entry, std::uint64_t number) {
  entry.number = number;
  entry.returned_at = o80::monotonic_now();
  entry.requested = static_cast<std::uint32_t>(Sent::sent);
}

std::uint32_t number_of(Actor& actor, const o80::UntypedFrontend& frontend) {
  return static_cast<std::uint32_t>(&actor.life_of(frontend) - actor.round.lives.data());
}

}  // namespace

void halt(Actor& actor, o80::UntypedFrontend& frontend) {
  RequestedHalt* entry = note_halt(actor, number_of(actor, frontend));
  if (entry == nullptr) return;
  try {
    answered(*entry, actor.timed("halt", std::chrono::nanoseconds(0),
                                 [&] { return frontend.halt("the ball is on the floor"); }));
  } catch (const o80::BackendGone&) {
    entry->requested = static_cast<std::uint32_t>(Sent::refused);
    throw;
  }
}

void halt_by_name(Actor& actor) {
  RequestedHalt* entry = note_halt(actor, kNoGeneration);
  if (entry == nullptr) return;
  const auto timeout = actor.some_timeout();
  try {
    answered(*entry, actor.timed("halt by name", timeout, [&] {
      return o80::halt(segment_name(actor.slot.segment), "from another terminal", timeout);
    }));
  } catch (const o80::TimeoutError&) {
    // nobody is there yet
    entry->requested = static_cast<std::uint32_t>(Sent::refused);
  } catch (const o80::BackendGone&) {
    entry->requested = static_cast<std::uint32_t>(Sent::refused);
  }
}

void resume(Actor& actor, o80::UntypedFrontend& frontend, std::int64_t& call_began) {
  const auto halt = frontend.halted();
  const std::uint32_t place = actor.slot.resumes;
  if (!halt || place >= kMaxResumes) return;
  AskedResume& entry = actor.slot.requested_resumes[place];
  entry.generation = number_of(actor, frontend);
  entry.number = halt->number;
  const bool guesses = actor.chance.percent(10);
  if (guesses) entry.number += actor.chance.percent(50) ? 1 : -1ULL;
  entry.resumed = static_cast<std::uint32_t>(Resumed::unknown);
  actor.slot.resumes = place + 1;
  const auto timeout = actor.some_timeout();
  actor.slot.commanding = 1;
  call_began = o80::monotonic_now();
  try {
    actor.timed("resume", timeout, [&] { frontend.resume(entry.number, timeout); });
    if (!guesses) entry.returned_at = o80::monotonic_now();
    entry.resumed = static_cast<std::uint32_t>(Resumed::done);
  } catch (const o80::TimeoutError&) {
    // it may be taken yet
  } catch (const o80::Error& error) {
    if (dynamic_cast<const o80::BackendHalted*>(&error) == nullptr && !is_refusal(error)) throw;
    entry.resumed = static_cast<std::uint32_t>(Resumed::refused);
  }
}

}  // namespace torture
