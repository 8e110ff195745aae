// How a frontend halts, resumes and shows life.

#include "o80/memory/segment_file.hpp"
#include "o80/runtime/frontend.hpp"

namespace o80 {

std::uint64_t UntypedFrontend::halt(std::string_view reason) {
  link_->check_usable();
  if (link_->segment.access() != Access::read_write) {
    throw ReadOnly("'" + segment() +
                   "' was attached to read only: attach again without it to halt");
  }
  link_->segment.throw_if_gone();
  const std::uint64_t number =
      ask_for_halt(link_->segment.view(), HaltCause::frontend, own_process(), reason);
  // an inline robot latches it now, unless a burst in this very thread is about to
  std::shared_ptr<InlineRunner> runner;
  {
    const std::scoped_lock lock(link_->sending);
    runner = link_->runner;
  }
  if (runner && !runner->runs_here()) runner->run();
  return number;
}

std::optional<Halt> UntypedFrontend::halted() const {
  link_->check_usable();
  return link_->halt();
}

void UntypedFrontend::resume(std::uint64_t number, Timeout timeout, const Check& check) {
  BatchBuilder builder;
  builder.resume(number);
  const Batch batch = pulse(builder);
  batch.wait(timeout, check);
  if (!batch.rejection().empty()) throw_rejected(*link_, "resume", batch);
  const Handle handle = batch.handle(0);
  if (handle.status == Status::completed) return;
  throw BackendHalted("'" + segment() + "' does not resume: " + handle.text);
}

void UntypedFrontend::keep_alive() {
  link_->check_usable();
  if (const auto lane = link_->lane_if_taken()) lane->show_life();
}

std::uint64_t halt(const std::string& segment, std::string_view reason, Timeout timeout,
                   const Check& check) {
  AttachOptions options;
  options.check = check;
  options.starting = true;
  const AttachedSegment attached =
      AttachedSegment::attach(segment, Access::read_write, Deadline(timeout), options);
  return ask_for_halt(attached.view(), HaltCause::frontend, own_process(), reason);
}

}  // namespace o80
