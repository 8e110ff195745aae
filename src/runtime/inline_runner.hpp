#pragma once

namespace o80 {

/// Runs the iterations that a frontend asks for in the frontend's own thread (an inline robot).
class InlineRunner {
 public:
  virtual ~InlineRunner() = default;
  /// Runs until the backend stands still. Throws DriverError.
  virtual void run() = 0;
  /// Throws Error in a thread that is inside `run` (a handler of a signal, say).
  virtual void refuse_nested() const = 0;
  /// This thread is inside `run`.
  virtual bool runs_here() const noexcept = 0;
};

}  // namespace o80
