#pragma once

// What all processes of a round share beside the segments: it outlives every kill, and the judge
// reads it afterwards. Plain words in a file of its own, so that actors in Python can write it too.

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdint>
#include <span>
#include <string>

#include "o80/describe/options.hpp"
#include "torture/robot.hpp"

namespace torture {

inline constexpr std::uint32_t kMaxActors = 384;  // started in a round
inline constexpr std::uint32_t kMaxGenerations = 96;
inline constexpr std::uint32_t kMaxRows = 1U << 13;  // of a generation
inline constexpr std::uint32_t kMaxServed = 4096;
inline constexpr std::uint32_t kMaxBatches = 1024;  // of an actor
inline constexpr std::uint32_t kMaxCommands = 4096;
inline constexpr std::uint32_t kMaxSamples = 4096;
inline constexpr std::uint32_t kMaxHalts = 512;    // asked for by an actor
inline constexpr std::uint32_t kMaxResumes = 512;  // of an actor, of a generation

enum class Phase : std::uint32_t { act, settle, audit, end };

enum class Role : std::uint32_t {
  backend,
  bursting_backend,
  commander,
  burster,
  group_burster,
  halter,
  reader,
  auditor,
  usurper,
  python_commander,
  python_reader,
  count
};
O80_DESCRIBE_ENUM(Role, backend, bursting_backend, commander, burster, group_burster, halter,
                  reader, auditor, usurper, python_commander, python_reader);
constexpr bool is_backend(Role role) {
  return role == Role::backend || role == Role::bursting_backend;
}
constexpr bool is_sender(Role role) {
  return role == Role::commander || role == Role::burster || role == Role::group_burster ||
         role == Role::halter || role == Role::python_commander;
}

/// What went wrong, by kind.
enum class Fault : std::uint32_t {
  none,
  hang,
  wrong_row,
  lost,
  doubled,
  falsely_told,
  false_death,
  unnoticed_death,
  taken_alive,
  bad_error,
  crash,
  halt_broken,
  left_over,
  count
};
O80_DESCRIBE_ENUM(Fault, none, hang, wrong_row, lost, doubled, falsely_told, false_death,
                  unnoticed_death, taken_alive, bad_error, crash, halt_broken, left_over);

template <class Enum>
std::string name_of(Enum value) {
  return o80::describing::option_text(value);
}

/// One iteration as the driver saw it; written before the row is published.
struct JournalRow {
  std::uint64_t digest;
  std::array<double, kActuators> desired;
  std::int64_t at;          // [ns]
  std::int64_t stepped_at;  // [ns], when its step was about to begin
  std::uint64_t halted;     // number of the halt that acted, 0: none
  std::uint32_t active;     // a bit an actuator that a command moves
  std::uint32_t fresh;
};

struct ServedRequest {
  std::uint64_t mark;
  std::int64_t iteration;
};

/// What the driver answered to who resumed.
struct ServedResume {
  std::uint64_t number;  // of the halt that acted
  std::int64_t iteration;
  std::uint32_t granted;
};

/// The life of one backend.
struct Generation {
  std::atomic<std::uint32_t> used;
  std::atomic<std::uint32_t> actor;
  std::atomic<std::uint64_t> epoch;        // of its segment
  std::atomic<std::int64_t> begun_at;      // [ns], as all times here
  std::atomic<std::int64_t> follows_kill;  // when the one before was killed, 0 if it was not
  std::atomic<std::int64_t> first_seen_at;
  std::atomic<std::int64_t> ending_at;  // it begins to end in order
  std::atomic<std::int64_t> doomed_at;  // it is about to be killed
  std::atomic<std::int64_t> dead_at;    // the kernel has taken it down
  std::atomic<std::uint32_t> drained;   // all that was sent must have ended
  std::uint32_t bursting;
  std::uint32_t stops_stale;           // ends when a sender dies
  std::uint32_t limited;               // kLimited has limits of speed and acceleration
  std::uint32_t watches;               // takes control from who is silent
  std::uint32_t ignores_halts;         // of the backend before
  std::atomic<std::uint32_t> failed;   // it ends as failed
  std::atomic<std::uint32_t> usurped;  // when it was dead, a second backend took its name and left
  std::atomic<std::int64_t> rows;
  std::atomic<std::int64_t> steps;  // the iteration whose step was begun last
  std::atomic<std::uint32_t> served;
  std::array<std::atomic<std::uint32_t>, 16> lane_owners;  // actor + 1
  std::array<ServedRequest, kMaxServed> requests;
  std::atomic<std::uint32_t> resumed;
  std::array<ServedResume, kMaxResumes> resumes;
  std::array<JournalRow, kMaxRows> journal;

  /// The rows that its driver saw.
  std::span<const JournalRow> seen() const {
    return {journal.data(), std::min(static_cast<std::size_t>(rows.load()), journal.size())};
  }
};

inline constexpr std::uint32_t kNoLane = 0xFFFFFFFF;

enum class Sent : std::uint32_t { nothing, under_way, sent, refused };

/// What a commander sent, as it saw it.
struct SentBatch {
  std::atomic<std::uint32_t> sent;  // Sent
  std::uint32_t generation;
  std::uint32_t lane;
  std::uint32_t first_command;
  std::uint32_t commands;
  std::uint32_t until_ended;  // a burst until all has ended
  std::uint32_t late_now;
  std::uint32_t attachment;  // of its actor, from 1
  std::uint64_t id;
  std::int64_t at;         // wanted iteration, -1: now
  std::int64_t burst;      // iterations asked for
  std::int64_t taken;      // iteration, -1: not told
  std::int64_t burst_row;  // last row of the burst, -1: not told
  std::int64_t sent_at;    // [ns], when it was out; 0: not told
  std::int64_t seen;       // one more than the row by which it was decided; 0: not told
};

enum class SentKind : std::uint32_t {
  command,
  mark,
  other,
  take_control,
  release_control,
  look,
  group  // one command for all actuators
};

struct SentCommand {
  std::uint64_t value;  // bits of the (last) target, or the mark of a request
  SentKind kind;
  std::uint32_t actuator;
  std::uint32_t told;    // status as its sender saw it at the end, 0: it did not
  std::uint32_t found;   // status as the auditor found it in the segment
  std::int64_t told_at;  // iteration
  std::int64_t found_at;
  std::uint64_t found_id;  // whose status stands in its place
  std::uint32_t found_reason;
  std::uint32_t arrives_early;  // a motion that fades out on its target, before its last iteration
  std::array<std::uint64_t, kActuators> targets;  // of a group: bits of each member's target
};

/// A halt that an actor asked for.
struct RequestedHalt {
  std::atomic<std::uint32_t> requested;  // Sent
  std::uint32_t generation;              // kNoGeneration: by name, of whatever bore it
  std::uint64_t number;
  std::int64_t began_at;     // [ns]
  std::int64_t returned_at;  // [ns]
};
inline constexpr std::uint32_t kNoGeneration = 0xFFFFFFFF;

enum class Resumed : std::uint32_t { nothing, unknown, done, refused };

struct AskedResume {
  std::atomic<std::uint32_t> resumed;  // Resumed
  std::uint32_t generation;
  std::uint64_t number;
  std::int64_t returned_at;  // [ns]; 0: it did not, or the number was a guess
};

/// One started process.
struct Slot {
  std::atomic<std::int32_t> pid;
  Role role;
  std::uint32_t segment;  // which of its arena
  std::uint32_t generation;
  std::uint64_t seed;
  char label[40];  // crash point at which it is to be killed or stopped
  std::int32_t label_signal;
  std::uint32_t passages;
  std::atomic<std::int64_t> doomed_at;
  std::atomic<std::uint32_t> commanding;   // it holds a lane, or may
  std::atomic<std::uint32_t> attachments;  // to command, so far
  std::atomic<std::uint32_t> closed;       // the last of them that began to close
  std::atomic<std::int64_t> stopped;       // [ns] so far; in a stop less its beginning: below 0
  std::atomic<std::uint32_t> label_reached;
  std::atomic<std::int64_t> call_ends;  // when the blocking call under way must be over, 0: none
  std::atomic<const char*> call;
  std::atomic<std::uint32_t> fault;
  char fault_text[600];
  std::atomic<std::uint64_t> calls;  // blocking ones, measured
  std::atomic<std::uint64_t> timeouts;
  std::atomic<std::uint64_t> rows;  // verified
  std::atomic<std::uint64_t> orphans;
  std::atomic<std::uint32_t> batches;
  std::atomic<std::uint32_t> commands;
  std::array<SentBatch, kMaxBatches> sent_batches;
  std::array<SentCommand, kMaxCommands> sent_commands;
  std::atomic<std::uint32_t> halts;
  std::atomic<std::uint32_t> resumes;
  std::atomic<std::uint32_t> bursts_halted;
  std::atomic<std::uint32_t> halted_in_control;
  std::array<RequestedHalt, kMaxHalts> requested_halts;
  std::array<AskedResume, kMaxResumes> requested_resumes;

  std::span<SentBatch> sent() { return {sent_batches.data(), batches}; }
  std::span<const SentBatch> sent() const { return {sent_batches.data(), batches}; }
  std::span<SentCommand> sent_in(const SentBatch& batch) {
    return std::span(sent_commands).subspan(batch.first_command, batch.commands);
  }
  std::span<const SentCommand> sent_in(const SentBatch& batch) const {
    return std::span(sent_commands).subspan(batch.first_command, batch.commands);
  }

  void stops(std::int64_t now) { stopped.fetch_sub(now); }
  void continued_at(std::int64_t now) { stopped.fetch_add(now); }
  bool is_stopped() const { return stopped < 0; }
  /// [ns] until now.
  std::int64_t stopped_for(std::int64_t now) const {
    const std::int64_t all = stopped;
    return all < 0 ? all + now : all;
  }
};

/// Times [ns] that many processes add to.
struct Samples {
  std::atomic<std::uint32_t> count;
  std::array<std::int64_t, kMaxSamples> values;
  void add(std::int64_t value) {
    const std::uint32_t place = count.fetch_add(1);
    if (place < kMaxSamples) values[place] = value;
  }
};

struct Round {
  std::atomic<std::uint32_t> phase;
  std::atomic<std::uint32_t> closing;  // orphans end
  std::uint64_t seed;
  std::atomic<std::int64_t> stolen;  // [ns] that the machine had no processor, as last looked up
  Samples noticed;                   // kill => a waiting frontend raises
  Samples recovered;  // kill => first row of the next backend seen by another process
  std::atomic<std::uint32_t> generations;
  std::array<Generation, kMaxGenerations> lives;
  std::array<Slot, kMaxActors> slots;
};

}  // namespace torture
