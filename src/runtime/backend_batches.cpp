// How batches come from the lanes to the controller, and statuses go back.

#include <algorithm>
#include <cstring>
#include <optional>

#include "backend_body.hpp"
#include "o80/memory/futex.hpp"

namespace o80 {

// ------------------------------------------------------------------------------ statuses out

void UntypedBackend::Body::tell(const StatusChange& change) noexcept {
  LaneReceiver& lane = lanes[change.lane];
  lane.set_status(change.id,
                  {static_cast<std::uint8_t>(change.status),
                   static_cast<std::uint8_t>(change.reason), change.aux, change.iteration});
  if (is_end(change.status)) lane.flag();
}

void UntypedBackend::Body::changed(const StatusChange& change) noexcept {
  // nothing is completed before its row is out: whoever is killed until then has not done it
  const bool waits = stepping_ && is_end(change.status) && untold_.size() < untold_.capacity();
  if (waits) {
    untold_.push_back(change);
  } else {
    tell(change);
  }
  // a burst that runs until its batch has ended: this iteration is its last, or there is none
  if (burst_left_ != kUntilEnded || change.lane != burst_lane_ || change.id != burst_id_ + 1)
    return;
  burst_left_ = under_way_ ? 1 : 0;
  if (!under_way_) end_burst(current - 1);
}

/// What ended in the step of the row that was published, or never will be.
void UntypedBackend::Body::tell_of_the_row(bool published) noexcept {
  for (StatusChange& change : untold_) {
    if (!published && (change.status == Status::completed || change.status == Status::limited)) {
      change.status = Status::purged;
      change.reason = Reason::stopped;
    }
    tell(change);
  }
  untold_.clear();
}

void UntypedBackend::Body::freed(std::uint32_t lane, std::uint32_t blocks) noexcept {
  lanes[lane].free(blocks);
}

/// Whoever waits is woken by one system call at most.
void UntypedBackend::Body::wake(bool lanes_wait, bool reader_waits) noexcept {
  Wakes& wakes = segment.view().wakes();
  if (lanes_wait && reader_waits) {
    futex_wake_both(wakes.row_wake, 1, wakes.lane_wake);
  } else if (lanes_wait) {
    futex_wake(wakes.lane_wake, kEverybody);
  } else if (reader_waits) {
    futex_wake(wakes.row_wake, 1);
  }
}

void UntypedBackend::Body::fail(std::string_view text) noexcept {
  const std::size_t size = std::min(text.size(), failure.size() - 1);
  std::memcpy(failure.data(), text.data(), size);
  failure[size] = 0;
  stop.store(true, std::memory_order_relaxed);
}

// ------------------------------------------------------------------------------ requests

Outcome UntypedBackend::Body::request(std::uint32_t lane, CommandId id, std::uint32_t index,
                                      Cursor payload) noexcept {
  const std::size_t size = schema.types[schema.requests[index].type].size;
  const auto reject = [&](std::string_view why) {
    lanes[lane].set_message(id, why);
    return Outcome{Status::rejected, Reason::driver, 0};
  };
  payload.read(payload_.data(), size);
  if (server_ == nullptr) return reject("nobody serves requests in this backend");

  const Served served = server_->serve(index, {payload_.data(), size});
  if (served.kind == Served::Kind::done) return {};
  if (served.kind == Served::Kind::rejected) return reject(served.why());
  if (served.kind == Served::Kind::failed) {
    fail(served.why());
    return reject(served.why());
  }
  // a fresh start has a row of its own
  auto* desired = reinterpret_cast<std::byte*>(fresh_desired_.data());
  FreshReading reading{row() + layout.observed, row() + layout.extended, desired};
  if (!server_->read_fresh(reading)) {
    constexpr std::string_view kWhy = "the robot could not be read after a fresh start";
    fail(kWhy);
    return reject(kWhy);
  }
  controller.restart(reading.observed, reading.has_desired ? reading.desired : nullptr, current);
  publish(true);
  return {};
}

Outcome UntypedBackend::Body::take_control(std::uint32_t lane) noexcept {
  // a batch of somebody else never comes here while somebody has control; who has left the lane
  // meanwhile would have lost it at once
  if (taking_owner_ == 0 || taking_owner_ != lanes[lane].incarnation()) return {};
  holder_ = lane;
  holder_incarnation_ = taking_owner_;
  return {};
}

Outcome UntypedBackend::Body::release_control(std::uint32_t lane) noexcept {
  if (holder_ == lane && holder_incarnation_ == taking_owner_) holder_ = kNobody;
  return {};
}

// ------------------------------------------------------------------------------ batches in

void UntypedBackend::Body::begin_staging(std::uint32_t lane, std::uint32_t& budget) noexcept {
  constexpr auto kBatch = static_cast<std::uint64_t>(RecordKind::batch);
  const std::uint64_t kind = lanes[lane].peek_word(offsetof(BatchRecord, kind)) & 0xFF;
  const auto blocks =
      static_cast<std::uint32_t>(lanes[lane].peek_word(offsetof(BatchRecord, blocks)));
  if (kind != kBatch || blocks == 0 || blocks > lanes[lane].available_of_one()) {
    // who writes garbage faster than it is thrown away must not keep the loop here
    --budget;
    lanes[lane].reset();
    return;
  }
  // an heir's first batch finds the house in order
  mourn(lane, lanes[lane].dead_predecessor());
  staging_ = true;
  // who was mourned may have left this, and no heir come yet
  staging_incarnation_ = lanes[lane].incarnation();
  staging_owner_ = lanes[lane].owner_of_next();
  staging_of_dead_ = lanes[lane].next_is_of_dead() ||
                     (staging_incarnation_ != 0 && staging_incarnation_ <= mourned_[lane]);
  staging_lane_ = lane;
  staging_left_ = blocks;
  staging_chain_ = {};
}

/// Goes on with the batch that is being staged; false if the budget ended before it.
bool UntypedBackend::Body::stage(std::uint32_t& budget) noexcept {
  LaneReceiver& lane = lanes[staging_lane_];
  Block block{};
  while (staging_left_ > 0 && budget > 0) {
    const bool taken = lane.take(block.bytes.data());
    BatchRecord first;
    std::memcpy(&first, block.bytes.data(), sizeof first);
    const bool expected = staging_chain_.blocks > 0 || lane.expects(first.id);
    if (!taken || !expected || !pool.append(staging_chain_, &block)) {
      drop_staged(taken ? 1 : 0);
      --budget;
      return true;
    }
    --staging_left_;
    --budget;
  }
  if (staging_left_ > 0 || budget == 0) return false;
  // what the copies left of the budget goes into a look at the records
  if (!controller.check(staging_lane_, staging_chain_.first, budget)) return false;
  staging_ = false;
  staged();
  return true;
}

/// What there is of the batch is garbage, or the lane was reset under us.
void UntypedBackend::Body::drop_staged(std::uint32_t blocks_outside) noexcept {
  LaneReceiver& lane = lanes[staging_lane_];
  lane.free(staging_chain_.blocks + blocks_outside);
  lane.reset();
  pool.release(staging_chain_);
  staging_ = false;
}

/// The staged batch is complete: take it, put it off to its iteration, or refuse it.
void UntypedBackend::Body::staged() noexcept {
  const std::uint32_t lane = staging_lane_;
  const BlockIndex first = staging_chain_.first;
  const BatchRecord batch = pool.batch(first);
  lanes[lane].set_staged(batch.id, record_id(batch.id, std::min(batch.records, batch.blocks)));
  last_batch_ = current;
  const ScheduledBatch sent{batch.at < 0 ? current : batch.at,
                            batch.ticket,
                            first,
                            lane,
                            staging_owner_,
                            batch.late_now != 0,
                            staging_of_dead_};
  if (!admit(sent)) return;
  if (!staging_of_dead_) grant(lane, batch);
  if (sent.at > current) {
    schedule.add(sent);
  } else {
    take(sent);
  }
}

void UntypedBackend::Body::take(const ScheduledBatch& sent) noexcept {
  taking_owner_ = sent.owner;
  controller.take(sent.lane, sent.batch, *this);
}

/// Whether a batch may be taken, now or later; else it ends as rejected.
bool UntypedBackend::Body::admit(const ScheduledBatch& sent) noexcept {
  const auto reject = [&](Reason reason, std::uint32_t aux = 0) {
    controller.reject(sent.lane, sent.batch, reason, static_cast<std::uint8_t>(aux), current);
    return false;
  };
  watch_holder();
  const bool is_holders = holder_ == sent.lane && holder_incarnation_ == sent.owner;
  if (holder_ != kNobody && !is_holders) return reject(Reason::exclusive, holder_);
  if (sent.at < current && !sent.late_now) return reject(Reason::late);
  const LaneLife& life = lives_[sent.lane];
  const bool dead = sent.of_dead || (life.state == LaneState::died &&
                                     life.incarnation == lanes[sent.lane].incarnation());
  if (dead && stale_ == Stale::purge) return reject(Reason::dead_frontend);
  return true;
}

void UntypedBackend::Body::grant(std::uint32_t lane, const BatchRecord& batch) noexcept {
  const bool until_ended = (batch.flags & kBurstUntilEnded) != 0;
  if (schema.head.bursting == 0 || (batch.burst <= 0 && !until_ended)) return;
  burst_left_ = until_ended ? kUntilEnded : batch.burst;
  burst_lane_ = lane;
  burst_id_ = batch.id;
  burst_incarnation_ = lanes[lane].incarnation();
}

/// Batches sent for this iteration, or for one that a fresh start jumped over.
void UntypedBackend::Body::take_due() noexcept {
  while (!schedule.empty() && schedule.next().at <= current) {
    const ScheduledBatch due = schedule.next();
    schedule.drop_next();
    if (admit(due)) take(due);
  }
}

/// Batches in the order of their tickets, as far as the work of one iteration may go.
void UntypedBackend::Body::take_batches() noexcept {
  std::uint32_t budget = kBlocksPerIteration;
  const bool news = lanes.look();
  // nothing sent after a burst acts in it
  while (!granted()) {
    if (!staging_) {
      const auto lane = news ? lanes.next() : std::nullopt;
      if (!lane || budget == 0) return;
      begin_staging(*lane, budget);
    } else if (!stage(budget)) {
      return;
    }
  }
  lanes.look_again_after(burst_lane_);
}

}  // namespace o80
