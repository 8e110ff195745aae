#include "o80/runtime/backend.hpp"

#include <algorithm>
#include <atomic>
#include <cstring>
#include <limits>
#include <optional>
#include <vector>

#include "o80/base/time.hpp"
#include "o80/control/controller.hpp"
#include "o80/describe/table.hpp"
#include "o80/memory/fork.hpp"
#include "o80/memory/history.hpp"
#include "o80/memory/lane.hpp"
#include "o80/memory/liveness.hpp"
#include "o80/memory/signal.hpp"
#include "o80/runtime/schedule.hpp"

namespace o80 {

namespace {

constexpr std::uint64_t kDefaultHistoryBytes = 16U << 20;
constexpr std::uint64_t kDefaultHistoryRows = 100'000;
constexpr std::uint32_t kBlocksPerIteration = 1024;
constexpr std::uint32_t kNobody = 0xFFFFFFFF;
constexpr std::int64_t kUntilEnded = -1;
constexpr std::int64_t kForEver = std::numeric_limits<std::int64_t>::max();

Schema prepared(Schema schema, const BackendOptions& options) {
  if (options.period <= 0) {
    throw InvalidArgument("the period is " + std::to_string(options.period) +
                          " ns: it must be above 0");
  }
  if (options.silence > 0 && options.stale == Stale::hold) {
    throw InvalidArgument(
        "a longest silence needs to know what follows it: set the stale policy to purge or stop");
  }
  schema.head.period = options.period;
  schema.head.bursting = options.bursting ? 1 : 0;
  schema.head.clock = options.bursting ? Clock::simulated : Clock::monotonic;
  schema.head.block = round_up(schema.head.block, 8);
  check(schema);
  return schema;
}

std::uint64_t rows_of(const BackendOptions& options, std::uint32_t row_bytes) {
  if (options.history > 0) return options.history;
  return std::clamp<std::uint64_t>(kDefaultHistoryBytes / row_bytes, 16, kDefaultHistoryRows);
}

OwnedSegment segment_of(const Schema& schema, const BackendOptions& options) {
  const std::vector<std::byte> bytes = to_bytes(schema);
  const std::uint32_t row_bytes = row_layout(schema).size;
  SegmentSpec spec;
  spec.name = options.segment;
  spec.schema = bytes;
  spec.row_bytes = row_bytes;
  spec.rows = rows_of(options, row_bytes);
  spec.lanes = options.lanes;
  spec.lane_blocks = options.lane_blocks;
  spec.permission = options.permission;
  return OwnedSegment::create(spec);
}

}  // namespace

/// The parts of a backend, and the order in which batches reach the controller.
class UntypedBackend::Body final : public StatusSink, public BatchHandler {
 public:
  Body(Schema&& given, const BackendOptions& options, RequestServer* server)
      : schema(prepared(std::move(given), options)),
        layout(row_layout(schema)),
        segment(segment_of(schema, options)),
        history(segment.view()),
        row_signal(segment.view()),
        bell(segment.view()),
        lanes(segment.view(), offsetof(BatchRecord, ticket)),
        liveness(segment),
        pool(lanes.size() * segment.view().shape.lane_blocks),
        controller(schema, pool, *this, lanes.size()),
        schedule(pool.size() / 2),
        server_(server),
        lives_(lanes.size()),
        mourned_(lanes.size()),
        freed_(lanes.size()),
        row_(layout.size / 8),
        payload_(largest_request(), std::byte{0}),
        fresh_desired_(layout.block / 8),
        stale_(options.stale),
        silence_(options.silence <= 0
                     ? 0
                     : std::max<std::int64_t>(1, options.silence / options.period)) {
    for (std::uint32_t i = 0; i < lanes.size(); ++i) lives_[i] = liveness.lane(i);
  }

  Body(const Body&) = delete;
  Body& operator=(const Body&) = delete;
  virtual ~Body() = default;

  // BatchHandler: what a batch can ask of the backend itself
  Iteration iteration() const noexcept override { return current; }
  Outcome request(std::uint32_t lane, CommandId id, std::uint32_t index,
                  Cursor payload) noexcept override;
  Outcome take_control(std::uint32_t lane) noexcept override;
  Outcome release_control(std::uint32_t lane) noexcept override;

  // StatusSink
  void changed(const StatusChange& change) noexcept override;

  std::byte* row() noexcept { return reinterpret_cast<std::byte*>(row_.data()); }
  void publish(bool fresh) noexcept;
  Step step(std::int64_t at_most) noexcept;
  void cut_burst() noexcept;
  void end(State state, std::string_view text) noexcept;
  std::int64_t time() const noexcept {
    return schema.head.bursting != 0 ? current * schema.head.period : monotonic_now();
  }

  const Schema schema;
  const RowLayout layout;
  OwnedSegment segment;
  HistoryWriter history;
  RowSignal row_signal;
  BellWaiter bell;
  LaneReceivers lanes;
  LaneLiveness liveness;
  BlockPool pool;
  Controller controller;
  Schedule schedule;
  Timing timing;
  std::atomic<bool> stop{false};
  std::array<char, 248> failure{};
  Iteration current = 0;  // under way, or about to be

 private:
  std::size_t largest_request() const {
    std::size_t size = 0;
    for (const RequestRow& row : schema.requests) {
      size = std::max<std::size_t>(size, schema.types[row.type].size);
    }
    return size;
  }

  // batches => controller
  void take_batches() noexcept;
  void take_due() noexcept;
  void begin_staging(std::uint32_t lane) noexcept;
  bool stage(std::uint32_t& budget) noexcept;
  void staged() noexcept;
  bool admit(const ScheduledBatch& sent) noexcept;
  void grant(std::uint32_t lane, const BatchRecord& batch) noexcept;
  bool granted() const noexcept { return burst_left_ != 0; }
  void count_burst() noexcept;
  void end_burst(Iteration row) noexcept;

  // what the helper thread saw
  void look_at_lives() noexcept;
  void mourn(std::uint32_t lane, std::uint64_t incarnation) noexcept;
  void watch_holder() noexcept;
  void watch_silence() noexcept;
  void stale(std::uint32_t lane, Reason reason) noexcept;
  void fail(std::string_view text) noexcept;

  void give_back() noexcept;

  ForkGuard guard_;
  RequestServer* server_;
  std::vector<LaneLife> lives_;
  std::vector<std::uint64_t> mourned_;  // last owner of each lane whose death was dealt with
  std::vector<std::uint64_t> freed_;
  std::vector<std::uint64_t> row_;  // 8-byte words: the row under way
  std::vector<std::byte> payload_;
  std::vector<std::uint64_t> fresh_desired_;
  Stale stale_;
  std::int64_t silence_;  // [iterations], 0: no limit
  Iteration last_batch_ = 0;
  std::uint32_t seen_changes_ = 0;
  bool begun_ = false;      // row 0 is out
  bool under_way_ = false;  // from step to publish: what ends now ends in this iteration

  // the batch being copied from its lane
  bool staging_ = false;
  bool staging_of_dead_ = false;  // whose place another frontend has taken
  std::uint32_t staging_lane_ = 0;
  std::uint32_t staging_left_ = 0;  // blocks
  BlockChain staging_chain_;

  std::uint32_t holder_ = kNobody;  // lane with exclusive control
  std::uint64_t holder_incarnation_ = 0;

  std::int64_t burst_left_ = 0;  // iterations, or kUntilEnded
  std::uint32_t burst_lane_ = kNobody;
  CommandId burst_id_ = 0;
  std::uint64_t burst_incarnation_ = 0;
};

// ------------------------------------------------------------------------------ statuses out

void UntypedBackend::Body::changed(const StatusChange& change) noexcept {
  LaneReceiver& lane = lanes[change.lane];
  lane.set_status(change.id,
                  {static_cast<std::uint8_t>(change.status),
                   static_cast<std::uint8_t>(change.reason), change.aux, change.iteration});
  if (is_end(change.status)) lane.flag();
  // a burst that runs until its batch has ended: this iteration is its last, or there is none
  if (burst_left_ != kUntilEnded || change.lane != burst_lane_ || change.id != burst_id_ + 1)
    return;
  burst_left_ = under_way_ ? 1 : 0;
  if (!under_way_) end_burst(current - 1);
}

void UntypedBackend::Body::give_back() noexcept {
  for (std::uint32_t i = 0; i < lanes.size(); ++i) {
    if (lanes[i].in_flight() == 0) continue;
    const std::uint64_t freed = controller.freed(i);
    if (freed == freed_[i]) continue;
    lanes[i].free(static_cast<std::uint32_t>(freed - freed_[i]));
    freed_[i] = freed;
  }
  lanes.flush_events();
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
  // a batch of another lane never comes here while somebody has control
  holder_ = lane;
  holder_incarnation_ = lanes[lane].incarnation();
  return {};
}

Outcome UntypedBackend::Body::release_control(std::uint32_t lane) noexcept {
  if (holder_ == lane) holder_ = kNobody;
  return {};
}

// ------------------------------------------------------------------------------ batches in

void UntypedBackend::Body::begin_staging(std::uint32_t lane) noexcept {
  constexpr auto kBatch = static_cast<std::uint64_t>(RecordKind::batch);
  const std::uint64_t kind = lanes[lane].peek_word(offsetof(BatchRecord, kind)) & 0xFF;
  const auto blocks =
      static_cast<std::uint32_t>(lanes[lane].peek_word(offsetof(BatchRecord, blocks)));
  if (kind != kBatch || blocks == 0 || blocks > lanes[lane].available()) {
    lanes[lane].reset();
    return;
  }
  // an heir's first batch finds the house in order
  mourn(lane, lanes[lane].dead_predecessor());
  staging_ = true;
  staging_of_dead_ = lanes[lane].next_is_of_dead();
  staging_lane_ = lane;
  staging_left_ = blocks;
  staging_chain_ = {};
}

/// Goes on with the batch that is being staged; false if the budget ended before it.
bool UntypedBackend::Body::stage(std::uint32_t& budget) noexcept {
  LaneReceiver& lane = lanes[staging_lane_];
  Block block;
  while (staging_left_ > 0 && budget > 0) {
    if (!lane.take(block.bytes.data()) || !pool.append(staging_chain_, &block)) {
      // the lane was reset under us: what there is of the batch is garbage
      lane.free(staging_chain_.blocks);
      pool.release(staging_chain_);
      staging_ = false;
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

/// The staged batch is complete: take it, put it off to its iteration, or refuse it.
void UntypedBackend::Body::staged() noexcept {
  const std::uint32_t lane = staging_lane_;
  const BlockIndex first = staging_chain_.first;
  const BatchRecord batch = pool.batch(first);
  lanes[lane].set_staged(batch.id);
  last_batch_ = current;
  const ScheduledBatch sent{batch.at < 0 ? current : batch.at,
                            batch.ticket,
                            first,
                            lane,
                            batch.late_now != 0,
                            staging_of_dead_};
  if (!admit(sent)) return;
  if (!staging_of_dead_) grant(lane, batch);
  if (sent.at > current) {
    schedule.add(sent);
  } else {
    controller.take(lane, first, *this);
  }
}

/// Whether a batch may be taken, now or later; else it ends as rejected.
bool UntypedBackend::Body::admit(const ScheduledBatch& sent) noexcept {
  const auto reject = [&](Reason reason, std::uint32_t aux = 0) {
    controller.reject(sent.lane, sent.batch, reason, static_cast<std::uint8_t>(aux), current);
    return false;
  };
  watch_holder();
  if (holder_ != kNobody && holder_ != sent.lane) return reject(Reason::exclusive, holder_);
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
    if (admit(due)) controller.take(due.lane, due.batch, *this);
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
      if (!lane) return;
      begin_staging(*lane);
    } else if (!stage(budget)) {
      return;
    }
  }
  lanes.look_again();
}

// ------------------------------------------------------------------------------ who lives

void UntypedBackend::Body::stale(std::uint32_t lane, Reason reason) noexcept {
  if (stale_ == Stale::purge) controller.purge_lane(lane, kEveryActuator, current, reason);
  if (stale_ == Stale::stop) {
    fail(reason == Reason::silence ? "no frontend sent anything for longer than is allowed"
                                   : "a commanding frontend died");
  }
}

void UntypedBackend::Body::look_at_lives() noexcept {
  if (granted()) mourn(burst_lane_, lanes[burst_lane_].dead_predecessor());
  const std::uint32_t changes = liveness.changes();
  if (changes == seen_changes_) return;
  seen_changes_ = changes;
  for (std::uint32_t i = 0; i < lanes.size(); ++i) {
    lives_[i] = liveness.lane(i);
    const bool died = lives_[i].state == LaneState::died;
    mourn(i, died ? lives_[i].incarnation : lanes[i].dead_predecessor());
  }
}

/// Does what is to be done when an owner of a lane has died, once.
void UntypedBackend::Body::mourn(std::uint32_t lane, std::uint64_t incarnation) noexcept {
  if (incarnation <= mourned_[lane]) return;
  mourned_[lane] = incarnation;
  stale(lane, Reason::dead_frontend);
  // nobody waits for the end of its burst
  if (granted() && burst_lane_ == lane && burst_incarnation_ <= incarnation) burst_left_ = 1;
  // it may have died before it rang
  lanes.look_again();
}

/// Control falls with its holder: closed, dead, or its lane in other hands.
void UntypedBackend::Body::watch_holder() noexcept {
  if (holder_ == kNobody) return;
  const LaneLife life = liveness.lane(holder_);
  const bool died = life.state == LaneState::died && life.incarnation == holder_incarnation_;
  if (died || lanes[holder_].closed() >= holder_incarnation_ ||
      lanes[holder_].incarnation() != holder_incarnation_) {
    holder_ = kNobody;
  }
}

void UntypedBackend::Body::watch_silence() noexcept {
  if (silence_ == 0 || current - last_batch_ <= silence_ || !controller.active()) return;
  if (stale_ == Stale::hold) return;
  for (std::uint32_t i = 0; i < lanes.size(); ++i) stale(i, Reason::silence);
}

// ------------------------------------------------------------------------------ the two verbs

/// Waits for a grant so long [ns] at most.
Step UntypedBackend::Body::step(std::int64_t at_most) noexcept {
  const std::int64_t give_up =
      at_most > 0 && at_most < kForEver ? monotonic_now() + at_most : at_most;
  while (true) {
    look_at_lives();
    if (stop.load(std::memory_order_relaxed)) return Step::ended;
    if (!granted()) {
      take_due();
      take_batches();
    }
    if (stop.load(std::memory_order_relaxed)) return Step::ended;
    if (schema.head.bursting == 0 || granted()) break;
    // standing still: everybody is told before anybody waits
    const bool all_told = controller.finish_pending();
    give_back();
    if (staging_ || !all_told) continue;
    const std::int64_t left =
        give_up > 0 && give_up < kForEver ? give_up - monotonic_now() : give_up;
    if (left <= 0) return Step::standing;
    bell.wait(lanes.bell_seen(), std::min(left, kSlice));
  }
  if (granted()) take_due();
  watch_silence();
  under_way_ = true;
  controller.step(current, row() + layout.observed);
  return Step::run;
}

void UntypedBackend::Body::count_burst() noexcept {
  if (burst_left_ <= 0) return;
  --burst_left_;
  if (burst_left_ == 0) end_burst(current);
}

void UntypedBackend::Body::end_burst(Iteration row) noexcept {
  lanes[burst_lane_].set_burst_done(burst_id_, row);
  burst_lane_ = kNobody;
}

void UntypedBackend::Body::cut_burst() noexcept {
  if (!granted()) return;
  burst_left_ = 0;
  end_burst(current - 1);
  lanes.look_again();
}

void UntypedBackend::Body::publish(bool fresh) noexcept {
  if (!begun_) controller.restart(row() + layout.observed, nullptr, 0);

  // head, desired and masks join observed and extended, which are there
  RowHead head;
  head.iteration = current;
  head.time = time();
  head.lateness = timing.lateness;
  head.overruns = timing.overruns;
  head.skipped = timing.skipped;
  head.fresh = fresh ? 1 : 0;
  std::memcpy(row(), &head, sizeof head);
  if (layout.block > 0) std::memcpy(row() + layout.desired, controller.desired(), layout.block);
  if (layout.mask_words > 0) {
    std::memcpy(row() + layout.active, controller.active_mask(), layout.mask_words * 8);
    std::memcpy(row() + layout.clamped, controller.clamped_mask(), layout.mask_words * 8);
  }
  history.publish(current, row());

  // whoever waits for it
  if (!fresh) {
    controller.finish_pending();
    under_way_ = false;
    count_burst();
    give_back();
  }
  row_signal.wake_readers(current);
  if (!begun_) segment.set_state(State::running);
  begun_ = true;
  ++current;
}

void UntypedBackend::Body::end(State state, std::string_view text) noexcept {
  if (guard_.forked()) return;  // it is the parent's to end
  if (segment.state() != State::starting && segment.state() != State::running) return;
  // the burst under way has no last row: whoever waits for it learns that the backend is gone
  burst_left_ = 0;
  for (; !schedule.empty(); schedule.drop_next()) {
    controller.reject(schedule.next().lane, schedule.next().batch, Reason::stopped, 0, current);
  }
  controller.purge(kEveryActuator, current, Reason::stopped);
  while (!controller.finish_pending()) {
  }
  give_back();
  segment.end(state, text);
}

// ------------------------------------------------------------------------------

UntypedBackend::UntypedBackend(Schema schema, const BackendOptions& options, RequestServer* server)
    : body_(std::make_unique<Body>(std::move(schema), options, server)) {}

UntypedBackend::~UntypedBackend() {
  body_->end(failure().empty() ? State::stopped : State::failed, failure());
}

const Schema& UntypedBackend::schema() const noexcept { return body_->schema; }
const RowLayout& UntypedBackend::layout() const noexcept { return body_->layout; }
const std::string& UntypedBackend::name() const noexcept { return body_->segment.name(); }

std::byte* UntypedBackend::observed() noexcept { return body_->row() + body_->layout.observed; }
std::byte* UntypedBackend::extended() noexcept { return body_->row() + body_->layout.extended; }
void UntypedBackend::publish() noexcept { body_->publish(false); }

Step UntypedBackend::step() noexcept { return body_->step(kForEver); }
Step UntypedBackend::try_step() noexcept { return body_->step(0); }
Step UntypedBackend::step_within(std::int64_t at_most) noexcept {
  return body_->step(std::max<std::int64_t>(at_most, 0));
}
void UntypedBackend::cut_burst() noexcept { body_->cut_burst(); }
const std::byte* UntypedBackend::desired() const noexcept { return body_->controller.desired(); }
const std::uint64_t* UntypedBackend::active() const noexcept {
  return body_->controller.active_mask();
}
Iteration UntypedBackend::iteration() const noexcept { return body_->current; }
std::int64_t UntypedBackend::time() const noexcept { return body_->time(); }
void UntypedBackend::set_timing(const Timing& timing) noexcept { body_->timing = timing; }

void UntypedBackend::interrupt(std::uint32_t actuator) noexcept {
  body_->controller.interrupt(actuator, body_->current);
}

void UntypedBackend::ask_to_stop() noexcept {
  body_->stop.store(true, std::memory_order_relaxed);
  body_->bell.interrupt();
}
bool UntypedBackend::stop_asked() const noexcept {
  return body_->stop.load(std::memory_order_relaxed);
}
std::string_view UntypedBackend::failure() const noexcept { return body_->failure.data(); }

void UntypedBackend::end(State stopped_or_failed, std::string_view text) noexcept {
  body_->end(stopped_or_failed, text);
}

}  // namespace o80
