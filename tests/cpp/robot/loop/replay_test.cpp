// A replay gives every row of a recorded run bit for bit, and finds the first one that differs.

#include "robot/loop/replay.hpp"

#include <algorithm>
#include <cstring>
#include <random>
#include <set>
#include <thread>

#include "cases.hpp"
#include "robot/fake_driver.hpp"
#include "runtime/replay/driverless_replay.hpp"

namespace o80::test {
namespace {

/// A request that runs until the joints are near 0.
struct GoHome {
  double speed = 0.05;
};
O80_DESCRIBE(GoHome, speed);

/// Two joints that follow with a lag. The driver halts, interrupts, refuses to resume now and then,
/// and serves requests of all kinds.
class Rig {
 public:
  struct Config {
    double bent = 0;  // a change of the driver that acts beyond 0.2
  };
  struct Sensors {
    std::array<double, 2> effort{};
    std::int64_t bends = 0;  // iterations in which the line with `bent` was executed
  };
  using Actuators = std::array<double, 2>;
  using Extended = Sensors;
  using Requests = o80::Requests<Reset, Snapshot, Restore, GoHome>;

  explicit Rig(const Config& config) : config_(config) {}
  void describe(Schema& schema) const {
    schema.simulated();
    schema.actuator(0)
        .name("shoulder")
        .limits({.minimum = -3, .maximum = 3, .speed = 500, .acceleration = 1e6});
    schema.actuator(1).name("elbow").limits({.minimum = -3, .maximum = 3, .error = 2.5});
  }
  void start() {}
  void write(const Desired<Rig>& desired) {
    if (now_.homes) return;
    for (std::size_t i = 0; i < 2; ++i) {
      now_.effort[i] = desired[i] - now_.position[i];
      now_.position[i] += 0.3 * now_.effort[i];
    }
    if (now_.position[0] > 0.2) {
      now_.position[0] += config_.bent;
      ++now_.bends;
    }
  }
  void read(Reading<Rig>& reading) {
    if (now_.homes) home(reading);
    if (reading.fresh()) now_.homes = false;
    const bool goes_below = reading.observed[1] > -1.4 && now_.position[1] <= -1.4;
    if (goes_below && !reading.fresh()) reading.interrupt(1);
    const bool goes_above = reading.observed[1] < 1.8 && now_.position[1] >= 1.8;
    // the text has letters and is longer than what a segment keeps
    if (goes_above && !reading.fresh()) reading.halt("zu groß " + std::string(300, '.'));
    reading.observed = now_.position;
    reading.extended = {now_.effort, now_.bends};
  }
  Served on(const Reset& reset) {
    now_ = {};
    now_.position[0] = static_cast<double>(reset.seed) / 10;
    return Served::start_afresh();
  }
  Served on(const Snapshot&) {
    kept_ = now_;
    return Served::done();
  }
  Served on(const Restore& restore) {
    if (restore.slot > 1) return Served::rejected("there are slots 0 and 1");
    now_ = kept_;
    return Served::start_afresh();
  }
  std::span<const std::byte> snapshot_bytes(std::uint32_t) const {
    return std::as_bytes(std::span(&kept_, 1));
  }
  bool load_snapshot(std::uint32_t, std::span<const std::byte> bytes) {
    kept_ = unpack<State>(bytes.data());
    return bytes.size() == sizeof(State);
  }
  Served on(const GoHome& home) {
    now_.homes = true;
    now_.speed = home.speed;
    return Served::running();
  }
  Served resume() {
    if (++now_.resumes % 3 == 0) return Served::rejected("not ready");
    return Served::done();
  }
  void stop() noexcept {}

 private:
  struct State {
    std::array<double, 2> position{};
    std::array<double, 2> effort{};
    std::int64_t bends = 0;
    double speed = 0;
    int resumes = 0;
    bool homes = false;
  };

  void home(Reading<Rig>& reading) {
    if (!reading.runs<GoHome>()) {  // a halt has ended it
      now_.homes = false;
      return;
    }
    double left = 0;
    for (double& position : now_.position) {
      position -= std::clamp(position, -now_.speed, now_.speed);
      left = std::max(left, std::abs(position));
    }
    if (left < 0.2) reading.ended<GoHome>(Served::start_afresh());
  }

  Config config_;
  State now_;
  State kept_;
};
O80_DESCRIBE(Rig::Config, bent);
O80_DESCRIBE(Rig::Sensors, effort, bends);

const RobotTable& rig_table() { return *robot_table<Rig>("rig"); }

std::unique_ptr<DriverInstance> rig(double bent = 0) {
  return std::make_unique<DriverInstance>(rig_table(),
                                          OptionValues{{"bent", std::to_string(bent)}});
}

BackendOptions options_of(bool bursting, const char* segment = "rig") {
  return {.segment = segment,
          .period = 50'000,
          .bursting = bursting,
          .history = 1U << 16,
          .journal = 1 << 25,
          .stale = Stale::purge,
          .silence = 60};
}

/// What two frontends do at random.
class RandomCommanders {
 public:
  explicit RandomCommanders(unsigned seed) : random_(seed) {}

  unsigned below(unsigned n) { return static_cast<unsigned>(random_() % n); }

  void act() {
    UntypedFrontend& one = frontends_[below(2)];
    try {
      if (one.halted()) {
        // a halted homing leaves the joints to jump back: a reading that some resumes refuse
        const std::uint64_t number = one.halted()->number;
        if (below(3) == 0) one.resume(number, kAtOnce, {}, number % 4 != 0);
      } else if (below(80) == 0) {
        one.halt("now and then");
      } else if (below(12) == 0) {
        control(one);
      } else {
        pulse(one);
      }
    } catch (const Error&) {
      one.forget_added();  // halted, refused, full, or not at rest: all of them belong to the run
    }
  }
  UntypedFrontend& first() { return frontends_[0]; }
  UntypedFrontend& any() { return frontends_[below(2)]; }

 private:
  double target() { return static_cast<double>(below(2000)) / 500.0 - 2; }

  void control(UntypedFrontend& one) {
    if (below(3) == 0) {
      one.add_take_control();
    } else {
      one.add_release_control();
    }
    one.pulse();
  }
  CommandOptions how() {
    CommandOptions options;
    switch (below(5)) {
      case 0:
        options.pace = duration(std::chrono::microseconds(10 + below(900)));
        break;
      case 1:
        options.pace = speed(400);
        break;
      case 2:
        options.pace = until(first().published() + 1 + below(20));
        break;
      case 3:
        options.pace = iterations(1 + below(9));
        break;
      default:
        options.pace = direct(std::chrono::milliseconds(2));
    }
    options.mode = below(3) == 0 ? Mode::overwrite : Mode::queue;
    options.start = below(6) == 0 ? Start::observed : Start::desired;
    return options;
  }
  void pulse(UntypedFrontend& one) {
    for (unsigned i = 0; i <= below(4); ++i) {
      if (below(4) == 0) {
        const std::array<std::uint32_t, 2> both{0, 1};
        const std::array<double, 2> targets{target(), target()};
        one.add_commands(both, std::as_bytes(std::span(targets)), how());
      } else if (below(6) == 0) {
        const std::array<double, 3> rows{target(), target(), target()};
        one.add_trajectory(below(2), 3, std::as_bytes(std::span(rows)),
                           {.pace = iterations(1 + below(4))});
      } else {
        add(one, below(2), target(), how());
      }
      if (below(12) == 0) one.add_purge(below(2));
      if (below(12) == 0) one.add_purge_own();
    }
    if (below(30) == 0) add_request(one, Reset{.seed = below(3)});
    if (below(20) == 0) add_request(one, Snapshot{.slot = 0});
    if (below(20) == 0) add_request(one, Restore{.slot = below(3)});
    if (below(20) == 0) add_request(one, GoHome{});
    PulseOptions options;
    if (below(4) == 0) options.at = one.published() + below(6);
    one.pulse(options);
  }

  std::mt19937 random_;
  std::array<UntypedFrontend, 2> frontends_{UntypedFrontend("rig"), UntypedFrontend("rig")};
};

/// Rows and journal of a run.
struct Recorded {
  Rows rows;
  RowLayout layout;
  Schema schema;
  std::vector<JournalEntry> entries;
  bool bursting = false;

  explicit Recorded(bool in_bursts) : bursting(in_bursts) {
    const UntypedFrontend reader("rig", {.access = Access::read_only, .dead = true});
    rows = reader.history(0, reader.published());
    layout = reader.layout();
    schema = reader.schema();
    Journal journal(reader);
    for (JournalEntry entry; journal.next(entry);) {
      EXPECT_EQ(entry.missed, 0U);
      entries.push_back(std::move(entry));
    }
  }
  RowHead head(std::size_t i) const { return unpack<RowHead>(rows.row(i).data()); }
  std::vector<std::int64_t> times() const {
    std::vector<std::int64_t> times;
    for (std::size_t i = 0; i < rows.count; ++i) times.push_back(head(i).time);
    return times;
  }
  int count(JournalKind kind) const {
    return static_cast<int>(std::ranges::count(entries, kind, &JournalEntry::kind));
  }
};

Recorded record_bursts(unsigned seed, int bursts) {
  Loop loop(rig(), options_of(true));
  loop.start();
  RandomCommanders commanders(seed);
  for (int i = 0; i < bursts; ++i) {
    for (unsigned k = commanders.below(3); k > 0; --k) commanders.act();
    // it is not waited for: it may be rejected, halted or cut
    commanders.any().start_burst(1 + commanders.below(8));
    loop.run_granted(kAll);
  }
  EXPECT_EQ(loop.fault(), "");
  Recorded recorded(true);
  return recorded;
}

Recorded record_in_real_time(unsigned seed, Iteration iterations) {
  Loop loop(rig(), options_of(false));
  loop.start();
  std::thread thread([&] { loop.run(); });
  {
    RandomCommanders commanders(seed);
    Iteration last = 0;
    while (commanders.first().published() < iterations) {
      if (commanders.first().published() == last) {
        std::this_thread::yield();
        continue;
      }
      last = commanders.first().published();
      if (commanders.below(3) == 0) commanders.act();
      // a pause in which the watchdog may find them silent
      if (commanders.below(200) == 0) {
        const Iteration until = last + 100;
        while (commanders.first().published() < until) std::this_thread::yield();
      }
    }
  }
  loop.ask_to_stop();
  thread.join();
  EXPECT_EQ(loop.fault(), "");
  // the segment lives as long as the loop
  Recorded recorded(false);
  return recorded;
}

/// A row without what belongs to the clock.
std::vector<std::byte> comparable(const Recorded& recorded, std::span<const std::byte> row) {
  std::vector<std::byte> bytes(row.begin(), row.end());
  RowHead head = unpack<RowHead>(row.data());
  if (!recorded.bursting) head.lateness = head.overruns = head.skipped = 0;
  std::memcpy(bytes.data(), &head, sizeof head);
  return bytes;
}

/// The first of these rows that a replay has not repeated, or -1.
Iteration first_difference(const Recorded& recorded, std::size_t begin, std::size_t end) {
  const UntypedFrontend reader("replay", {.access = Access::read_only, .dead = true});
  const Rows rows = reader.history(static_cast<Iteration>(begin), reader.published());
  for (std::size_t i = begin; i < end; ++i) {
    if (i - begin < rows.count &&
        comparable(recorded, rows.row(i - begin)) == comparable(recorded, recorded.rows.row(i)))
      continue;
    return static_cast<Iteration>(i);
  }
  return -1;
}

/// The first row that a replay does not repeat, or -1; and what it says about the driver.
struct Verdict {
  Iteration row = -1;
  std::optional<DecisionMismatch> mismatch;
};

Verdict replayed(const Recorded& recorded, double bent = 0) {
  Replay replay(rig(bent), options_of(recorded.bursting, "replay"));
  for (const JournalEntry& entry : recorded.entries) replay.add(entry);
  EXPECT_TRUE(replay.run(recorded.times())) << replay.fault();
  return {first_difference(recorded, 0, recorded.rows.count), replay.mismatch()};
}

/// The first row whose desired states a backend without the driver does not repeat, or -1.
Verdict replayed_without_driver(const Recorded& recorded, std::size_t part = 100) {
  DriverlessReplay replay(recorded.schema, options_of(recorded.bursting, "replay"));
  for (const JournalEntry& entry : recorded.entries) replay.add(entry);
  Verdict verdict;
  for (std::size_t begin = 0; begin < recorded.rows.count;) {
    // no part ends with a fresh start
    std::size_t end = std::min(begin + part, recorded.rows.count);
    while (end < recorded.rows.count && recorded.head(end - 1).fresh != 0) ++end;
    std::vector<std::byte> rows;
    for (std::size_t i = begin; i < end; ++i) {
      const auto row = recorded.rows.row(i);
      rows.insert(rows.end(), row.begin(), row.end());
    }
    EXPECT_TRUE(replay.run(rows)) << replay.fault();
    if (verdict.row < 0) verdict.row = first_difference(recorded, begin, end);
    begin = end;
  }
  verdict.mismatch = replay.mismatch();
  return verdict;
}

std::string text_of(const std::optional<DecisionMismatch>& mismatch) {
  if (!mismatch) return "";
  return std::to_string(mismatch->iteration) + " " + mismatch->decision + ": " +
         mismatch->recorded + " / " + mismatch->replayed;
}

class ReplayTest : public ManualBackendTest, public ::testing::WithParamInterface<unsigned> {};

TEST_P(ReplayTest, BurstsRepeatBitForBit) {
  const Recorded recorded = record_bursts(GetParam(), 500);
  for (const Verdict& verdict : {replayed(recorded), replayed_without_driver(recorded)}) {
    EXPECT_EQ(verdict.row, -1);
    EXPECT_EQ(text_of(verdict.mismatch), "");
  }
  EXPECT_GT(recorded.rows.count, 500U);
  EXPECT_GT(recorded.count(JournalKind::taken), 100);
  EXPECT_GT(recorded.count(JournalKind::fresh_start), 5);
  EXPECT_GT(recorded.count(JournalKind::halt), 0);
  EXPECT_GT(recorded.count(JournalKind::interrupted), 0);
}

// rule O14
TEST_P(ReplayTest, ARunInRealTimeRepeatsBitForBit) {
  const Recorded recorded = record_in_real_time(GetParam(), 3000);
  for (const Verdict& verdict : {replayed(recorded), replayed_without_driver(recorded)}) {
    EXPECT_EQ(verdict.row, -1);
    EXPECT_EQ(text_of(verdict.mismatch), "");
  }
  EXPECT_GT(recorded.count(JournalKind::taken), 0);
}

TEST_P(ReplayTest, AChangedDesiredStateIsFoundWithoutTheDriver) {
  Recorded recorded = record_bursts(GetParam(), 100);
  std::size_t row = recorded.rows.count / 2;
  while (recorded.head(row).fresh != 0) ++row;
  recorded.rows.bytes[row * recorded.rows.row(0).size() + recorded.layout.desired] ^= std::byte{1};
  EXPECT_EQ(replayed_without_driver(recorded).row, static_cast<Iteration>(row));
}

TEST_P(ReplayTest, AChangedDriverIsFoundInTheFirstIterationInWhichTheChangeActs) {
  const Recorded recorded = record_bursts(GetParam(), 300);
  Iteration first = -1;
  for (std::size_t i = 0; i < recorded.rows.count && first < 0; ++i) {
    const auto sensors =
        unpack<Rig::Sensors>(recorded.rows.row(i).data() + recorded.layout.extended);
    if (sensors.bends > 0) first = static_cast<Iteration>(i);
  }
  ASSERT_GT(first, 0) << "the changed line was executed";
  EXPECT_EQ(replayed(recorded, 1e-6).row, first);
}

/// Number of requests that run when this entry is written.
int running_at(const Recorded& recorded, const JournalEntry& until) {
  std::set<std::pair<std::uint32_t, CommandId>> requests;
  std::set<std::pair<std::uint32_t, CommandId>> run;
  for (const JournalEntry& entry : recorded.entries) {
    if (entry.number >= until.number) break;
    for (const JournalRecord& record : entry.records) {
      if (record.kind == JournalRecord::Kind::request) requests.emplace(entry.lane, record.id);
    }
    const std::pair id(entry.lane, entry.id);
    if (entry.kind != JournalKind::status || !requests.contains(id)) continue;
    if (entry.status == Status::active) run.insert(id);
    if (entry.status != Status::active) run.erase(id);
  }
  return static_cast<int>(run.size());
}

/// The entry with the request that caused this fresh start, if a replay can begin with it.
const JournalEntry* start_of(const Recorded& recorded, std::size_t fresh_start) {
  const JournalEntry& fresh = recorded.entries[fresh_start];
  for (std::size_t i = fresh_start; i-- > 0;) {
    const JournalEntry& entry = recorded.entries[i];
    if (entry.kind != JournalKind::taken || entry.lane != fresh.lane) continue;
    const auto serves = [](const JournalRecord& record) {
      return record.kind == JournalRecord::Kind::request;
    };
    const auto first = std::ranges::find_if(entry.records, serves);
    const bool begins = entry.iteration == fresh.iteration && first != entry.records.end() &&
                        (first->request == 0 || first->request == 2);  // reset, restore
    return begins && running_at(recorded, entry) == 0 ? &entry : nullptr;
  }
  return nullptr;
}

// rule B12
TEST_P(ReplayTest, ItBeginsAtAnyResetOrRestoredSnapshot) {
  const Recorded recorded = record_bursts(GetParam(), 500);
  int begun = 0;
  std::vector<std::byte> kept;
  for (std::size_t i = 0; i < recorded.entries.size(); ++i) {
    const JournalEntry& entry = recorded.entries[i];
    if (entry.kind == JournalKind::snapshot) kept = entry.kept;
    if (entry.kind != JournalKind::fresh_start) continue;
    const JournalEntry* start = start_of(recorded, i);
    if (start == nullptr) continue;
    const auto row = static_cast<std::size_t>(start->iteration);
    if (recorded.head(row).halted != 0) continue;

    Replay replay(rig(), options_of(true, "replay"));
    replay.begin_at(start->iteration);
    if (!kept.empty()) replay.load_snapshot(0, kept);
    for (const JournalEntry& each : recorded.entries) {
      if (each.number >= start->number) replay.add(each);
    }
    const std::vector<std::int64_t> times = recorded.times();
    ASSERT_TRUE(replay.run(std::span(times).subspan(row - 1))) << replay.fault();
    EXPECT_EQ(text_of(replay.mismatch()), "") << "from " << row;
    ASSERT_EQ(first_difference(recorded, row, recorded.rows.count), -1) << "from " << row;
    ++begun;
  }
  EXPECT_GT(begun, 3);
}

class HardwareReplayTest : public FakeDriverTest {};

TEST_F(HardwareReplayTest, ARobotThatMayBeHardwareIsNotStarted) {
  FakeDriver::simulated = false;
  try {
    Replay replay(driver(), {.segment = "replay", .bursting = true});
    replay.run(std::array<std::int64_t, 2>{0, 1});
    FAIL() << "it does not declare that it is simulated";
  } catch (const DriverError& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr("robot 'fake' is not started for a replay"));
  }
  EXPECT_EQ(FakeDriver::calls.started, 0);
}

INSTANTIATE_TEST_SUITE_P(Seeds, ReplayTest, ::testing::Range(1U, 1U + cases(8U)));

}  // namespace
}  // namespace o80::test
