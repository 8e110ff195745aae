#pragma once

#include <memory>

#include "o80/runtime/batch.hpp"
#include "o80/runtime/frontend.hpp"

namespace o80 {

/// Neither movable nor copyable: takes exclusive control, and gives it back at its end, however
/// that comes. Blocks of one frontend may overlap: the end of the last one gives control back.
///
/// Writer: one thread at a time; other blocks of the frontend in any threads.
class ControlBlock {
 public:
  /// Sends the order to take control. Throws as UntypedFrontend::pulse.
  explicit ControlBlock(std::shared_ptr<UntypedFrontend> frontend);
  ControlBlock& operator=(ControlBlock&&) = delete;
  ~ControlBlock();

  /// The order to take control, which is completed once this frontend has it.
  const Batch& taken() const { return taken_; }
  /// Ends the block and returns the order to give control back; it is empty while other blocks
  /// last. Throws as UntypedFrontend::pulse; then the destructor tries again.
  Batch leave();
  /// The same; what cannot be sent is forgotten.
  void leave_quietly() noexcept;

 private:
  std::shared_ptr<UntypedFrontend> frontend_;  // null after the end
  Batch taken_;
};

}  // namespace o80
