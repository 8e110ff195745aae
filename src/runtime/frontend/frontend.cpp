#include "o80/runtime/frontend.hpp"

#include "runtime/frontend/link.hpp"

#include <algorithm>
#include <thread>

#include "o80/base/nearest_name.hpp"
#include "o80/runtime/backend.hpp"
#include "runtime/journal/provenance_bytes.hpp"

namespace o80 {

UntypedFrontend::UntypedFrontend(const std::string& segment, const FrontendOptions& options)
    : link_(std::make_shared<Link>(
          AttachedSegment::attach(segment, options.access, Deadline(options.timeout),
                                  {.dead = options.dead,
                                   .starting = options.starting,
                                   .keep_waiting = options.keep_waiting}),
          nullptr)) {}

UntypedFrontend::UntypedFrontend(const UntypedBackend& backend,
                                 std::shared_ptr<InlineRunner> runner)
    : link_(std::make_shared<Link>(AttachedSegment::attach(backend.segment()), std::move(runner))) {
}

UntypedFrontend::UntypedFrontend(UntypedFrontend&&) noexcept = default;
UntypedFrontend& UntypedFrontend::operator=(UntypedFrontend&& other) noexcept {
  // the destructor of `other` closes the former link
  std::swap(link_, other.link_);
  return *this;
}

const CommandCheck& UntypedFrontend::command_check() const { return link_->command_check; }

UntypedFrontend::~UntypedFrontend() {
  if (link_) close();
}

const std::string& UntypedFrontend::segment() const { return link_->segment.name(); }
const Schema& UntypedFrontend::schema() const { return link_->description->schema; }
const RowLayout& UntypedFrontend::layout() const { return link_->description->layout; }
std::shared_ptr<const Description> UntypedFrontend::description() const {
  return link_->description;
}
std::uint64_t UntypedFrontend::epoch() const { return link_->segment.epoch(); }
Provenance UntypedFrontend::provenance() const {
  return provenance_from_bytes(link_->segment.provenance());
}
bool UntypedFrontend::bursting() const { return schema().head.bursting != 0; }
std::int64_t UntypedFrontend::period() const { return schema().head.period; }
Life UntypedFrontend::life() const {
  link_->segment.check_process();
  return link_->segment.life();
}

std::uint32_t UntypedFrontend::actuator(std::string_view name) const {
  return link_->command_check.actuator(name);
}

std::uint32_t UntypedFrontend::request_index(std::string_view name) const {
  for (std::uint32_t i = 0; i < schema().requests.size(); ++i) {
    if (schema().requests[i].name.view() == name) return i;
  }
  std::vector<std::string> known;
  for (const RequestRow& row : schema().requests) known.push_back(row.name.str());
  throw InvalidArgument("'" + segment() + "' serves no request '" + std::string(name) + "'" +
                        names_instead(name, known));
}

// ------------------------------------------------------------------------------ reading

Iteration UntypedFrontend::published() const {
  link_->check_usable();
  return link_->history.published();
}

Iteration UntypedFrontend::oldest() const {
  link_->check_usable();
  return link_->history.oldest();
}

void UntypedFrontend::latest(std::byte* row) const {
  link_->check_usable();
  if (link_->history.latest(row) < 0) wait_for_latest(row);
}

/// There is no row, or the next one follows a gap: until it is there, readers do not know whether
/// the newest one is being overwritten.
void UntypedFrontend::wait_for_latest(std::byte* row) const {
  const Deadline deadline(std::chrono::seconds(5));
  do {
    if (link_->history.is_damaged()) throw link_->damaged();
    if (link_->history.published() < 0) {
      throw Error("'" + segment() +
                  "' has published no row yet, its robot is still starting: use wait_for(0)");
    }
    std::this_thread::yield();
    if (link_->history.latest(row) >= 0) return;
  } while (!is_over(link_->segment.life()) && !deadline.over());
  throw Error("'" + segment() +
              "' was ended or stopped while it published a row after a gap: read rows up to " +
              std::to_string(published()) + " by their number");
}

UntypedObservation UntypedFrontend::latest() const {
  UntypedObservation observation(link_->description);
  latest(observation.bytes());
  return observation;
}

SegmentError Link::damaged() const {
  return SegmentError("the history of '" + segment.name() +
                      "' is damaged: its counters contradict each other. Start its backend again.");
}

void UntypedFrontend::wait_for(Iteration k, std::byte* row, Timeout timeout,
                               const KeepWaiting& keep_waiting) const {
  link_->check_usable();
  if (k < 0) throw InvalidArgument("there is no row " + std::to_string(k) + ": rows begin at 0");
  if (k > link_->history.published()) {
    const Deadline deadline(timeout);
    if (link_->rows.wait_for_row(k, deadline, link_->guarded(keep_waiting)) == Waited::timed_out) {
      throw TimeoutError("row " + std::to_string(k) + " of '" + segment() +
                         "' was not published in time: it is at row " +
                         std::to_string(link_->history.published()) +
                         (bursting() ? " and waits for a burst" : ""));
    }
  }
  if (link_->history.read(k, row)) return;
  throw RowOverwritten("row " + std::to_string(k) + " of '" + segment() +
                       "' was overwritten: the oldest one is " +
                       std::to_string(link_->history.oldest()) + " (the history keeps " +
                       std::to_string(link_->history.rows()) + " rows)");
}

UntypedObservation UntypedFrontend::wait_for(Iteration k, Timeout timeout,
                                             const KeepWaiting& keep_waiting) const {
  UntypedObservation observation(link_->description);
  wait_for(k, observation.bytes(), timeout, keep_waiting);
  return observation;
}

Rows UntypedFrontend::history(Iteration first, Iteration last) const {
  link_->check_usable();
  Rows rows;
  rows.row_bytes = layout().size;
  const Iteration begin = std::max(first, link_->history.oldest());
  const Iteration end = std::min(last, link_->history.published());
  rows.first = begin;
  if (end < begin) return rows;
  const auto count = static_cast<std::size_t>(end - begin + 1);
  rows.bytes.resize(count * rows.row_bytes);
  const HistoryReader::Range range = link_->history.read_range(begin, count, rows.bytes.data());
  rows.first = range.first;
  rows.count = range.count;
  rows.bytes.resize(range.count * rows.row_bytes);
  return rows;
}

Rows UntypedFrontend::history(std::size_t n) const {
  const Iteration last = published();
  const auto most = static_cast<std::size_t>(last + 1);
  return history(last + 1 - static_cast<Iteration>(std::min(n, most)), last);
}

std::int64_t UntypedFrontend::wait_for_next(Iteration& position, std::byte* row, Timeout timeout,
                                            const KeepWaiting& keep_waiting) const {
  link_->check_usable();
  const Iteration wanted = position;
  const Deadline deadline(timeout);
  Iteration next = wanted;
  while (true) {
    // the oldest row may be still to come, after a gap in a recording that is played
    if (next > link_->history.published() &&
        link_->rows.wait_for_row(next, deadline, link_->guarded(keep_waiting)) ==
            Waited::timed_out) {
      throw TimeoutError("row " + std::to_string(next) + " of '" + segment() +
                         "' was not published in time");
    }
    if (link_->history.read(next, row)) break;
    if (link_->history.is_damaged()) throw link_->damaged();
    next = std::max(next, link_->history.oldest());
  }
  position = next + 1;
  return next - wanted;
}

void UntypedFrontend::close() {
  link_->closed.store(true, std::memory_order_relaxed);
  // a forked child: a thread of the parent may hold the lock, and the lane belongs to the parent
  if (link_->segment.forked()) return;
  const std::scoped_lock lock(link_->sending);
  // batches still read their statuses, but the lane is released
  if (link_->lane_) link_->lane_->give_back();
  link_->lane_.reset();
  link_->builder.clear();
  link_->runner.reset();
}

bool UntypedFrontend::closed() const { return link_->closed.load(std::memory_order_relaxed); }

void UntypedFrontend::note_clipped(std::size_t numbers) {
  const auto lock = link_->lock_to_add();
  link_->builder.note_clipped(numbers);
}

}  // namespace o80
