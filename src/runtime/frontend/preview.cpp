// How a frontend computes what a command would do: by a controller of its own, as the loop has it.

#include "o80/runtime/preview.hpp"

#include <cstring>

#include "control/queue/controller.hpp"
#include "o80/runtime/frontend.hpp"
#include "runtime/frontend/ends_text.hpp"
#include "runtime/frontend/sending.hpp"

namespace o80 {

namespace {

/// Longest motion that is previewed, because its rows are kept in memory [iterations].
constexpr std::size_t kMaxPreviewed = 1'000'000;

/// What a controller with a single command needs around it.
class Surroundings final : public StatusSink, public BatchHandler {
 public:
  static constexpr CommandId kBatch = 1;

  explicit Surroundings(Iteration first) : first_(first) {}
  const StatusChange& end() const { return end_; }

  void changed(const StatusChange& change) noexcept override {
    if (change.id == record_id(kBatch, 0) && is_end(change.status)) end_ = change;
  }
  void freed(std::uint32_t /*lane*/, std::uint32_t /*blocks*/) noexcept override {}
  Iteration iteration() const noexcept override { return first_; }
  Outcome request(std::uint32_t /*lane*/, CommandId /*id*/, BlockIndex /*record*/,
                  std::uint32_t /*index*/, Cursor /*payload*/) noexcept override {
    return {};
  }
  Outcome take_control(std::uint32_t /*lane*/) noexcept override { return {}; }
  Outcome release_control(std::uint32_t /*lane*/) noexcept override { return {}; }

 private:
  Iteration first_;
  StatusChange end_;
};

std::string quoted(const Schema& schema, std::uint32_t actuator) {
  return "actuator '" + schema.actuators[actuator].name.str() + "'";
}

/// Refuses what this process cannot compute, and a start that no robot has.
void refuse_unknown(const Schema& schema, std::span<const std::uint32_t> actuators,
                    std::span<const std::uint64_t> masks, const Controller& controller,
                    const std::byte* start) {
  const auto refuse = [&](std::uint32_t actuator, const char* why) {
    throw InvalidArgument(quoted(schema, actuator) + " has no preview: " + why);
  };
  for (const std::uint32_t actuator : actuators) {
    const ActuatorRow& row = schema.actuators[actuator];
    if (schema.types[row.type].blends != 0) {
      refuse(actuator, "code of its driver (blend) interpolates its state");
    }
    for (const IntegralRow& bound : schema.integrals) {
      const std::uint32_t number = bound.limit - row.first_limit;
      if (number >= row.limits || !masked(masks.empty() ? nullptr : masks.data(), number)) continue;
      refuse(actuator, "what it will observe decides where the bound of an integral acts");
    }
    if (!masks.empty()) masks = masks.subspan(mask_words(row.limits));
  }
  if (const auto found = controller.not_finite(start)) {
    throw InvalidArgument("the state from which " + quoted(schema, found->actuator) +
                          " begins has a number that is not finite");
  }
}

/// Where a fresh start or following has set an actuator to rest, it is there in the rows before,
/// too.
void settle(const Description& robot, Rows& rows) {
  const RowLayout& layout = robot.layout;
  for (std::size_t i = 1; i < rows.count; ++i) {
    std::byte* const row = rows.bytes.data() + i * rows.row_bytes;
    for (std::uint32_t k = 0; k < robot.schema.actuators.size(); ++k) {
      const ActuatorRow& actuator = robot.schema.actuators[k];
      const auto active = unpack<std::uint64_t>(row + layout.active + k / 64 * 8) >> (k % 64) & 1;
      const bool follows = actuator.when_idle == WhenIdle::follow && active == 0;
      if (!follows && unpack<RowHead>(row).fresh == 0) continue;
      const std::byte* const state = row + layout.desired + actuator.offset;
      for (std::size_t j = 0; j < i; ++j) {
        std::memcpy(rows.bytes.data() + j * rows.row_bytes + layout.desired + actuator.offset,
                    state, robot.schema.types[actuator.type].size);
      }
    }
  }
}

[[noreturn]] void throw_too_long() {
  throw InvalidArgument("the command takes more than " + std::to_string(kMaxPreviewed) +
                        " iterations, for which a preview has no rows");
}

/// `rows`: the last ones before the command begins.
Preview preview_after(Link& link, const Rows& rows, std::span<const std::uint32_t> actuators,
                      std::span<const std::byte> states, const CommandOptions& options,
                      std::span<const std::uint64_t> masks) {
  const auto& [schema, layout, epoch] = *link.description;
  // the record that the command would send
  BatchBuilder builder;
  {
    const auto lock = link.lock_to_send();
    add_commands_to(link, builder, actuators, states, options, masks);
  }
  const auto blocks = builder.seal({.id = Surroundings::kBatch});
  BlockPool pool(static_cast<std::uint32_t>(blocks.size()));
  BlockChain batch;
  for (const Block& block : blocks) pool.append(batch, block.bytes.data());

  const auto desired = [&](std::size_t i) { return rows.row(i).data() + layout.desired; };
  const std::byte* const observed = rows.row(rows.count - 1).data() + layout.observed;
  Preview preview;
  preview.rows.first = rows.first + static_cast<Iteration>(rows.count);
  preview.rows.row_bytes = layout.block;
  Surroundings around(preview.rows.first);
  Controller controller(schema, pool, around, 1);
  refuse_unknown(schema, actuators, masks, controller, desired(rows.count - 1));
  controller.restart(observed, desired(0), rows.first);
  for (std::size_t i = 1; i < rows.count; ++i) controller.trace(desired(i));
  controller.take(0, batch.first, around);

  const StatusChange& end = around.end();
  std::vector<std::byte>& bytes = preview.rows.bytes;
  for (Iteration now = preview.rows.first; !is_end(end.status); ++now) {
    if (preview.rows.count++ == kMaxPreviewed) throw_too_long();
    // a robot that is where it was asked to be
    controller.step(now, bytes.empty() ? observed : bytes.data() + bytes.size() - layout.block);
    bytes.insert(bytes.end(), controller.desired(), controller.desired() + layout.block);
  }
  if (end.reason == Reason::late) {
    throw InvalidArgument("the command comes too late: it would begin in iteration " +
                          std::to_string(preview.rows.first) + ", after its `until`");
  }
  if (end.status != Status::completed) throw_too_long();
  preview.late = end.late;
  if (end.reason == Reason::limits) preview.text = late_text(end.detail, end.late);
  return preview;
}

}  // namespace

Preview UntypedFrontend::preview(std::span<const std::uint32_t> actuators,
                                 std::span<const std::byte> states, const CommandOptions& options,
                                 std::span<const std::uint64_t> masks) const {
  Rows rows = history(3);
  if (rows.count == 0) return preview_from(latest(), actuators, states, options, masks);
  settle(*link_->description, rows);
  return preview_after(*link_, rows, actuators, states, options, masks);
}

Preview UntypedFrontend::preview_from(const UntypedObservation& row,
                                      std::span<const std::uint32_t> actuators,
                                      std::span<const std::byte> states,
                                      const CommandOptions& options,
                                      std::span<const std::uint64_t> masks) const {
  if (row.size() != layout().size) throw InvalidArgument("the row is from another robot");
  const Rows rows{row.iteration(), 1, row.size(), {row.bytes(), row.bytes() + row.size()}};
  return preview_after(*link_, rows, actuators, states, options, masks);
}

}  // namespace o80
