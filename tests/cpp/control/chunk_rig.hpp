#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "control/rig.hpp"
#include "dice.hpp"

namespace o80::test {

/// The worked examples: rows due in 110, 120, 130, 140, 150.
inline const std::vector<double> kRows{0.0, 0.1, 0.3, 0.3, 0.2};
inline constexpr double kDigits = 5e-7;
inline constexpr double kNoLimit = std::numeric_limits<double>::infinity();

inline std::vector<std::uint32_t> every(std::uint32_t step, std::size_t rows) {
  std::vector<std::uint32_t> due;
  for (std::uint32_t i = 1; i <= rows; ++i) due.push_back(i * step);
  return due;
}

/// A robot that runs to an iteration, takes a chunk there, and shows what came of it.
class ChunkRig : public Rig {
 public:
  using Rig::Rig;
  explicit ChunkRig() : Rig(plain_robot(1)) {}

  void run_to(Iteration iteration) {
    while (next < iteration) {
      step();
      rows.resize(static_cast<std::size_t>(next), std::nan(""));
      rows.back() = desired();
    }
  }
  /// Desired in an iteration that was run by run_to().
  double at(Iteration iteration) const { return rows[static_cast<std::size_t>(iteration)]; }
  /// Moves so that the iteration before `now` is at this place, with this speed [1/iteration].
  void reach(Iteration now, double place, double speed) {
    run_to(now - 6);
    if (speed == 0.0) {
      add(0, over(1), {place});
    } else {
      add(0, over(1), {place - 5 * speed});
      pulse();
      step();
      add(0, over(1000), {place + 995 * speed});
    }
    pulse();
    run_to(now);
  }
  /// Sends a chunk for the actuators, each with the same rows; returns the id of its record.
  CommandId chunk(const std::vector<double>& values, const std::vector<std::uint32_t>& due,
                  const ChunkHead& head, Profile profile = Profile::smooth,
                  const std::vector<std::uint32_t>& actuators = {0}, std::uint32_t lane = 0) {
    const std::uint32_t place = add_chunk(values, due, head, profile, actuators);
    return record_id(pulse(lane), place);
  }
  /// Adds it to the batch; returns its place there.
  std::uint32_t add_chunk(const std::vector<double>& values, const std::vector<std::uint32_t>& due,
                          const ChunkHead& head, Profile profile = Profile::smooth,
                          const std::vector<std::uint32_t>& actuators = {0}) {
    const auto bytes = bytes_of(values);
    std::vector<BatchBuilder::Member> members;
    std::vector<const StateLayout*> layouts;
    for (const std::uint32_t actuator : actuators) {
      RecordHead of;
      of.actuator = static_cast<std::uint16_t>(actuator);
      of.profile = profile;
      members.push_back({of, {}, bytes});
      layouts.push_back(&layout);
    }
    return batch.chunk(members, head, due, layouts);
  }
  /// One of the worked examples.
  CommandId example(ChunkHead head, Profile profile = Profile::smooth) {
    if (head.anchor == 0) head.anchor = 100;
    return chunk(kRows, every(10, kRows.size()), head, profile);
  }

  std::vector<double> rows;
  StateLayout layout{schema, schema.actuators[0].type};
};

/// Random scripts of chunks: what was due is shown, nothing that was skipped matters.
class ChunkScript {
 public:
  struct Sent {
    Iteration anchor;
    std::vector<std::uint32_t> due;
    std::vector<double> rows;
    ChunkHead head;
    CommandId id = 0;
    Iteration taken = 0;
  };
  explicit ChunkScript(unsigned seed, double odd = 0.0) : dice_(seed), odd_(odd) {}

  std::vector<double> run(ChunkRig& rig, Iteration last) {
    Iteration at = 1;
    while (at < last) {
      rig.run_to(at);
      if (dice_.one_in(10)) {
        rig.batch.purge(kEveryActuator);
        rig.pulse();
      }
      Sent sent;
      sent.anchor = std::max<Iteration>(0, at - dice_.whole(-5, 40));
      const std::int64_t rows = dice_.whole(1, 40);
      const double step = dice_.one_in(3) ? 50.0 / 3.0 : static_cast<double>(dice_.whole(1, 25));
      for (int i = 1; i <= rows; ++i) {
        sent.due.push_back(
            static_cast<std::uint32_t>(std::floor(static_cast<double>(i) * step + 0.5)));
      }
      double value = rig.desired();
      for (int i = 0; i < rows; ++i) {
        value += dice_.real(-0.1, 0.1);
        sent.rows.push_back(value);
      }
      sent.head.anchor = sent.anchor;
      sent.head.ease = static_cast<std::uint32_t>(dice_.whole(1, 25));
      sent.head.first = static_cast<std::uint32_t>(std::min(dice_.whole(0, 6), rows - 1));
      sent.head.fixed = static_cast<std::uint8_t>(dice_.one_in(4));
      sent.taken = at;
      for (std::size_t i = 0; i < sent.rows.size() && odd_ != 0.0; ++i) {
        // rows that cannot be reached any more
        if (sent.anchor + sent.due[i] < at && sent.head.fixed == 1) sent.rows[i] = odd_;
      }
      sent.id = rig.chunk(sent.rows, sent.due, sent.head);
      all.push_back(sent);
      at += dice_.whole(1, 60);
    }
    rig.run_to(last + 1200);
    return rig.rows;
  }
  std::vector<Sent> all;

 private:
  Dice dice_;
  double odd_;
};

/// [per iteration] at a millisecond.
inline Limits limits_of(double speed, double acceleration, double jerk = kNoLimit) {
  return {.minimum = -10.0,
          .maximum = 10.0,
          .speed = speed,
          .acceleration = acceleration,
          .jerk = jerk};
}

}  // namespace o80::test
