#include "runtime/frontend/link.hpp"

#include <chrono>
#include <iterator>

#include "describe/table.hpp"
#include "memory/os/atomic_words.hpp"
#include "memory/segment/queue_word.hpp"

namespace o80 {

namespace {
std::shared_ptr<const Description> describe(const AttachedSegment& segment) {
  auto description = std::make_shared<Description>();
  description->schema = schema_from_bytes(segment.schema());
  description->layout = row_layout(description->schema);
  description->epoch = segment.header().epoch;
  if (description->layout.size != segment.header().shape.row_bytes) {
    throw SegmentError("segment '" + segment.name() + "' has rows of " +
                       std::to_string(segment.header().shape.row_bytes) +
                       " bytes, but its schema needs " + std::to_string(description->layout.size) +
                       ": the file is damaged; start its backend again");
  }
  return description;
}
}  // namespace

void refuse_if_played(const AttachedSegment& segment) {
  if (!is_played(segment)) return;
  throw ReadOnly("'" + segment.name() + "' is a recording that is being played (pid " +
                 std::to_string(segment.header().pid) +
                 "): it can be read, but takes no commands, requests or halts");
}

Link::Link(AttachedSegment attached, std::shared_ptr<InlineRunner> inline_runner)
    : segment(std::move(attached)),
      description(describe(segment)),
      command_check(description->schema),
      history(segment.view()),
      rows(segment),
      runner(std::move(inline_runner)),
      // two status slots for each block; commands leave the same share of both free
      ids(2 * std::uint64_t{segment.view().shape.lane_blocks},
          2 * std::uint64_t{kept_free(segment.view().shape.lane_blocks)}),
      sent_commands(description->schema.actuators.size()) {}

std::shared_ptr<LaneSender> Link::lane() {
  check_usable();
  if (!lane_) {
    segment.throw_if_gone();
    lane_ = std::make_shared<LaneSender>(segment);
    // a sign of life every quarter of the silence limit, so that three late ones are tolerated
    const SchemaHead& head = description->schema.head;
    const std::int64_t most = kSlice * 4 / std::max<std::int64_t>(1, head.period);
    if (head.silence > 0) lane_->show_life_every(std::min(head.silence, most) * head.period / 4);
  }
  return lane_;
}

std::shared_ptr<LaneSender> Link::lane_if_taken() const {
  segment.check_process();
  const std::scoped_lock lock(sending);
  return lane_;
}

void Link::check_usable() const {
  segment.check_process();
  if (closed.load(std::memory_order_relaxed)) {
    throw Closed("the frontend of '" + segment.name() + "' was closed: open a new one");
  }
}

std::unique_lock<std::mutex> Link::lock_to_send() const {
  segment.check_process();
  std::unique_lock lock(sending);
  check_usable();
  return lock;
}

std::unique_lock<std::mutex> Link::lock_to_add() const {
  refuse_if_played(segment);
  return lock_to_send();
}

bool Link::has_replaced(CommandId id, Iteration iteration,
                        std::span<const SentCommand> command) const {
  const std::scoped_lock lock(sending);
  return std::ranges::any_of(command, [&](const SentCommand& each) {
    return sent_commands.has_replaced(id, iteration, each);
  });
}

std::optional<Halt> Link::halt() const {
  const bool maps_bell = segment.access() == Access::read_write;
  return maps_bell ? requested_halt(segment.view()) : shown_halt(segment.view());
}

std::string Link::halt_text(Iteration iteration) const {
  // A resume takes one iteration, so the halt in force is the one that ended something in
  // `iteration` exactly if it began at or before that iteration.
  const std::optional<Halt> acting = shown_halt(segment.view());
  if (!acting || acting->iteration < 0 || acting->iteration > iteration) return "";
  return "it is halted since " + o80::halt_text(*acting);
}

std::string Link::owner_of(std::uint32_t lane) const {
  if (lane >= segment.view().shape.lanes) return "another frontend";
  const auto name = [lane](const AttachedSegment& of) {
    const LaneSenderPage& page = of.view().lane(lane);
    return "the frontend of " + load_text(page.owner, std::size(page.owner));
  };
  if (segment.access() == Access::read_write) return name(segment);
  try {
    const AttachedSegment again = AttachedSegment::attach(segment.name(), Access::read_write,
                                                          Deadline(std::chrono::nanoseconds(0)));
    return again.epoch() == segment.epoch() ? name(again) : "a frontend";
  } catch (const Error&) {
    return "a frontend";  // this user may not see whose lane it is
  }
}

std::string Link::queue_text() const {
  const std::optional<QueueHolder> holder = queue_holder(segment.view());
  if (!holder) return "";
  const std::string owner = owner_of(holder->lane);
  const std::string since = " since iteration " + std::to_string(holder->since);
  return holder->bursts
             ? "a burst of " + owner + " has been running" + since
             : "most of the queue is from " + owner + "; batches have been waiting" + since;
}

KeepWaiting Link::guarded(const KeepWaiting& keep_waiting) const {
  return [this, &keep_waiting] {
    if (closed.load(std::memory_order_relaxed)) {
      throw Closed("the frontend of '" + segment.name() + "' was closed while it waited");
    }
    return !keep_waiting || keep_waiting();
  };
}

}  // namespace o80
