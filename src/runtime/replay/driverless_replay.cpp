#include "runtime/replay/driverless_replay.hpp"

#include <algorithm>
#include <cstring>
#include <utility>
#include <vector>

#include "memory/segment/owned_segment.hpp"
#include "o80/base/error.hpp"
#include "o80/describe/describe.hpp"

namespace o80 {

DriverlessReplay::DriverlessReplay(Schema schema, const BackendOptions& options)
    : backend_(std::move(schema), options, this, &recorded_) {}

void DriverlessReplay::begin_at(Iteration first) noexcept {
  start_ = first;
  backend_.begin_at(first - 1);
}

void DriverlessReplay::begin_at_rest(Iteration row) noexcept {
  at_rest_ = true;
  start_ = row;
  backend_.begin_at(row);
}

void DriverlessReplay::add(const JournalEntry& entry) {
  recorded_.add(entry, backend_.schema(), backend_.segment().view().shape.lanes);
}

bool DriverlessReplay::run(std::span<const std::byte> rows) {
  const std::size_t size = backend_.layout().size;
  const std::size_t count = rows.size() / size;
  if (count == 0 || rows.size() % size != 0) throw InvalidArgument("the rows have another size");
  rows_ = rows;
  first_ = started_ ? next() : start_;
  std::vector<std::int64_t> times;
  if (next() < first_) times.push_back(unpack<RowHead>(rows.data()).time);
  for (std::size_t i = 0; i < count; ++i) {
    const auto head = unpack<RowHead>(rows.data() + i * size);
    if (head.iteration != first_ + static_cast<Iteration>(i)) {
      throw InvalidArgument("the recorded rows are not consecutive");
    }
    times.push_back(head.time);
  }
  recorded_.set_times(next(), times);
  const Iteration last = first_ + static_cast<Iteration>(count) - 1;
  if (!started_ && at_rest_) backend_.begin_at(start_, rows.data() + backend_.layout().desired);
  if (!std::exchange(started_, true) && !publish()) return false;
  while (next() <= last) {
    if (backend_.step() == Step::ended || !publish()) return false;
  }
  return true;
}

/// The reading of the current row, and the interrupts that came with it.
bool DriverlessReplay::publish() noexcept {
  const RowLayout& layout = backend_.layout();
  const std::byte* row = row_of(std::max(next(), start_));
  if (row == nullptr) return false;
  std::memcpy(backend_.observed(), row + layout.observed, layout.block);
  std::memcpy(backend_.extended(), row + layout.extended, layout.extended_size);
  while (const std::optional<std::uint16_t> actuator = recorded_.interrupt_due(next(), false)) {
    backend_.interrupt(*actuator);
  }
  return backend_.publish();
}

Served DriverlessReplay::serve(std::uint32_t /*request*/,
                               std::span<const std::byte> /*payload*/) noexcept {
  return Served::done();
}

bool DriverlessReplay::read_fresh(FreshReading& reading) noexcept {
  const RowLayout& layout = backend_.layout();
  const std::byte* row = row_of(next());
  if (row == nullptr) return false;
  std::memcpy(reading.observed, row + layout.observed, layout.block);
  std::memcpy(reading.extended, row + layout.extended, layout.extended_size);
  // a driver may give the desired states of a fresh start; otherwise they are the observed ones
  std::memcpy(reading.desired, row + layout.desired, layout.block);
  reading.has_desired = true;
  reading.follows = recorded_.fresh_start_follows();
  return true;
}

const std::byte* DriverlessReplay::row_of(Iteration iteration) const noexcept {
  const std::size_t size = backend_.layout().size;
  const Iteration place = iteration - first_;
  const bool is_there = place >= 0 && place < static_cast<Iteration>(rows_.size() / size);
  return is_there ? rows_.data() + static_cast<std::size_t>(place) * size : nullptr;
}

}  // namespace o80
