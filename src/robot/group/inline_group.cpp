#include "robot/group/inline_group.hpp"

#include <sched.h>

#include <algorithm>
#include <cstring>
#include <iterator>
#include <optional>

#include "base/sentence.hpp"
#include "control/batch/command_check.hpp"
#include "control/sending/batch_builder.hpp"
#include "memory/os/futex.hpp"
#include "memory/segment/signal.hpp"
#include "robot/group/descriptor_limit.hpp"
#include "runtime/frontend/link.hpp"
#include "runtime/frontend/sending.hpp"

namespace o80 {

namespace {

/// Files of a copy: three of its backend, three of its frontend, three of another frontend.
constexpr std::size_t kDescriptorsPerCopy = 9;
constexpr std::int64_t kClosePoll = 1'000'000;  // [ns]
constexpr std::size_t kMaxNamed = 3;            // failed copies in the text of an error

/// The group whose call this thread works for.
thread_local const InlineGroup* working_for = nullptr;

std::size_t threads_of(const InlineGroup::Options& options) {
  if (options.threads > 0) return options.threads;
  cpu_set_t allowed;
  CPU_ZERO(&allowed);
  const bool known = sched_getaffinity(0, sizeof allowed, &allowed) == 0;
  const auto processors = known ? static_cast<std::size_t>(CPU_COUNT(&allowed)) : 1;
  return std::clamp<std::size_t>(processors, 1, std::max<std::size_t>(1, options.copies));
}

std::string text_of(const std::exception_ptr& error) {
  try {
    std::rethrow_exception(error);
  } catch (const std::exception& thrown) {
    return thrown.what();
  } catch (...) {
    return "an unknown exception";
  }
}

std::string text_of(const std::string& group, const std::vector<CopyFailed::Failure>& failures) {
  std::string text = "copy " + std::to_string(failures.front().copy) + " of '" + group +
                     "' failed: " + text_of(failures.front().error);
  if (failures.size() == 1) return text;
  text = sentence(text) + " So did ";
  for (std::size_t i = 1; i < failures.size() && i < kMaxNamed; ++i) {
    text += (i == 1 ? "copy " : ", copy ") + std::to_string(failures[i].copy);
  }
  if (failures.size() > kMaxNamed) {
    text += " and " + std::to_string(failures.size() - kMaxNamed) + " more";
  }
  return text;
}

/// The part of one copy in memory that has a part for each of `copies`.
template <class Bytes>
Bytes part_of(Bytes all, std::size_t copies, std::size_t copy) {
  const std::size_t size = all.size() / copies;
  return all.subspan(copy * size, size);
}

void refuse_size(const char* what, std::size_t given, std::size_t wanted, const char* unit) {
  if (given == wanted) return;
  throw InvalidArgument(std::string("the ") + what + " of a call of a group take " +
                        std::to_string(wanted) + ' ' + unit + ", the memory given has " +
                        std::to_string(given));
}

}  // namespace

struct InlineGroup::Copy {
  explicit Copy(std::shared_ptr<InlineRobot> inline_robot)
      : robot(std::move(inline_robot)),
        frontend(robot->backend(), robot),
        row(frontend.layout().size / 8) {}

  std::byte* bytes() noexcept { return reinterpret_cast<std::byte*>(row.data()); }

  std::shared_ptr<InlineRobot> robot;
  UntypedFrontend frontend;
  std::vector<std::uint64_t> row;  // the newest one, for requests
  std::exception_ptr error;        // of this call
  bool chosen = false;             // for this call
};

/// Marks the group as running while it lives: in a call of its own, or in that of a `leader`, which
/// has claimed the threads.
class InlineGroup::Call {
 public:
  explicit Call(InlineGroup& group, InlineGroup* leader = nullptr)
      : group_(group), outer_(innermost_) {
    group.check_usable();
    std::uint32_t free = 0;
    if (!group.running_.compare_exchange_strong(free, 1, std::memory_order_acquire)) {
      throw Error("the group of '" + group.name_ +
                  "' runs a call of another thread (or is this a signal handler?): call it from "
                  "one thread at a time");
    }
    if (leader == nullptr && !group.pool_->try_claim()) {
      group.running_.store(0, std::memory_order_release);
      throw Error("the threads of the group of '" + group.name_ +
                  "' run a call of the group that it shares them with: call one after the other");
    }
    group.leader_.store(leader, std::memory_order_relaxed);
    innermost_ = this;
  }
  Call& operator=(Call&&) = delete;
  ~Call() {
    innermost_ = outer_;
    if (group_.leader_.exchange(nullptr, std::memory_order_relaxed) == nullptr) {
      group_.pool_->release();
    }
    group_.running_.store(0, std::memory_order_release);
  }
  /// True if this thread has called the group and the call has not returned: in a signal handler.
  static bool is_within(const InlineGroup* group) noexcept {
    const Call* call = innermost_;
    while (call != nullptr && &call->group_ != group) call = call->outer_;
    return call != nullptr;
  }

 private:
  inline static thread_local const Call* innermost_ = nullptr;  // of this thread

  InlineGroup& group_;
  const Call* outer_;
};

BackendOptions InlineGroup::default_options() {
  BackendOptions options;
  options.history = 64;
  options.lanes = 2;
  options.lane_blocks = 256;
  options.journal = 0;
  return options;
}

InlineGroup::InlineGroup(const RobotTable& table, const OptionValues& options, const Options& group,
                         const KeepWaiting& keep_waiting)
    : name_(table.name),
      halted_(std::make_shared<std::vector<std::atomic<bool>>>(group.copies)),
      otherwise_(keep_waiting),
      may_continue_([this] { return may_continue(); }),
      pool_(group.sharing != nullptr ? group.sharing->pool_
                                     : std::make_shared<WorkerPool>(threads_of(group) - 1)) {
  if (group.copies == 0) throw InvalidArgument("a group needs at least one copy, got 0");
  allow_descriptors(group.copies * kDescriptorsPerCopy,
                    std::to_string(group.copies) + " copies of '" + name_ + "'");
  copies_.reserve(group.copies);
  for (std::size_t i = 0; i < group.copies; ++i) {
    add_copy(table, options, group.backend);
    if (keep_waiting && !keep_waiting()) {
      throw Cancelled("the start of the group of '" + name_ + "' was cancelled by the caller");
    }
  }
}

InlineGroup::~InlineGroup() { close(); }

void InlineGroup::add_copy(const RobotTable& table, const OptionValues& options,
                           const BackendOptions& backend) {
  BackendOptions own = backend;
  own.segment = name_ + "[" + std::to_string(copies_.size()) + "]";
  own.anonymous = true;
  copies_.push_back(std::make_unique<Copy>(std::make_shared<InlineRobot>(
      std::make_unique<DriverInstance>(table, options), std::move(own), may_continue_,
      std::shared_ptr<std::atomic<bool>>(halted_, &(*halted_)[copies_.size()]))));
  const auto schema_of = [](const Copy& copy) { return copy.frontend.link()->segment.schema(); };
  if (!std::ranges::equal(schema_of(*copies_.back()), schema_of(*copies_.front()))) {
    throw DriverError("copy " + std::to_string(copies_.size() - 1) + " of '" + name_ +
                      "' has another description than copy 0: all copies of a group must have "
                      "the same");
  }
}

const Description& InlineGroup::description() const {
  return *copies_.front()->frontend.link()->description;
}

std::uint32_t InlineGroup::request_index(const std::string& name) const {
  return copies_.front()->frontend.request_index(name);
}

void InlineGroup::check_usable() const {
  // called in every burst: no text is built unless it is thrown
  if (guard_.forked()) guard_.check("the group of '" + name_ + "'");
  if (closed_.load(std::memory_order_relaxed)) {
    throw Closed("the group of '" + name_ + "' was closed: start a new one");
  }
}

std::shared_ptr<UntypedFrontend> InlineGroup::attach(std::size_t copy) const {
  check_usable();
  const std::shared_ptr<InlineRobot>& robot = at(copy).robot;
  return std::make_shared<UntypedFrontend>(robot->backend(), robot);
}

void InlineGroup::publish_as(std::size_t copy, const std::string& name) {
  const Call call(*this);
  at(copy).robot->publish_as(name);
  published_ = true;
}

InlineGroup::Copy& InlineGroup::at(std::size_t copy) const {
  if (copy >= copies_.size()) {
    throw InvalidArgument("the group of '" + name_ + "' has copies 0 to " +
                          std::to_string(copies_.size() - 1) + ", there is no copy " +
                          std::to_string(copy));
  }
  return *copies_[copy];
}

// ------------------------------------------------------------------------------ a call

/// True inside a call of this group, or of one that it follows, in one of the threads of that call.
bool InlineGroup::runs_here() const noexcept {
  const auto is_inside = [](const InlineGroup* group) {
    return group != nullptr && (working_for == group || Call::is_within(group));
  };
  return is_inside(this) || is_inside(leader_.load(std::memory_order_relaxed));
}

/// Whether the iterations of a copy continue; called about every 50 ms of a burst.
bool InlineGroup::may_continue() {
  InlineGroup* const leader = leader_.load(std::memory_order_relaxed);
  if (leader != nullptr && working_for == leader) return leader->may_continue();
  // a frontend of a single copy
  if (working_for != this) return !otherwise_ || otherwise_();
  if (std::this_thread::get_id() == caller_) poll();
  return !cancelled_.load(std::memory_order_relaxed);
}

/// In the calling thread: asks every 50 ms whether the call continues.
void InlineGroup::poll() noexcept {
  const std::int64_t now = monotonic_now();
  if (now < ask_at_ || cancelled_.load(std::memory_order_relaxed)) return;
  ask_at_ = now + kSlice;
  bool cancelled = false;
  try {
    cancelled = *ask_ && !(*ask_)();
  } catch (...) {
    requested_ = std::current_exception();
    cancelled = true;
  }
  timed_out_ = !cancelled && deadline_.over();
  if (cancelled || timed_out_) cancelled_.store(true, std::memory_order_relaxed);
}

/// Calls each(place, copy) for the chosen copies, on all threads: the place in `chosen`, and there
/// the number of the copy.
template <class Each>
void InlineGroup::for_each(std::span<const std::uint32_t> chosen, Timeout timeout,
                           const KeepWaiting& keep_waiting, Each&& each) {
  const Call call(*this);
  choose(chosen);
  ask_ = &keep_waiting;
  ask_at_ = monotonic_now() + kSlice;
  deadline_ = Deadline(timeout);
  caller_ = std::this_thread::get_id();
  const auto task = [&](std::uint32_t place) noexcept {
    if (cancelled_.load(std::memory_order_relaxed)) return;
    const InlineGroup* const before = std::exchange(working_for, this);
    try {
      each(place, chosen[place]);
    } catch (...) {
      copies_[chosen[place]]->error = std::current_exception();
      failed_.store(true, std::memory_order_relaxed);
    }
    working_for = before;
  };
  const auto poll_caller = [this]() noexcept { poll(); };
  pool_->run(static_cast<std::uint32_t>(chosen.size()), task, poll_caller);
  if (guard_.forked()) check_usable();
  if (failed_.load(std::memory_order_relaxed) || cancelled_.load(std::memory_order_relaxed)) {
    throw_failures();
  }
}

/// Throws InvalidArgument unless each number is that of a copy and occurs once.
void InlineGroup::choose(std::span<const std::uint32_t> chosen) {
  std::size_t valid = 0;
  while (valid < chosen.size() && chosen[valid] < copies_.size() &&
         !std::exchange(copies_[chosen[valid]]->chosen, true)) {
    ++valid;
  }
  for (const std::uint32_t copy : chosen.first(valid)) copies_[copy]->chosen = false;
  if (valid == chosen.size()) return;
  at(chosen[valid]);
  throw InvalidArgument("copy " + std::to_string(chosen[valid]) + " of '" + name_ +
                        "' is named twice: name each copy once");
}

/// Ends a call that was cancelled or in which copies failed.
void InlineGroup::throw_failures() {
  std::vector<CopyFailed::Failure> failures;
  for (std::size_t i = 0; i < copies_.size(); ++i) {
    if (copies_[i]->error) failures.push_back({i, std::exchange(copies_[i]->error, nullptr)});
  }
  failed_ = false;
  const bool cancelled = cancelled_.exchange(false);
  const bool timed_out = std::exchange(timed_out_, false);
  if (const std::exception_ptr requested = std::exchange(requested_, nullptr)) {
    std::rethrow_exception(requested);
  }
  check_usable();  // closed during the call
  if (timed_out) {
    throw TimeoutError("the call of the group of '" + name_ +
                       "' was not done in time: pass a longer timeout. Each copy is between two "
                       "iterations");
  }
  if (cancelled) throw Cancelled("the call of the group of '" + name_ + "' was cancelled");
  throw CopyFailed(text_of(name_, failures), failures);
}

// ------------------------------------------------------------------------------ what a call does

void InlineGroup::check(const BurstPlan& plan) const {
  const CommandCheck& robot = copies_.front()->frontend.command_check();
  const Schema& schema = description().schema;
  std::size_t states = 0;
  for (const std::uint32_t actuator : plan.actuators) {
    const std::uint32_t index = robot.actuator(std::int64_t{actuator});
    states += schema.types[schema.actuators[index].type].size;
  }
  refuse_size("targets", plan.targets.size(), copies() * plan.steps * states, "bytes");
  if (plan.iterations < 1) {
    throw InvalidArgument("the iterations of a burst must be at least 1, got " +
                          std::to_string(plan.iterations));
  }
  if (plan.delay < 0 || plan.delay >= plan.iterations) {
    throw InvalidArgument("the delay of a burst of " + std::to_string(plan.iterations) +
                          " iterations must be at least 0 and less than these, got " +
                          std::to_string(plan.delay));
  }
  const auto iterations = static_cast<std::size_t>(plan.iterations);
  refuse_size("rows", plan.rows.size(), copies() * iterations * description().layout.size, "bytes");
  const std::uint64_t kept = copies_.front()->frontend.link()->history.rows();
  if (iterations > kept) {
    throw InvalidArgument("the " + std::to_string(iterations) + " rows of a burst of '" + name_ +
                          "' do not fit into its history of " + std::to_string(kept) +
                          ": start the group with history=" + std::to_string(iterations));
  }
  if (plan.then != nullptr) check_following(plan);
}

void InlineGroup::check_following(const BurstPlan& plan) const {
  const Following& then = *plan.then;
  if (then.group == this || then.group->pool_ != pool_ || then.group->copies() != copies()) {
    throw InvalidArgument("the group of '" + then.group->name_ + "' must have as many copies as '" +
                          name_ + "', and share its threads: start it with threads=first_group");
  }
  if (then.plan->steps != plan.iterations) {
    throw InvalidArgument("a burst that follows one of " + std::to_string(plan.iterations) +
                          " iterations needs one step for each, got " +
                          std::to_string(then.plan->steps));
  }
  const std::size_t last = then.plan->steps - 1;
  const std::size_t own = then.plan->targets.size() / copies();
  for (const Feed& feed : then.feeds) {
    const bool fits = std::size_t{feed.from} + feed.size <= description().layout.size &&
                      feed.to + last * feed.stride + feed.size <= own;
    if (!fits) throw InvalidArgument("a number of the rows lies outside of rows or targets");
  }
}

void InlineGroup::burst(const BurstPlan& plan, std::span<const std::uint32_t> chosen,
                        Timeout timeout, const KeepWaiting& keep_waiting, const Instead& instead) {
  const Following* const then = plan.then;
  const auto payload_of = [&](std::uint32_t i) { return part_of(instead.payloads, copies(), i); };
  if (!instead.copies.empty()) {
    if (then != nullptr) throw InvalidArgument("a burst that another one follows takes no request");
    refuse_size("choice", instead.copies.size(), copies(), "flags");
    const CommandCheck& robot = copies_.front()->frontend.command_check();
    for (std::uint32_t i = 0; i < copies(); ++i) {
      if (instead.copies[i] != 0) robot.request(instead.request, payload_of(i));
    }
  }
  const bool may_be_direct = this->may_be_direct(plan);
  const bool follows_directly = then != nullptr && then->group->may_be_direct(*then->plan);
  std::optional<Call> following;
  if (then != nullptr) following.emplace(*then->group, this);
  for_each(chosen, timeout, keep_waiting, [&](std::uint32_t, std::uint32_t i) {
    if (!instead.copies.empty() && instead.copies[i] != 0) {
      request_copy(instead.request, payload_of(i), i);
      return show_last_row(i, part_of(plan.rows, copies(), i));
    }
    burst_copy(plan, may_be_direct, i);
    if (then != nullptr) follow(plan, follows_directly, i);
  });
}

void InlineGroup::BurstPlan::add_targets(UntypedFrontend& frontend,
                                         std::span<const std::byte> own) const {
  if (is_each_iteration(command.pace)) {
    frontend.add_set_points(actuators, steps, own, command.mode);
  } else {
    frontend.add_trajectories(actuators, steps, own, command);
  }
}

void InlineGroup::burst_copy(const BurstPlan& plan, bool may_be_direct, std::uint32_t i) {
  Copy& copy = *copies_[i];
  const std::span<const std::byte> to = part_of(plan.targets, copies(), i);
  const std::span<std::byte> own = part_of(plan.rows, copies(), i);
  try {
    if (!may_be_direct || !burst_directly(copy, plan, to, own)) {
      if (!plan.actuators.empty()) plan.add_targets(copy.frontend, to);
      PulseOptions pulse;
      if (plan.delay > 0) pulse.at = copy.frontend.published() + 1 + plan.delay;
      copy.frontend.burst_rows(own, {}, may_continue_, pulse);
    }
  } catch (const BackendHalted&) {
    show_last_row(i, own);
    throw;
  }
  read_gathered(i, own.data() + own.size() - description().layout.size);
}

/// After a request, or a halt that has ended a burst: all that a copy shows is its last row, in
/// each of `rows`.
void InlineGroup::show_last_row(std::uint32_t i, std::span<std::byte> rows) {
  Copy& copy = *copies_[i];
  const std::size_t size = description().layout.size;
  copy.frontend.latest(copy.bytes());
  for (std::size_t at = 0; at < rows.size(); at += size) {
    std::memcpy(rows.data() + at, copy.bytes(), size);
  }
  read_gathered(i, copy.bytes());
}

/// Rows of the copy => targets of the copy that follows => its burst.
void InlineGroup::follow(const BurstPlan& plan, bool may_be_direct, std::uint32_t i) {
  const Following& then = *plan.then;
  const std::size_t size = description().layout.size;
  const std::byte* rows = part_of(plan.rows, copies(), i).data();
  std::byte* targets = part_of(then.plan->targets, copies(), i).data();
  for (const Feed& feed : then.feeds) {
    for (std::size_t step = 0; step < then.plan->steps; ++step) {
      std::byte* to = targets + feed.to + step * feed.stride;
      const std::byte* from = rows + step * size + feed.from;
      if (feed.size == sizeof(double)) {  // mostly: no call
        std::memcpy(to, from, sizeof(double));
      } else {
        std::memcpy(to, from, feed.size);
      }
    }
  }
  then.group->burst_copy(*then.plan, may_be_direct, i);
}

/// True if the targets of each actuator are for consecutive iterations of the burst.
bool InlineGroup::may_be_direct(const BurstPlan& plan) const {
  const std::size_t actuators = description().schema.actuators.size();
  for (auto each = plan.actuators.begin(); each != plan.actuators.end(); ++each) {
    const bool again = std::find(plan.actuators.begin(), each, *each) != each;
    if (*each >= actuators || again) return false;  // the batch says what is wrong
  }
  return is_each_iteration(plan.command.pace) && plan.steps > 0 &&
         static_cast<std::int64_t>(plan.steps) <= plan.iterations - plan.delay;
}

/// Runs the burst of a copy without a batch. False if it needs one.
bool InlineGroup::burst_directly(Copy& copy, const BurstPlan& plan,
                                 std::span<const std::byte> targets,
                                 std::span<std::byte> rows) const {
  Link& link = *copy.frontend.link();
  link.check_usable();
  if (!link.builder.empty()) return false;
  // the batch says which target is wrong
  if (!link.command_check.admits(plan.actuators, plan.steps, targets.data())) return false;
  DirectBurst burst{plan.iterations, plan.delay, {}};
  if (!plan.actuators.empty()) {
    burst.targets = {plan.actuators, plan.steps, targets.data(), plan.command.mode, 0};
  }
  const std::optional<std::size_t> done = copy.robot->run(burst, rows);
  if (!done) return false;
  if (static_cast<std::int64_t>(*done) == plan.iterations) return true;
  link.segment.throw_if_gone();
  throw_cut(link, copy.frontend.published());
}

void InlineGroup::request(std::uint32_t request, std::span<const std::uint32_t> chosen,
                          std::span<const std::byte> payloads, Timeout timeout,
                          const KeepWaiting& keep_waiting, std::span<std::byte> rows) {
  check_usable();
  const std::size_t wanted = rows.empty() ? 0 : copies() * description().layout.size;
  refuse_size("rows", rows.size(), wanted, "bytes");
  const auto payload_of = [&](std::size_t i) { return part_of(payloads, chosen.size(), i); };
  const CommandCheck& robot = copies_.front()->frontend.command_check();
  for (std::size_t i = 0; i < chosen.size(); ++i) robot.request(request, payload_of(i));
  for_each(chosen, timeout, keep_waiting, [&](std::uint32_t place, std::uint32_t i) {
    request_copy(request, payload_of(place), i);
    show_last_row(i, part_of(rows, copies(), i));
  });
}

void InlineGroup::request_copy(std::uint32_t request, std::span<const std::byte> payload,
                               std::uint32_t i) {
  UntypedFrontend& frontend = copies_[i]->frontend;
  BatchBuilder batch;
  batch.request(static_cast<std::uint16_t>(request), payload);
  const Batch sent = frontend.pulse_to_end(batch);
  frontend.wait_until_ended(sent, {}, may_continue_);
  const Handle handle = sent.handle(0);
  if (handle.status == Status::completed) return;
  const std::string text = "request '" + description().schema.requests[request].name.str() +
                           "' was not completed: " + handle.text;
  if (handle.status == Status::halted) throw BackendHalted(text);
  throw Error(text);
}

std::vector<std::pair<std::size_t, Halt>> InlineGroup::halted() const {
  check_usable();
  std::vector<std::pair<std::size_t, Halt>> found;
  if (!may_be_halted()) return found;
  for (std::size_t i = 0; i < copies_.size(); ++i) {
    if (const std::optional<Halt> halt = copies_[i]->frontend.halted())
      found.emplace_back(i, *halt);
  }
  return found;
}

void InlineGroup::resume(std::span<const std::uint32_t> chosen, Timeout timeout,
                         const KeepWaiting& keep_waiting) {
  check_usable();
  // usually none is: no thread is woken then
  std::vector<std::uint32_t> halted;
  std::ranges::copy_if(chosen, std::back_inserter(halted),
                       [&](std::uint32_t i) { return at(i).frontend.halted().has_value(); });
  if (halted.empty()) return;
  for_each(halted, timeout, keep_waiting, [&](std::uint32_t, std::uint32_t i) {
    Copy& copy = *copies_[i];
    // the braking has ended in the iteration after the first row that shows none
    for (bool is_at_rest = false; !is_at_rest; copy.frontend.burst(1, {}, may_continue_)) {
      const UntypedObservation row = copy.frontend.latest();
      is_at_rest = row.head().halted != 0 && !row.any_braking();
    }
    const std::optional<Halt> halt = copy.frontend.halted();
    if (halt) copy.frontend.resume(halt->number, {}, may_continue_);
    show_last_row(i, {});
  });
}

void InlineGroup::latest(std::span<const std::uint32_t> chosen, std::span<std::byte> rows) {
  const std::size_t row = description().layout.size;
  refuse_size("rows", rows.size(), chosen.size() * row, "bytes");
  const Call call(*this);
  choose(chosen);
  for (std::size_t i = 0; i < chosen.size(); ++i) {
    copies_[chosen[i]]->frontend.latest(rows.data() + i * row);
  }
}

void InlineGroup::gather(RowGather gather, Gathered memory) {
  refuse_size("observations", memory.observations.size(), copies() * gather.numbers.size(),
              "numbers");
  refuse_size("flags", memory.flags.size(), copies() * gather.flags.size(), "flags");
  const Call call(*this);
  gather_ = std::move(gather);
  gathered_ = memory;
  for (std::uint32_t i = 0; i < copies_.size(); ++i) show_last_row(i, {});
}

void InlineGroup::read_gathered(std::uint32_t copy, const std::byte* row) noexcept {
  const std::size_t numbers = gather_.numbers.size();
  const std::size_t flags = gather_.flags.size();
  gather_.read(row, gathered_.observations.subspan(copy * numbers, numbers),
               gathered_.flags.subspan(copy * flags, flags));
}

void InlineGroup::close() noexcept {
  closed_.store(true, std::memory_order_relaxed);
  for (const auto& copy : copies_) {
    if (copy->robot) copy->robot->stop();
  }
  // in a signal handler during a call: the end of that call, which throws Closed, comes later
  if (runs_here() || guard_.forked()) return;
  while (running_.load(std::memory_order_acquire) != 0) futex_wait(running_, 1, kClosePoll);
  for (const auto& copy : copies_) {
    copy->frontend.close();
    copy->robot.reset();  // a published segment goes with it
  }
}

}  // namespace o80
