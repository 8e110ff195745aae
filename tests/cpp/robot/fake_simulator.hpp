#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <stdexcept>

#include "o80/robot/make_table.hpp"
#include "o80/robot/plant_requests.hpp"
#include "robot/fake_driver.hpp"
#include "robot/group/inline_group.hpp"

namespace o80::test {

/// A request that runs until it is ended from outside.
struct Dawdle {
  std::uint32_t until = 0;  // iterations; 0: for ever
};
O80_DESCRIBE(Dawdle, until);

/// A simulated plant for groups: no state outside of the object, and an evolution in which every
/// number depends on all that happened before. `guarded`: it has limits of every kind, is halted
/// now and then, its first actuator interrupted; its second one follows when it is idle.
class FakeSimulator {
 public:
  struct Config {
    double start = 0;
    bool guarded = false;
  };
  struct Sensors {
    double sum = 0;
    std::int32_t count = 0;
    std::uint8_t odd = 0;
  };
  using Actuators = std::array<double, 2>;
  using Extended = Sensors;
  using Requests = o80::Requests<Reset, Snapshot, Restore, Dawdle>;

  explicit FakeSimulator(const Config& config) : config_(config) { begin(0); }

  void describe(Schema& schema) const {
    schema.simulated();
    schema.actuator(0).name("left");
    schema.actuator(1).name("right");
    if (!config_.guarded) return;
    schema.actuator(0).limits(
        {.minimum = -30, .maximum = 30, .speed = 20'000, .acceleration = 1e7, .jerk = 4e9});
    schema.actuator(1).limits({.minimum = -31, .maximum = 31}).when_idle(WhenIdle::follow);
  }
  void start() {}
  void write(const Desired<FakeSimulator>& desired) {
    if (desired.states[0] > 100) throw std::runtime_error("left is too far");
    for (std::size_t i = 0; i < 2; ++i) {
      now_.random = now_.random * 6364136223846793005ULL + 1442695040888963407ULL;
      const double noise = static_cast<double>(now_.random >> 40) * 0x1p-24;
      now_.at[i] += 0.3 * (desired.states[i] - now_.at[i]) + 0.01 * noise;
    }
    now_.sensors.sum += now_.at[0] * now_.at[1];
    now_.sensors.odd = static_cast<std::uint8_t>(++now_.sensors.count % 2);
  }
  void read(Reading<FakeSimulator>& reading) {
    reading.observed = now_.at;
    reading.extended = now_.sensors;
    if (dawdles_ != 0 && reading.runs<Dawdle>() && --dawdles_ == 0) {
      reading.ended<Dawdle>(Served::done());
    }
    if (now_.at[1] > 50) reading.halt("right is too far");
    if (!config_.guarded) return;
    if (now_.sensors.count % 7 == 3) reading.interrupt(0);
    if (now_.sensors.count % 31 == 17) reading.halt("it is time for a halt");
  }
  Served on(const Reset& reset) {
    begin(reset.seed);
    return Served::start_afresh();
  }
  Served on(const Snapshot& snapshot) {
    saved_[snapshot.slot] = now_;
    return Served::done();
  }
  Served on(const Restore& restore) {
    const auto found = saved_.find(restore.slot);
    if (found == saved_.end()) return Served::rejected("nothing was saved there");
    now_ = found->second;
    return Served::start_afresh();
  }
  Served on(const Dawdle& dawdle) {
    dawdles_ = dawdle.until;
    return Served::running("dawdles");
  }
  void stop() noexcept {}

 private:
  struct State {
    std::array<double, 2> at{};
    std::uint64_t random = 0;
    Sensors sensors;
  };
  void begin(std::uint64_t seed) {
    now_ = {};
    now_.at = {config_.start, config_.start};
    now_.random = seed;
  }

  Config config_;
  State now_;
  std::map<std::uint32_t, State> saved_;
  std::uint32_t dawdles_ = 0;
};
O80_DESCRIBE(FakeSimulator::Config, start, guarded);
O80_DESCRIBE(FakeSimulator::Sensors, sum, count, odd);

inline const RobotTable& fake() { return *robot_table<FakeSimulator>("fake"); }

/// A group, and memory for its bursts.
class GroupBurst {
 public:
  GroupBurst(InlineGroup& group, std::uint32_t actuators, std::uint32_t steps,
             std::int64_t iterations)
      : group_(group),
        per_copy_(std::size_t{actuators} * steps),
        targets(group.copies() * per_copy_),
        row_(group.description().layout.size),
        rows(group.copies() * static_cast<std::size_t>(iterations) * row_) {
    for (std::uint32_t i = 0; i < actuators; ++i) plan.actuators.push_back(i);
    plan.steps = steps;
    plan.iterations = iterations;
    plan.targets = std::as_writable_bytes(std::span(targets));
    plan.rows = rows;
    for (std::uint32_t i = 0; i < group.copies(); ++i) all.push_back(i);
    group.check(plan);
  }
  double& target(std::size_t copy, std::size_t actuator, std::size_t step = 0) {
    return targets[copy * per_copy_ + actuator * plan.steps + step];
  }
  void run() { group_.burst(plan, all, kPatience); }
  /// The rows of one copy.
  std::span<const std::byte> of(std::size_t copy) const {
    const std::size_t size = rows.size() / group_.copies();
    return std::span(rows).subspan(copy * size, size);
  }
  Iteration last_iteration(std::size_t copy) const {
    return unpack<RowHead>(of(copy).last(row_).data()).iteration;
  }

 private:
  InlineGroup& group_;
  std::size_t per_copy_;

 public:
  std::vector<double> targets;

 private:
  std::size_t row_;

 public:
  std::vector<std::byte> rows;
  std::vector<std::uint32_t> all;
  InlineGroup::BurstPlan plan;
};

}  // namespace o80::test
