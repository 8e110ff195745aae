// Snapshots as bytes, so that a replay can begin with one.

#include "driver/simulation.hpp"
#include "driver/state_bytes.hpp"

namespace o80::mujoco {

namespace {
constexpr int kWholeState = mjSTATE_INTEGRATION;  // all that the next step depends on
}

void Simulation::make_room_for_bytes() {
  engine_state_.resize(static_cast<std::size_t>(mj_stateSize(model_.model.get(), kWholeState)));
  if (slots_.empty()) return;
  StateBytes count;
  each_part(slots_[0], count);
  bytes_.resize(count.bytes());
}

template <class Bytes>
void Simulation::each_part(Slot& slot, Bytes& bytes) noexcept {
  bytes(engine_state_);
  bytes.copy(slot.data->sensordata, static_cast<std::size_t>(model_.model->nsensordata));
  bytes(slot.state.clock);
  bytes(slot.state.engine_contacts);
  bytes(slot.state.relaxed);
  bytes(slot.state.teleports);
  bytes(slot.state.strength);
  bytes(slot.state.targets.joints);
  bytes(slot.state.targets.controls);
  bytes(slot.state.targets.states);
  bytes(slot.state.joints);
  bytes(slot.balls.targets);
  bytes(slot.balls.balls);
  bytes(slot.balls.watched);
  bytes(slot.balls.others);
  bytes(slot.balls.poses);
}

std::span<const std::byte> Simulation::snapshot_bytes(std::size_t slot) noexcept {
  if (slot >= slots_.size() || !slots_[slot].filled) return {};
  mj_getState(model_.model.get(), slots_[slot].data.get(), engine_state_.data(), kWholeState);
  StateBytes to = StateBytes::to(bytes_);
  each_part(slots_[slot], to);
  return bytes_;
}

bool Simulation::load_snapshot(std::size_t slot, std::span<const std::byte> bytes) noexcept {
  if (slot >= slots_.size() || bytes.size() != bytes_.size()) return false;
  mjData* data = slots_[slot].data.get();
  std::memcpy(engine_state_.data(), bytes.data(), engine_state_.size() * sizeof(mjtNum));
  mj_setState(model_.model.get(), data, engine_state_.data(), kWholeState);
  mj_forward(model_.model.get(), data);
  // mj_forward has changed the first guess of the next step, and the sensors
  mj_setState(model_.model.get(), data, engine_state_.data(), kWholeState);
  StateBytes from = StateBytes::from(bytes);
  each_part(slots_[slot], from);
  slots_[slot].filled = true;
  return true;
}

}  // namespace o80::mujoco
