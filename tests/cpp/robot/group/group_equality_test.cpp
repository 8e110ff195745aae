// A group gives the rows of as many single robots, bit for bit, with any number of threads.

#include <random>
#include <set>

#include "robot/driver/library.hpp"
#include "robot/fake_simulator.hpp"

namespace o80::test {
namespace {

using Bytes = std::vector<std::byte>;

/// How the targets of a burst are reached.
struct Manner {
  std::int64_t each = 3;  // iterations to each target; 1: targets that need no batch
  std::int64_t delay = 0;
  CommandOptions command = {};
};

/// What both sides do in the same way, and all rows of their copies so far. Their bursts take
/// `targets`: for each copy those of its actuators.
class Side {
 public:
  virtual ~Side() = default;
  /// Halts a copy, and resumes it later.
  void halt(std::size_t copy) { frontend(copy).halt("a test"); }
  void resume(std::size_t copy) {
    try {
      frontend(copy).resume(frontend(copy).halted()->number, kPatience);
    } catch (const Error&) {
      said.push_back("braking " + std::to_string(copy));
    }
  }
  bool is_halted(std::size_t copy) { return frontend(copy).halted().has_value(); }
  /// A slow motion that another frontend adds.
  void add(std::size_t copy, double target) {
    test::add(frontend(copy), 1, target, {.pace = iterations(17), .mode = Mode::overwrite});
    frontend(copy).pulse();
  }

  std::vector<Bytes> seen;        // of each copy
  std::vector<std::string> said;  // failures

 protected:
  virtual UntypedFrontend& frontend(std::size_t copy) = 0;
};

constexpr std::uint32_t kSteps = 2;
constexpr std::int64_t kIterations = 6;
constexpr std::size_t kActuators = 2;

class Group final : public Side {
 public:
  Group(const RobotTable& table, const OptionValues& options, std::size_t copies,
        std::size_t threads)
      : group_(table, options,
               {.copies = copies, .threads = threads, .backend = InlineGroup::default_options()}),
        burst_(group_, kActuators, kSteps, kIterations) {
    seen.resize(copies);
    for (std::size_t i = 0; i < copies; ++i) frontends_.push_back(group_.attach(i));
  }
  std::size_t copies() const { return group_.copies(); }
  void burst(const Manner& manner, const std::vector<double>& targets,
             const std::vector<std::uint32_t>& chosen) {
    burst_.plan.command = manner.command;
    burst_.plan.delay = manner.delay;
    burst_.targets = targets;
    std::ranges::fill(burst_.rows, std::byte{0});
    const auto failed = collect([&] { group_.burst(burst_.plan, chosen, kPatience); });
    for (const std::uint32_t copy : chosen) {
      if (failed.contains(copy)) continue;
      const auto rows = burst_.of(copy);
      seen[copy].insert(seen[copy].end(), rows.begin(), rows.end());
    }
  }
  void request(std::uint32_t which, const Bytes& payload,
               const std::vector<std::uint32_t>& chosen) {
    Bytes payloads;
    for (std::size_t i = 0; i < chosen.size(); ++i) {
      payloads.insert(payloads.end(), payload.begin(), payload.end());
    }
    collect([&] { group_.request(which, chosen, payloads, kPatience); });
    for (const std::uint32_t copy : chosen) {
      Bytes row(group_.description().layout.size);
      group_.latest({&copy, 1}, row);
      seen[copy].insert(seen[copy].end(), row.begin(), row.end());
    }
  }

 private:
  /// The copies that failed in a call.
  template <class Call>
  std::set<std::size_t> collect(Call&& call) {
    std::set<std::size_t> copies;
    try {
      call();
    } catch (const CopyFailed& failed) {
      for (const auto& [copy, error] : failed.failures()) {
        said.push_back(std::to_string(copy));
        copies.insert(copy);
      }
    }
    return copies;
  }
  UntypedFrontend& frontend(std::size_t copy) override { return *frontends_[copy]; }

  InlineGroup group_;
  GroupBurst burst_;
  std::vector<std::shared_ptr<UntypedFrontend>> frontends_;
};

class Singles final : public Side {
 public:
  Singles(const RobotTable& table, const OptionValues& robot, std::size_t copies) {
    seen.resize(copies);
    for (std::size_t i = 0; i < copies; ++i) {
      BackendOptions options = InlineGroup::default_options();
      options.segment = "single-" + std::to_string(i);
      robots_.push_back(
          std::make_shared<InlineRobot>(std::make_unique<DriverInstance>(table, robot), options));
      frontends_.push_back(std::make_unique<UntypedFrontend>(robots_[i]->backend(), robots_[i]));
      others_.push_back(std::make_unique<UntypedFrontend>(robots_[i]->backend(), robots_[i]));
    }
  }
  std::size_t copies() const { return robots_.size(); }
  void burst(const Manner& manner, const std::vector<double>& targets,
             const std::vector<std::uint32_t>& chosen) {
    const std::size_t own = targets.size() / copies();
    for (const std::uint32_t copy : chosen) {
      Bytes rows(static_cast<std::size_t>(kIterations) * frontends_[copy]->layout().size);
      const bool done = collect(copy, [&] {
        const std::vector<std::uint32_t> actuators{0, 1};
        const auto states = std::as_bytes(std::span(targets).subspan(copy * own, own));
        if (is_each_iteration(manner.command.pace)) {
          frontends_[copy]->add_set_points(actuators, kSteps, states, manner.command.mode);
        } else {
          frontends_[copy]->add_trajectories(actuators, kSteps, states, manner.command);
        }
        PulseOptions pulse;
        if (manner.delay > 0) pulse.at = frontends_[copy]->published() + 1 + manner.delay;
        frontends_[copy]->burst_rows(rows, kPatience, {}, pulse);
      });
      if (done) seen[copy].insert(seen[copy].end(), rows.begin(), rows.end());
    }
  }
  void request(std::uint32_t which, const Bytes& payload,
               const std::vector<std::uint32_t>& chosen) {
    for (const std::uint32_t copy : chosen) {
      collect(copy, [&] {
        BatchBuilder batch;
        batch.request(static_cast<std::uint16_t>(which), payload);
        const Batch sent = frontends_[copy]->pulse_to_end(batch);
        frontends_[copy]->wait_until_ended(sent, kPatience);
        if (sent.handle(0).status != Status::completed) throw Error(sent.handle(0).text);
      });
      const UntypedObservation row = frontends_[copy]->latest();
      seen[copy].insert(seen[copy].end(), row.bytes(), row.bytes() + row.size());
    }
  }

 private:
  /// True if the call has not failed.
  template <class Call>
  bool collect(std::uint32_t copy, Call&& call) {
    try {
      call();
      return true;
    } catch (const Error&) {
      said.push_back(std::to_string(copy));
      return false;
    }
  }
  UntypedFrontend& frontend(std::size_t copy) override { return *others_[copy]; }

  std::vector<std::shared_ptr<InlineRobot>> robots_;
  std::vector<std::unique_ptr<UntypedFrontend>> frontends_;
  std::vector<std::unique_ptr<UntypedFrontend>> others_;
};

template <class Request>
Bytes payload_of(const Request& request) {
  Bytes bytes(sizeof request);
  pack(request, bytes.data());
  return bytes;
}

/// Bursts of some copies with resets, snapshots, restores, halts and commands of others, as the
/// seed says.
template <class EitherSide>
void play(EitherSide& side, std::uint64_t seed, double largest) {
  std::mt19937_64 random(seed);
  const auto draw = [&](std::uint64_t below) { return random() % below; };
  const auto number = [&] { return largest * (static_cast<double>(draw(2001)) / 1000 - 1); };
  const auto some = [&] {
    std::vector<std::uint32_t> chosen;
    for (std::uint32_t i = 0; i < side.copies(); ++i) {
      if (draw(4) != 0) chosen.push_back(i);
    }
    return chosen;
  };
  for (int round = 0; round < 60; ++round) {
    std::vector<double> targets(side.copies() * kActuators * kSteps);
    for (double& target : targets) target = number();
    Manner manner{.each = draw(4) == 0 ? 3 : 1, .delay = static_cast<std::int64_t>(draw(6))};
    manner.command = {.pace = iterations(manner.each),
                      .mode = draw(2) == 0 ? Mode::queue : Mode::overwrite,
                      .profile = draw(2) == 0 ? Profile::linear : Profile::minimum_jerk,
                      .start = draw(2) == 0 ? Start::desired : Start::observed};
    side.burst(manner, targets, some());
    const std::uint32_t slot = static_cast<std::uint32_t>(draw(3));
    const std::size_t copy = draw(side.copies());
    const double target = number();
    switch (draw(6)) {
      case 0:
        side.request(0, payload_of(Reset{draw(1000)}), some());
        break;
      case 1:
        side.request(1, payload_of(Snapshot{slot}), some());
        break;
      case 2:  // often rejected: nothing was saved in that slot
        side.request(2, payload_of(Restore{slot}), some());
        break;
      case 3:
        side.halt(copy);
        break;
      case 4:
        for (std::size_t i = 0; i < side.copies(); ++i) {
          if (side.is_halted(i)) side.resume(i);
        }
        break;
      default:
        if (!side.is_halted(copy)) side.add(copy, target);
    }
  }
}

class GroupEqualityTest : public ManualBackendTest {
 protected:
  static void expect_equality(const RobotTable& table, double largest,
                              const OptionValues& options = {}) {
    std::size_t failures = 0;
    for (std::uint64_t seed = 1; seed <= 4; ++seed) {
      Singles singles(table, options, 5);
      play(singles, seed, largest);
      failures += singles.said.size();
      for (const std::size_t threads : {1U, 2U, 3U, 7U}) {
        Group group(table, options, 5, threads);
        play(group, seed, largest);
        EXPECT_EQ(group.said, singles.said) << "seed " << seed << ", threads " << threads;
        for (std::size_t copy = 0; copy < 5; ++copy) {
          ASSERT_GT(group.seen[copy].size(), 0U);
          EXPECT_TRUE(group.seen[copy] == singles.seen[copy])
              << "copy " << copy << ", seed " << seed << ", threads " << threads;
        }
      }
    }
    EXPECT_GT(failures, 0U);  // halts and rejected requests were among them
  }
};

// rule G7
TEST_F(GroupEqualityTest, HoldsForRandomRunsOfAPlantWithMemory) { expect_equality(fake(), 40); }

TEST_F(GroupEqualityTest, HoldsForLimitsInterruptsAndActuatorsThatFollow) {
  expect_equality(fake(), 31, {{"guarded", "true"}});
}

TEST_F(GroupEqualityTest, HoldsForTheBundledRobot) {
  static const RobotLibrary library = RobotLibrary::load(kTwoJoints);
  expect_equality(*library.table, 2);
}

}  // namespace
}  // namespace o80::test
