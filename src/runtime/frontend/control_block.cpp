#include "runtime/frontend/control_block.hpp"

#include <mutex>
#include <utility>

#include "control/sending/batch_builder.hpp"
#include "runtime/frontend/link.hpp"

namespace o80 {

ControlBlock::ControlBlock(std::shared_ptr<UntypedFrontend> frontend)
    : frontend_(std::move(frontend)) {
  Link& link = *frontend_->link();
  link.check_usable();
  const std::scoped_lock lock(link.controlling);
  ++link.control_blocks;
  try {
    BatchBuilder batch;
    batch.take_control();
    taken_ = frontend_->pulse(batch);
  } catch (...) {
    leave_quietly();
    throw;
  }
}

ControlBlock::~ControlBlock() { leave_quietly(); }

Batch ControlBlock::leave() {
  if (!frontend_) return {};
  Link& link = *frontend_->link();
  link.check_usable();
  const std::scoped_lock lock(link.controlling);
  Batch released;
  if (link.control_blocks == 1) {
    BatchBuilder batch;
    batch.release_control();
    released = frontend_->pulse(batch);
  }
  --link.control_blocks;
  frontend_.reset();
  return released;
}

/// If nothing can be sent, there is no control to give back: a closed frontend has no lane, a
/// forked child no control.
void ControlBlock::leave_quietly() noexcept {
  try {
    leave();
  } catch (const std::exception&) {
    Link& link = *frontend_->link();
    if (!link.segment.forked()) {
      const std::scoped_lock lock(link.controlling);
      --link.control_blocks;
    }
    frontend_.reset();
  }
}

}  // namespace o80
