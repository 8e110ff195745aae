#include "o80/runtime/batch.hpp"

#include <algorithm>
#include <unordered_map>

#include "base/printable.hpp"
#include "control/motion/number_plan.hpp"
#include "describe/number_name.hpp"
#include "memory/os/atomic_words.hpp"
#include "memory/segment/running_slot.hpp"
#include "o80/base/error.hpp"
#include "o80/runtime/not_completed.hpp"
#include "runtime/frontend/ends_text.hpp"
#include "runtime/frontend/link.hpp"
#include "runtime/frontend/sending.hpp"

namespace o80 {

/// What copies of a batch share.
struct Batch::Kept {
  std::mutex mutex;
  /// End statuses that were read once; kept because the segment reuses their slots.
  std::unordered_map<CommandId, Handle> ended;
  std::vector<SentCommand> commands;  // constant

  /// Those of one record.
  std::span<const SentCommand> commands_of(std::uint64_t place) const {
    return std::ranges::equal_range(commands, place, {}, &SentCommand::place);
  }
};

Batch::Batch(std::shared_ptr<Link> link, Sent sent)
    : link_(std::move(link)),
      lane_(std::move(sent.lane)),
      id_(sent.id),
      records_(sent.records),
      clipped_(sent.clipped),
      seen_(sent.seen),
      kept_(std::make_shared<Kept>()) {
  kept_->commands = std::move(sent.commands);
}

namespace {

bool is_rejected(const LaneSender& lane, CommandId batch) noexcept {
  const LaneSender::StatusAnswer answer = lane.status(batch);
  return answer.known == LaneSender::Known::yes &&
         static_cast<Status>(answer.word.status) == Status::rejected;
}

/// Describes which bound of an integral ended a command; `packed` as in Limited::packed().
std::string held_by(const Schema& schema, std::span<const SentCommand> commands,
                    std::uint8_t packed) {
  const std::string bound =
      (packed & 7U) == static_cast<unsigned>(Limit::below_integral) ? "minimum" : "maximum";
  for (const SentCommand& command : commands) {
    if (command.index >= schema.actuators.size()) continue;
    for (const IntegralRow& row : schema.integrals) {
      if (row.limit != schema.actuators[command.index].first_limit + (packed >> 3U)) continue;
      ShortText<200> name;
      name_number(schema, command.index, row.number, name);
      return "it is held back at the " + bound + " of the " + std::string(name.view());
    }
  }
  return "it is held back at the " + bound + " of its integral";
}

std::string words_for(const Link& link, std::span<const SentCommand> commands, const Handle& handle,
                      std::uint8_t detail) {
  switch (handle.reason) {
    case Reason::late:
      return "it came after the iteration for which it was sent";
    case Reason::exclusive:
      return link.owner_of(detail) + " has exclusive control";
    case Reason::invalid:
      return (detail & 7U) != 0
                 ? "its target is so far away that it would take more than 2^31 iterations"
                 : "the record was invalid: it was built by another version of o80, or the lane "
                   "was corrupted";
    case Reason::limits:
      return handle.status == Status::interrupted
                 ? held_by(link.description->schema, commands, detail)
                 : late_text(detail, handle.late);
    case Reason::fresh_start:
      return "the robot made a fresh start (reset, restore or resume)";
    case Reason::dead_frontend:
      return "its frontend died";
    case Reason::silence:
      return "its frontend gave no sign of life for longer than the watchdog (silence) allows";
    case Reason::stopped:
      return "the backend stopped";
    case Reason::older:
      return "it answers an older observation than an earlier chunk of its plan";
    case Reason::full:
      return "too many batches of its lane wait for later iterations";
    case Reason::halted: {
      const std::string halt = link.halt_text(handle.iteration);
      return halt.empty() ? "the backend was halted" : halt;
    }
    default:
      return "";
  }
}

}  // namespace

Handle Batch::ask(CommandId id) const {
  link_->segment.check_process();
  {
    const std::scoped_lock lock(kept_->mutex);
    const auto known = kept_->ended.find(id);
    if (known != kept_->ended.end()) return known->second;
  }
  Handle handle;
  handle.id = id;
  const LaneSender::StatusAnswer answer = lane_->status(id);
  if (answer.known == LaneSender::Known::not_yet) {
    handle.status = Status::queued;
    return handle;
  }
  if (answer.known == LaneSender::Known::forgotten) {
    handle.status = Status::forgotten;
    return handle;
  }
  handle.status = static_cast<Status>(answer.word.status);
  handle.reason = static_cast<Reason>(answer.word.reason);
  handle.iteration = answer.word.iteration;
  handle.late = answer.late;
  if (!is_end(handle.status)) {
    if (const auto running = running_request(link_->segment.view(), lane_->lane(), id)) {
      handle.progress = printable(running->progress_text());
    }
    if (handle.reason == Reason::limits) handle.text = late_text(answer.word.detail, handle.late);
    return handle;
  }
  const bool has_message = handle.reason == Reason::driver || handle.reason == Reason::halted ||
                           handle.reason == Reason::reading;
  if (has_message) handle.text = lane_->message(id).value_or("");
  if (handle.text.empty() && handle.reason == Reason::reading &&
      handle.status == Status::interrupted) {
    handle.text = "an implausible reading ended all commands of its actuator";
  }
  const bool is_of_batch = handle.reason == Reason::reading && handle.text.empty();
  if (is_of_batch) handle.text = lane_->message(id_).value_or("");
  if (handle.text.empty())
    handle.text =
        words_for(*link_, kept_->commands_of(id - record_id(id_, 0)), handle, answer.word.detail);
  const std::scoped_lock lock(kept_->mutex);
  kept_->ended.emplace(id, handle);
  return handle;
}

Handle Batch::handle(std::size_t place) const {
  if (place >= records_) {
    throw InvalidArgument("the batch has " + std::to_string(records_) + " records, there is no " +
                          std::to_string(place));
  }
  return ask(record_id(id_, place));
}

std::vector<Handle> Batch::handles() const {
  std::vector<Handle> all;
  all.reserve(records_);
  for (std::size_t i = 0; i < records_; ++i) all.push_back(handle(i));
  return all;
}

bool Batch::ended() const { return records_ == 0 || is_end(ask(id_ + 1).status); }

Iteration Batch::first_iteration() const {
  if (id_ == 0) return -1;
  return ask(id_).iteration;
}

std::optional<Batch::Shift> Batch::shift() const {
  if (id_ == 0) return std::nullopt;
  link_->segment.check_process();
  const LaneSender::StatusAnswer answer = lane_->status(id_);
  if (answer.known != LaneSender::Known::yes ||
      static_cast<Status>(answer.word.status) != Status::active) {
    return std::nullopt;
  }
  const auto taken = TakenChunk::of(answer.word.detail, answer.late);
  return taken ? std::optional<Shift>({taken->shift, taken->stood}) : std::nullopt;
}

std::optional<Batch::TakeOver> Batch::take_over() const {
  if (id_ == 0) return std::nullopt;
  link_->segment.check_process();
  const LaneSender::StatusAnswer answer = lane_->status(id_ + 1);
  const auto status = static_cast<Status>(answer.word.status);
  if (answer.known != LaneSender::Known::yes || status == Status::rejected) return std::nullopt;
  const auto begun = BegunChunk::of(answer.word.detail, answer.late);
  return begun ? std::optional<TakeOver>({begun->row, begun->needed}) : std::nullopt;
}

Iteration Batch::last_iteration() const {
  if (id_ == 0) return -1;
  const Handle handle = ask(id_ + 1);
  return is_end(handle.status) ? handle.iteration : -1;
}

std::optional<DecisionLatency> Batch::decision_latency() const {
  const Iteration first = first_iteration();
  if (!seen_ || first < 0 || first > link_->history.published() || rejected_by() != Reason::none)
    return {};
  UntypedObservation row(link_->description);
  DecisionLatency found;
  if (seen_->since >= 0) found.iterations = first - seen_->since;
  const bool has_time = seen_->time >= 0 && seen_->clock == row.schema().head.clock;
  if (has_time && link_->history.read(first, row.bytes()) && row.time() > seen_->time)
    found.time = row.time() - seen_->time;
  return found;
}

Reason Batch::rejected_by() const {
  if (id_ == 0) return Reason::none;
  const Handle handle = ask(id_);
  return handle.status == Status::rejected ? handle.reason : Reason::none;
}

std::string Batch::rejection() const {
  if (id_ == 0) return "";
  const Handle handle = ask(id_);
  return handle.status == Status::rejected ? handle.text : "";
}

void Batch::wait(Timeout timeout, const KeepWaiting& keep_waiting,
                 const WaitOptions& options) const {
  if (id_ == 0) return;  // an empty batch was never sent
  wait_for_row(Deadline(timeout), keep_waiting);
  if (options.check) throw_unless_completed();
}

void Batch::wait_for_row(const Deadline& deadline, const KeepWaiting& keep_waiting) const {
  const KeepWaiting guarded = link_->guarded(keep_waiting);
  const auto ended = [&] { return is_end(ask(id_ + 1).status); };
  if (lane_->wait_until(ended, deadline, guarded) == Waited::timed_out) {
    const std::string queue = first_iteration() < 0 ? link_->queue_text() : "";
    throw TimeoutError("the batch sent to '" + link_->segment.name() +
                       "' has not ended in time: check its handles, pass a longer timeout, or "
                       "purge" +
                       (queue.empty() ? "" : ". It was not taken yet: " + queue));
  }
  const Handle last = ask(id_ + 1);
  if (last.iteration <= link_->history.published()) return;
  // a bursting backend may wait for a burst before that row; a backend that has ended never
  // publishes it, and the wait for the row raises that
  const auto is_cut = [](const Handle& handle) { return handle.reason == Reason::stopped; };
  const bool paced = link_->description->schema.head.bursting == 0;
  if ((last.status == Status::completed && paced) || is_cut(last) ||
      std::ranges::any_of(handles(), is_cut)) {
    link_->rows.wait_for_row(last.iteration, deadline, guarded);
  }
}

bool Burst::done() const {
  link_->segment.check_process();
  return lane().burst(batch_.id()).known != LaneSender::Known::not_yet ||
         is_rejected(lane(), batch_.id());
}

void Burst::cancel() const {
  link_->segment.check_process();
  lane().cancel_burst(batch_.id());
}

void throw_cut(const Link& link, Iteration last) {
  // the halt began in the iteration after its last row
  const std::string halt = link.halt_text(last + 1);
  throw BackendHalted("the burst of '" + link.segment.name() + "' ended in iteration " +
                      std::to_string(last) + ": " + (halt.empty() ? "it was cut short" : halt));
}

Iteration wait_for_burst(const Link& link, LaneSender& lane, CommandId id, Timeout timeout,
                         const KeepWaiting& keep_waiting,
                         std::optional<std::uint32_t> events_before_send) {
  link.segment.check_process();
  LaneSender::BurstAnswer answer{};
  const auto over = [&] {
    answer = lane.burst(id);
    return answer.known != LaneSender::Known::not_yet || is_rejected(lane, id);
  };
  if (lane.wait_until(over, Deadline(timeout), link.guarded(keep_waiting), events_before_send) ==
      Waited::timed_out) {
    const std::string queue = link.queue_text();
    throw TimeoutError("the burst of '" + link.segment.name() +
                       "' was not done in time: pass a longer timeout, or check whether the burst "
                       "of another frontend comes first" +
                       (queue.empty() ? "" : ". Now " + queue));
  }
  if (answer.known == LaneSender::Known::forgotten) {
    throw RowOverwritten("this burst of '" + link.segment.name() +
                         "' was overwritten by later bursts: wait for it before sending many more");
  }
  if (answer.known != LaneSender::Known::yes) return -1;
  if (answer.end == BurstEnd::cut) throw_cut(link, answer.row);
  return answer.row;
}

namespace {
/// Throws why the backend ended. It rejects batches shortly before it shows that it has ended.
[[noreturn]] void throw_ended(Link& link) {
  constexpr std::chrono::milliseconds kLongestEnd{200};
  const Deadline deadline{Timeout(kLongestEnd)};
  link.rows.wait_for_row(link.history.published() + 1, deadline);
  throw BackendStopped("'" + link.segment.name() + "': its backend is stopping.");
}
}  // namespace

void throw_rejected(Link& link, const char* what, const Batch& batch) {
  if (batch.rejected_by() == Reason::stopped) throw_ended(link);
  const std::string text = "the " + std::string(what) + " sent to '" + link.segment.name() +
                           "' was rejected: " + batch.rejection();
  if (batch.rejected_by() == Reason::halted) throw BackendHalted(text);
  throw Error(text);
}

/// Throws if a record of this batch, which has ended, did not complete.
void Batch::throw_unless_completed() const {
  std::vector<NotCompleted::End> ends;
  std::vector<std::string> texts;
  const Schema& schema = link_->description->schema;
  for (std::uint32_t place = 0; place < records_; ++place) {
    const CommandId id = record_id(id_, place);
    const LaneSender::StatusAnswer answer = lane_->status(id);
    const bool is_known = answer.known == LaneSender::Known::yes;
    if (is_known && static_cast<Status>(answer.word.status) == Status::completed) continue;
    const Handle handle = ask(id);
    if (handle.status == Status::completed || handle.status == Status::forgotten) continue;
    const std::span<const SentCommand> command = kept_->commands_of(place);
    const bool is_overwritten = handle.status == Status::overwritten;
    if (is_overwritten && link_->has_replaced(id, handle.iteration, command)) continue;
    ends.push_back({handle, names_of(schema, command)});
    texts.push_back(end_text(schema, command, handle));
  }
  if (ends.empty()) return;

  const std::string& segment = link_->segment.name();
  const bool is_rejected = rejected_by() != Reason::none;
  for (const auto& [handle, actuators] : ends) {
    if (handle.reason == Reason::stopped) throw_ended(*link_);
    if (is_rejected || (handle.status != Status::halted && handle.reason != Reason::halted)) {
      continue;
    }
    throw BackendHalted("a command sent to '" + segment + "' ended as " +
                        std::string(to_text(handle.status)) + ": " + handle.text);
  }
  if (rejected_by() == Reason::halted) throw_rejected(*link_, "batch", *this);
  UntypedObservation row(link_->description);
  const Iteration last = last_iteration();
  if (last < 0 || !link_->history.read(last, row.bytes())) link_->history.latest(row.bytes());
  throw NotCompleted(is_rejected
                         ? "the batch sent to '" + segment + "' was rejected: " + rejection()
                         : not_completed_text(segment, texts, records_),
                     std::move(ends), std::move(row));
}

Iteration Burst::wait_done(Timeout timeout, const KeepWaiting& keep_waiting) const {
  return wait_for_burst(*link_, lane(), batch_.id(), timeout, keep_waiting);
}

void Burst::throw_if_failed() const {
  // a burst that is done does not fail, even if the backend has gone since
  const bool gone = link_->segment.gone();
  if (done()) {
    if (wait_done(std::chrono::nanoseconds(0)) < 0) throw_rejected(*link_, "burst", batch_);
    return;
  }
  link_->check_usable();
  if (gone) link_->segment.throw_if_gone();
}

void read_last_row(const Link& link, Iteration row, UntypedObservation& observation) {
  if (!link.history.read(row, observation.bytes())) {
    throw RowOverwritten("row " + std::to_string(row) + " of '" + link.segment.name() +
                         "', the last of this burst, was overwritten: use a longer history");
  }
}

UntypedObservation Burst::wait(Timeout timeout, const KeepWaiting& keep_waiting) const {
  UntypedObservation observation(link_->description);  // allocated while the backend works
  const Iteration row = wait_done(timeout, keep_waiting);
  if (row < 0) throw_rejected(*link_, "burst", batch_);
  read_last_row(*link_, row, observation);
  return observation;
}

}  // namespace o80
