#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <map>
#include <span>
#include <utility>
#include <vector>

#include "control/batch/record.hpp"
#include "control/queue/controller.hpp"
#include "control/receiving/pool.hpp"
#include "control/sending/batch_builder.hpp"
#include "o80/describe/schema.hpp"

namespace o80::test {

inline constexpr std::int64_t kMillisecond = 1'000'000;

/// Pace of a command, ready to be added.
inline RecordHead paced(Pace pace, std::int64_t amount) {
  RecordHead head;
  head.pace = pace;
  head.amount = amount;
  return head;
}
inline RecordHead direct() { return paced(Pace::direct, 0); }
inline RecordHead over(std::int64_t iterations) { return paced(Pace::iterations, iterations); }
inline RecordHead during(std::int64_t duration) { return paced(Pace::duration, duration); }
inline RecordHead until(Iteration iteration) { return paced(Pace::until, iteration); }
inline RecordHead at_speed(double speed) {
  RecordHead head;
  head.pace = Pace::speed;
  head.speed = speed;
  return head;
}
inline RecordHead overwriting(RecordHead head) {
  head.mode = Mode::overwrite;
  return head;
}
inline RecordHead smoothly(RecordHead head) {
  head.profile = Profile::minimum_jerk;
  return head;
}
inline RecordHead from_observed(RecordHead head) {
  head.start = Start::observed;
  return head;
}

template <class T>
std::vector<std::byte> bytes_of(const std::vector<T>& values) {
  std::vector<std::byte> bytes(values.size() * sizeof(T));
  if (!bytes.empty()) std::memcpy(bytes.data(), values.data(), bytes.size());
  return bytes;
}
template <class T>
std::vector<std::byte> bytes_of_one(const T& value) {
  return bytes_of(std::vector<T>{value});
}

/// A robot of `actuators` of one type, iterating every millisecond.
inline Schema robot_of(std::vector<FieldRow> fields, std::uint32_t actuators = 1,
                       const char* type = "State") {
  Schema schema;
  schema.head.robot = NameText("robot");
  schema.head.period = kMillisecond;
  schema.add_actuators("joint", schema.add_type(type, std::move(fields)), actuators);
  return schema;
}
/// One of doubles, `numbers` in each actuator.
inline Schema plain_robot(std::uint32_t actuators, std::uint32_t numbers = 1) {
  std::vector<FieldRow> fields;
  for (std::uint32_t i = 0; i < numbers; ++i) {
    fields.push_back(scalar_field(numbers == 1 ? "" : "x" + std::to_string(i), Kind::float64));
  }
  return robot_of(std::move(fields), actuators, numbers == 1 ? "float64" : "State");
}
inline Schema limited_robot(const Limits& limits) {
  Schema schema = plain_robot(1);
  schema.actuator(0).limits(limits);
  return schema;
}

/// Changes what stands at the beginning of a block.
template <class T, class Change>
void edit(Block& block, Change&& change) {
  T value;
  std::memcpy(&value, block.bytes.data(), sizeof value);
  change(value);
  std::memcpy(block.bytes.data(), &value, sizeof value);
}

/// Everything the controller told, and whether it told it properly.
class Witness : public StatusSink {
 public:
  void changed(const StatusChange& change) noexcept override {
    if (keep) changes.push_back(change);
    if (!keep) ++told;
  }
  void freed(std::uint32_t lane, std::uint32_t blocks) noexcept override {
    freed_blocks[lane] += blocks;
  }
  /// Changes of one record or batch, in order.
  std::vector<StatusChange> of(CommandId id, std::uint32_t lane = 0) const {
    std::vector<StatusChange> found;
    for (const StatusChange& change : changes) {
      if (change.lane == lane && change.id == id) found.push_back(change);
    }
    return found;
  }
  std::size_t ends_of(CommandId id, std::uint32_t lane = 0) const {
    std::size_t ends = 0;
    for (const StatusChange& change : of(id, lane)) ends += is_end(change.status) ? 1 : 0;
    return ends;
  }
  /// The last change, or none.
  StatusChange last(CommandId id, std::uint32_t lane = 0) const {
    const auto found = of(id, lane);
    return found.empty() ? StatusChange{} : found.back();
  }
  Status status(CommandId id, std::uint32_t lane = 0) const { return last(id, lane).status; }

  std::vector<StatusChange> changes;
  std::array<std::uint64_t, 8> freed_blocks{};  // of each lane
  bool keep = true;
  std::size_t told = 0;
};

/// A controller with all it needs, driven by hand: add, pulse, run.
class Rig : public BatchHandler {
 public:
  explicit Rig(Schema robot, std::uint32_t blocks = 4096)
      : schema(std::move(robot)), pool(blocks), controller(schema, pool, witness) {
    observed.resize(schema.head.block + 8);
    controller.restart(observed.data(), nullptr, 0);
  }

  /// Adds a command of doubles to the batch being built; gives its place there.
  std::uint32_t add(std::uint32_t actuator, RecordHead head, const std::vector<double>& target) {
    head.actuator = static_cast<std::uint16_t>(actuator);
    return batch.command(head, bytes_of(target));
  }
  /// Adds a trajectory; `times` is empty or one end a row.
  std::uint32_t add_rows(std::uint32_t actuator, RecordHead head, std::uint32_t rows,
                         const std::vector<double>& targets,
                         const std::vector<std::int64_t>& times = {},
                         const std::vector<std::uint64_t>& mask = {}) {
    head.actuator = static_cast<std::uint16_t>(actuator);
    return batch.command(head, mask, times, rows, bytes_of(targets));
  }

  /// Puts the batch being built into the pool; gives its place there and sets `sent`.
  BlockIndex send(std::uint32_t lane = 0) {
    BatchRecord record;
    CommandId& used = used_ids[lane];
    record.id = sent = used + 1;
    used += 2 + batch.records();
    const BlockIndex first = place(batch.seal(record));
    batch.clear();
    return first;
  }
  /// The batch being built, for tests that spoil its blocks before they place them.
  std::vector<Block> sealed(CommandId id = 1) {
    BatchRecord record;
    record.id = id;
    const auto blocks = batch.seal(record);
    return {blocks.begin(), blocks.end()};
  }
  BlockIndex place(std::span<const Block> blocks) {
    BlockChain chain;
    for (const Block& block : blocks) {
      if (!pool.append(chain, block.bytes.data())) throw Error("the rig's pool is too small");
    }
    return chain.first;
  }
  /// Sends the batch and has it taken at the next iteration; gives the batch's id.
  CommandId pulse(std::uint32_t lane = 0) {
    const BlockIndex first = send(lane);
    const CommandId id = sent;
    controller.take(lane, first, *this);
    return id;
  }

  /// Goes on checking a batch, for about so many blocks.
  bool check(std::uint32_t lane, BlockIndex first, std::uint32_t blocks) {
    return controller.check(lane, first, blocks);
  }

  void step() {
    controller.step(next, observed.data());
    controller.finish_pending();
    ++next;
  }
  /// Runs iterations; gives one number of the desired block at each.
  std::vector<double> run(int iterations, std::uint32_t number = 0) {
    std::vector<double> desired;
    for (int i = 0; i < iterations; ++i) {
      step();
      desired.push_back(this->desired(number));
    }
    return desired;
  }
  double desired(std::uint32_t number = 0) const { return desired_as<double>(number * 8); }
  template <class T>
  T desired_as(std::uint32_t offset) const {
    T value;
    std::memcpy(&value, controller.desired() + offset, sizeof value);
    return value;
  }
  template <class T>
  void observe(std::uint32_t offset, T value) {
    std::memcpy(observed.data() + offset, &value, sizeof value);
  }
  static bool is_set(const std::uint64_t* mask, std::uint32_t actuator) {
    return (mask[actuator / 64] >> (actuator % 64) & 1) != 0;
  }
  bool active(std::uint32_t i = 0) const { return is_set(controller.active_mask(), i); }
  bool clamped(std::uint32_t i = 0) const { return is_set(controller.clamped_mask(), i); }
  bool braking(std::uint32_t i = 0) const { return is_set(controller.braking_mask(), i); }
  bool starved(std::uint32_t i = 0) const { return is_set(controller.starved_mask(), i); }
  bool all_blocks_back() const { return pool.available() == pool.size(); }

  // what a backend does of a batch's requests
  Iteration iteration() const noexcept override { return next; }
  Outcome request(std::uint32_t lane, CommandId id, BlockIndex record, std::uint32_t index,
                  Cursor payload) noexcept override {
    requests.push_back({lane, id, index, payload.left()});
    last_request = record;
    if (fresh_start) {
      controller.restart(observed.data(), nullptr, next);
      ++next;
    }
    return outcome;
  }
  Outcome take_control(std::uint32_t lane) noexcept override {
    controls.emplace_back(lane, true);
    return outcome;
  }
  Outcome release_control(std::uint32_t lane) noexcept override {
    controls.emplace_back(lane, false);
    return outcome;
  }

  BlockIndex last_request = kNoBlock;
  struct Request {
    std::uint32_t lane;
    CommandId id;
    std::uint32_t index;
    std::uint64_t bytes;
  };
  Schema schema;
  BlockPool pool;
  Witness witness;
  Controller controller;
  BatchBuilder batch;
  std::vector<std::byte> observed;
  std::map<std::uint32_t, CommandId> used_ids;
  CommandId sent = 0;
  Iteration next = 1;
  std::vector<Request> requests;
  std::vector<std::pair<std::uint32_t, bool>> controls;
  Outcome outcome;
  bool fresh_start = false;
};

}  // namespace o80::test
