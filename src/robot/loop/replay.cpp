#include "robot/loop/replay.hpp"

#include <utility>

#include "memory/segment/owned_segment.hpp"
#include "o80/base/error.hpp"

namespace o80 {

namespace {

/// Throws if this robot may be hardware. The recording may describe another robot than this one.
void check_simulated(const Schema& schema) {
  if (schema.head.is_simulated()) return;
  throw DriverError("robot '" + schema.head.robot.str() +
                    "' is not started for a replay: it may be hardware, because its driver does "
                    "not declare that it is simulated (in describe: schema.simulated(), in Python: "
                    "simulated = True)");
}

}  // namespace

Replay::Replay(std::unique_ptr<DriverInstance> robot, const BackendOptions& options)
    : loop_(std::move(robot), options, &recorded_) {
  check_simulated(loop_.backend().schema());
}

void Replay::begin_at(Iteration first) noexcept { loop_.begin_at(first - 1); }

void Replay::begin_at_rest(Iteration first, std::span<const std::byte> before, std::uint32_t slot) {
  const RowLayout& layout = loop_.backend().layout();
  if (before.size() != layout.size) throw InvalidArgument("the rows have another size");
  const auto desired = before.subspan(layout.desired, layout.block);
  desired_.assign(desired.begin(), desired.end());
  restored_ = slot;
  loop_.begin_at(first - 1, desired_.data());
}

void Replay::load_snapshot(std::uint32_t slot, std::span<const std::byte> bytes) {
  if (loop_.load_snapshot(slot, bytes)) return;
  throw DriverError("the robot cannot take the recorded snapshot of slot " + std::to_string(slot) +
                    ": replay the recording with the driver that it was made with");
}

void Replay::add(const JournalEntry& entry) {
  const UntypedBackend& backend = loop_.backend();
  recorded_.add(entry, backend.schema(), backend.segment().view().shape.lanes);
}

bool Replay::run(std::span<const std::int64_t> times) {
  if (times.empty()) return true;
  const auto last = next() + static_cast<Iteration>(times.size()) - 1;
  recorded_.set_times(next(), times);
  if (!std::exchange(started_, true)) {
    loop_.start();
    if (restored_ && !loop_.restore(*restored_)) return false;
  }
  return loop_.replay(last) == Step::run;
}

std::string Replay::fault() const { return loop_.fault(); }

}  // namespace o80
