// Snapshots as bytes, so that a replay can begin with one.

#include <algorithm>

#include "driver/simulation.hpp"
#include "driver/state_bytes.hpp"

namespace o80::mujoco {

namespace {
constexpr int kWholeState = mjSTATE_INTEGRATION;  // all inputs of the next step
}

void Simulation::add_slots(std::uint32_t count) {
  engine_state_.resize(static_cast<std::size_t>(mj_stateSize(model_.model.get(), kWholeState)));
  StateBytes counted;
  each_part(counted);
  slots_.resize(count);
  for (Slot& slot : slots_) slot.bytes.resize(counted.bytes());
}

/// Copies the engine's state first: other values of rows follow from it, or are copied here.
template <class Bytes>
void Simulation::each_part(Bytes& bytes) noexcept {
  bytes(engine_state_);
  bytes.copy(data_->sensordata, static_cast<std::size_t>(model_.model->nsensordata));
  bytes(now_.clock);
  bytes(now_.engine_contacts);
  bytes(now_.relaxed);
  bytes(now_.teleports);
  bytes(now_.strength);
  bytes(now_.targets.joints);
  bytes(now_.targets.controls);
  bytes(now_.targets.states);
  bytes(now_.joints);
  if (balls_) {
    Balls::State& balls = balls_->state();
    bytes(balls.targets);
    bytes(balls.balls);
    bytes(balls.watched);
    bytes(balls.others);
    bytes(balls.poses);
  }
  // the efforts of the last step, shown in rows of a face
  if (model_.face) bytes.copy(data_->qfrc_actuator, static_cast<std::size_t>(model_.model->nv));
}

bool Simulation::snapshot(std::size_t slot) noexcept {
  if (slot >= slots_.size()) return false;
  mj_getState(model_.model.get(), data_.get(), engine_state_.data(), kWholeState);
  StateBytes to = StateBytes::to(slots_[slot].bytes);
  each_part(to);
  slots_[slot].filled = true;
  return true;
}

bool Simulation::restore(std::size_t slot) noexcept {
  if (slot >= slots_.size() || !slots_[slot].filled) return false;
  const std::vector<std::byte>& bytes = slots_[slot].bytes;
  std::memcpy(engine_state_.data(), bytes.data(), engine_state_.size() * sizeof(mjtNum));
  mj_setState(model_.model.get(), data_.get(), engine_state_.data(), kWholeState);
  std::ranges::fill(data_->warning, mjWarningStat{});
  forward();
  // that changed the first guess of the next step, and the sensors
  mj_setState(model_.model.get(), data_.get(), engine_state_.data(), kWholeState);
  StateBytes from = StateBytes::from(bytes);
  each_part(from);
  forwarded_ = false;
  return true;
}

std::span<const std::byte> Simulation::snapshot_bytes(std::size_t slot) const noexcept {
  if (slot >= slots_.size() || !slots_[slot].filled) return {};
  return slots_[slot].bytes;
}

bool Simulation::load_snapshot(std::size_t slot, std::span<const std::byte> bytes) noexcept {
  if (slot >= slots_.size() || bytes.size() != slots_[slot].bytes.size()) return false;
  std::ranges::copy(bytes, slots_[slot].bytes.begin());
  slots_[slot].filled = true;
  return true;
}

}  // namespace o80::mujoco
