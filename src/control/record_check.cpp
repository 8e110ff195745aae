#include "o80/control/record_check.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace o80 {
namespace {

bool known_enums(const RecordHead& head) noexcept {
  return head.mode <= Mode::overwrite && head.pace <= Pace::iterations &&
         head.profile <= Profile::minimum_jerk && head.start <= Start::observed &&
         head.partial <= 1;
}

bool sane_pace(const RecordHead& head) noexcept {
  switch (head.pace) {
    case Pace::direct:
      return true;
    case Pace::duration:
      return head.rows > 1 || (head.amount >= 0 && head.amount <= kLongestDuration);
    case Pace::speed:
      return std::isfinite(head.speed) && head.speed > 0.0;
    case Pace::until:
      return head.rows == 1 && head.amount <= kMostIterations;
    case Pace::iterations:
      return head.amount >= 0 && head.amount <= kMostIterations;
  }
  return false;
}

}  // namespace

RecordCheck::RecordCheck(const Schema& schema, Layouts layouts) : layouts_(std::move(layouts)) {
  std::uint32_t size = 0;
  std::size_t numbers = 0;
  for (const ActuatorRow& actuator : schema.actuators) actuator_types_.push_back(actuator.type);
  for (const RequestRow& request : schema.requests) request_types_.push_back(request.type);
  for (const StateLayout* layout : layouts_) {
    if (layout == nullptr) continue;
    size = std::max(size, layout->size());
    numbers = std::max(numbers, layout->numbers().size());
  }
  state_.resize((size + 7) / 8);
  mask_.resize(mask_words(static_cast<std::uint32_t>(numbers)));
}

bool RecordCheck::valid(const BlockPool& pool, BlockIndex block) noexcept {
  const RecordHead& head = pool.head(block);
  const Cursor payload(pool, block, sizeof(RecordHead), head.payload_bytes);
  switch (head.kind) {
    case RecordKind::command:
      return valid_command(head, payload);
    case RecordKind::request:
      return valid_request(head, payload);
    case RecordKind::purge:
      return head.payload_bytes == 0 && head.partial <= 1 &&
             (head.actuator == kEveryActuator || head.actuator < actuator_types_.size());
    case RecordKind::take_control:
    case RecordKind::release_control:
      return head.payload_bytes == 0;
    default:
      return false;
  }
}

bool RecordCheck::valid_command(const RecordHead& head, Cursor payload) noexcept {
  if (head.actuator >= actuator_types_.size() || head.rows == 0 || !known_enums(head) ||
      !sane_pace(head)) {
    return false;
  }
  const StateLayout& layout = *layouts_[actuator_types_[head.actuator]];
  const auto numbers = static_cast<std::uint32_t>(layout.numbers().size());
  const bool timed = head.pace == Pace::duration && head.rows > 1;
  const std::uint64_t mask_bytes = head.partial != 0 ? 8 * mask_words(numbers) : 0;
  const std::uint64_t time_bytes = timed ? 8 * std::uint64_t{head.rows} : 0;
  const std::uint64_t row_bytes = std::uint64_t{head.rows} * layout.size();
  if (head.payload_bytes != mask_bytes + time_bytes + row_bytes) return false;

  // the mask names no number that is not there
  if (head.partial != 0) {
    payload.read(mask_.data(), mask_bytes);
    if (numbers % 64 != 0 && mask_[numbers / 64] >> (numbers % 64) != 0) return false;
  }
  // times never run backwards
  std::int64_t before = 0;
  for (std::uint32_t row = 0; timed && row < head.rows; ++row) {
    std::int64_t time = 0;
    payload.read(&time, sizeof time);
    if (time < before || time > kLongestDuration) return false;
    before = time;
  }
  auto* state = reinterpret_cast<std::byte*>(state_.data());
  for (std::uint32_t row = 0; row < head.rows; ++row) {
    payload.read(state, layout.size());
    if (!layout.finite(state, head.partial != 0 ? mask_.data() : nullptr)) return false;
  }
  return true;
}

bool RecordCheck::valid_request(const RecordHead& head, Cursor payload) noexcept {
  if (head.actuator >= request_types_.size()) return false;
  const std::uint32_t type = request_types_[head.actuator];
  if (type == kNoType) return head.payload_bytes == 0;
  const StateLayout* layout = layouts_[type];
  if (layout == nullptr || head.payload_bytes != layout->size()) return false;
  auto* state = reinterpret_cast<std::byte*>(state_.data());
  payload.read(state, layout->size());
  return layout->proper(state);
}

}  // namespace o80
