// The journal tells enough to repeat a run: its batches, given to a new controller at their
// iterations, give the desired states of the rows bit for bit.

#include <gmock/gmock.h>

#include <atomic>
#include <cstring>
#include <random>
#include <thread>

#include "control/queue/controller.hpp"
#include "o80/runtime/journal.hpp"
#include "runtime/station.hpp"

namespace o80::test {
namespace {

void limit(Schema& schema) {
  schema.actuator(0).limits({.minimum = -3, .maximum = 3, .speed = 500, .acceleration = 1e5});
}

/// Random pulses of two frontends, halts and resumes, interrupts and requests.
class RandomRun {
 public:
  RandomRun(Station& station, unsigned seed) : station_(station), random_(seed) {}

  void play(int iterations) {
    for (int i = 0; i < iterations; ++i) {
      for (UntypedFrontend& frontend : frontends_) {
        if (below(3) == 0) pulse(frontend);
      }
      if (below(40) == 0) station_.backend.interrupt(below(2));
      if (below(60) == 0 && !frontends_[0].halted()) frontends_[0].halt("now and then");
      if (frontends_[0].halted() && below(6) == 0) resume();
      ASSERT_EQ(station_.iterate(), Step::run);
    }
  }

 private:
  unsigned below(unsigned n) { return static_cast<unsigned>(random_() % n); }
  double target() { return static_cast<double>(below(2000)) / 500.0 - 2; }

  void pulse(UntypedFrontend& frontend) {
    for (unsigned i = 0; i <= below(4); ++i) {
      CommandOptions options;
      options.pace = below(2) == 0 ? iterations(1 + below(9))
                                   : duration(std::chrono::milliseconds(1 + below(9)));
      if (below(5) == 0) options.pace = speed(40);
      options.mode = below(3) == 0 ? Mode::overwrite : Mode::queue;
      options.start = below(6) == 0 ? Start::observed : Start::desired;
      if (below(4) == 0) {
        const std::array<std::uint32_t, 2> both{0, 1};
        const std::array<double, 2> targets{target(), target()};
        frontend.add_commands(both, std::as_bytes(std::span(targets)), options);
      } else {
        add(frontend, below(2), target(), options);
      }
      if (below(12) == 0) frontend.add_purge(below(2));
      if (below(12) == 0) frontend.add_purge_own();
      if (below(30) == 0) add_request(frontend, Reset{.seed = below(3)});
    }
    PulseOptions options;
    if (below(4) == 0) options.at = station_.last() + 1 + below(5);
    frontend.pulse(options);
  }

  /// Sends what `resume` sends, without its wait.
  void resume() {
    std::thread helper([&] {
      try {
        frontends_[1].resume(frontends_[1].halted()->number, kPatience);
      } catch (const BackendHalted&) {
      }
      done_ = true;
    });
    done_ = false;
    station_.run_until([&] { return done_.load(); });
    helper.join();
  }

  Station& station_;
  std::mt19937 random_;
  std::array<UntypedFrontend, 2> frontends_{UntypedFrontend("pair"), UntypedFrontend("pair")};
  std::atomic<bool> done_{false};
};

/// Obeys the journal, entry by entry, with the observed states of the rows.
class Replay : public StatusSink, public BatchHandler {
 public:
  explicit Replay(const UntypedFrontend& frontend)
      : frontend_(frontend), pool_(1U << 16), controller_(frontend.schema(), pool_, *this, 8) {
    Journal journal(frontend);
    for (JournalEntry entry; journal.next(entry);) {
      EXPECT_EQ(entry.missed, 0U);
      // statuses follow from the decisions
      if (entry.kind != JournalKind::status) decisions_.push_back(entry);
    }
  }
  virtual ~Replay() = default;

  /// The first row whose desired states differ, or -1.
  Iteration first_difference() {
    controller_.restart(row(0).observed(), nullptr, 0);
    keep_observed(0);
    current_ = 1;
    while (next_ < decisions_.size()) {
      const JournalEntry& entry = decisions_[next_++];
      while (current_ < entry.iteration) step();
      obey(entry);
    }
    while (current_ <= frontend_.published()) step();
    return different_;
  }
  int taken() const { return taken_; }
  int fresh_starts() const { return fresh_starts_; }

 private:
  UntypedObservation row(Iteration k) const { return frontend_.wait_for(k, kAtOnce); }
  void keep_observed(Iteration k) {
    const UntypedObservation there = row(k);
    observed_.assign(there.observed(), there.observed() + 16);
  }
  void compare(bool fresh) {
    const UntypedObservation there = row(current_);
    const bool same = std::memcmp(controller_.desired(), there.desired(), 16) == 0 &&
                      (there.head().fresh != 0) == fresh;
    if (!same && different_ < 0) different_ = current_;
  }
  void step() {
    controller_.step(current_, observed_.data());
    controller_.finish_pending();
    compare(false);
    keep_observed(current_++);
  }
  void start_afresh() {
    controller_.restart(row(current_).observed(), nullptr, current_);
    compare(true);
    keep_observed(current_++);
    ++fresh_starts_;
  }
  /// Consumes the next decision if it is of this kind.
  bool follows(JournalKind kind) {
    if (next_ == decisions_.size() || decisions_[next_].kind != kind) return false;
    ++next_;
    return true;
  }

  void obey(const JournalEntry& entry) {
    switch (entry.kind) {
      case JournalKind::taken:
        return take(entry);
      case JournalKind::halt:
        return controller_.halt(entry.iteration);
      case JournalKind::interrupted:
        return controller_.interrupt(entry.actuator, entry.iteration);
      default:
        return;
    }
  }
  void take(const JournalEntry& entry) {
    ASSERT_FALSE(entry.records_lost);
    BlockChain chain;
    for (std::size_t at = 0; at < entry.blocks.size(); at += kBlockBytes) {
      ASSERT_TRUE(pool_.append(chain, entry.blocks.data() + at));
    }
    pool_.batch(chain.first).ticket = entry.ticket;
    controller_.take(entry.lane, chain.first, *this);
    ++taken_;
  }

  // StatusSink, BatchHandler: what they decide is in the journal
  void changed(const StatusChange& /*change*/) noexcept override {}
  void freed(std::uint32_t /*lane*/, std::uint32_t /*blocks*/) noexcept override {}
  Iteration iteration() const noexcept override { return current_; }
  Outcome request(std::uint32_t /*lane*/, CommandId /*id*/, BlockIndex /*record*/,
                  std::uint32_t /*index*/, Cursor /*payload*/) noexcept override {
    if (follows(JournalKind::fresh_start)) start_afresh();
    return {};
  }
  Outcome resume(std::uint32_t /*lane*/, CommandId /*id*/, std::uint64_t /*number*/,
                 bool /*accepts*/) noexcept override {
    if (follows(JournalKind::resume) && follows(JournalKind::fresh_start)) start_afresh();
    return {};
  }
  Outcome take_control(std::uint32_t /*lane*/) noexcept override { return {}; }
  Outcome release_control(std::uint32_t /*lane*/) noexcept override { return {}; }

  const UntypedFrontend& frontend_;
  BlockPool pool_;
  Controller controller_;
  std::vector<JournalEntry> decisions_;
  std::size_t next_ = 0;
  std::vector<std::byte> observed_;
  Iteration current_ = 0;
  Iteration different_ = -1;
  int taken_ = 0;
  int fresh_starts_ = 0;
};

class JournalReplayTest : public StationTest, public ::testing::WithParamInterface<unsigned> {};

TEST_P(JournalReplayTest, TheBatchesOfTheJournalGiveTheSameDesiredStates) {
  Station station({.segment = "pair", .journal = 1 << 24}, limit);
  station.start();
  RandomRun(station, GetParam()).play(600);
  station.run(30);
  const UntypedFrontend reader("pair", {.access = Access::read_only});
  Replay replay(reader);
  EXPECT_EQ(replay.first_difference(), -1);
  EXPECT_GT(replay.taken(), 100);
  EXPECT_GT(replay.fresh_starts(), 0);
}

INSTANTIATE_TEST_SUITE_P(Seeds, JournalReplayTest, ::testing::Range(1U, 13U));

}  // namespace
}  // namespace o80::test
