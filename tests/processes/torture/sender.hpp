#pragma once

#include <deque>
#include <functional>
#include <optional>

#include "torture/actor.hpp"

namespace torture {

/// A commanding frontend that writes down what it sends and what it is told.
///
/// Written before a pulse: what is about to be sent. After it: that it was, and its id. At the end:
/// the statuses. So a killed sender leaves what it knew.
class Sender {
 public:
  Sender(Actor& actor, o80::UntypedFrontend frontend);
  ~Sender();
  Sender& operator=(Sender&&) = delete;

  o80::UntypedFrontend& frontend() { return frontend_; }
  Generation& life() const { return life_; }
  bool has_room() const;

  /// Before adding, where another sender of the same actor may have added since.
  void begin() { first_ = actor_.slot.commands; }
  /// Adds one to a few records by chance.
  void add_some();
  /// Sends them; false if they were refused.
  bool pulse(const o80::PulseOptions& options = {});
  /// Sends them with a burst of so many iterations; 0: until they have ended.
  std::optional<o80::Burst> burst(std::int64_t iterations);
  /// The batch sent last.
  const o80::Batch& last() const { return open_.back().batch; }
  SentBatch& entry() { return *open_.back().entry; }

  /// Notes what became of batches that have ended.
  void settle();
  /// The same for all, whether they have ended or not: the sender leaves.
  void settle_all();
  std::size_t open() const { return open_.size(); }
  std::size_t open_commands() const;
  /// It has taken control, if the backend agreed.
  bool controls() const { return controls_; }
  void close();

 private:
  struct Open {
    o80::Batch batch;
    SentBatch* entry;
  };

  SentCommand& note(SentKind kind, std::uint64_t value, std::uint32_t actuator);
  void add_command();
  void add_group();
  void add_trajectory();
  void add_chunk();
  void add_outside();
  bool send(std::int64_t at, bool late_now, std::int64_t burst, bool until_ended,
            const std::function<o80::Batch()>& send);
  void watch_lane();
  void settle(const Open& open);

  Actor& actor_;
  o80::UntypedFrontend frontend_;
  Generation& life_;
  std::deque<Open> open_;
  std::uint32_t first_ = 0;  // command of the batch being made
  std::uint32_t attachment_ = 0;
  bool controls_ = false;
  std::uint32_t lane_ = kNoLane;
};

/// Attaches and serves until the backend has gone, again and again.
///
/// `call_began`: when the last call began, for the judge of a death.
template <class Serve>
void serve_every_backend(Actor& actor, const std::int64_t& call_began, Serve&& serve) {
  while (actor.acting()) {
    if (auto frontend = actor.attach(actor.slot.segment)) {
      Sender sender(actor, std::move(*frontend));
      try {
        serve(sender);
      } catch (const o80::BackendGone& error) {
        actor.judge_gone(sender.life(), error, call_began);
      }
      sender.settle_all();
      sender.close();
    }
    if (actor.slot.batches + 8 >= kMaxBatches || actor.slot.commands + 128 >= kMaxCommands) return;
  }
}

}  // namespace torture
