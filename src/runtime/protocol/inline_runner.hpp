#pragma once

namespace o80 {

/// Runs the iterations that a frontend requests in the thread of that frontend (an inline robot).
class InlineRunner {
 public:
  virtual ~InlineRunner() = default;
  /// Runs iterations until none is granted. Throws DriverError.
  virtual void run() = 0;
  /// Throws Error if this thread is inside `run`, for example in a signal handler.
  virtual void refuse_nested() const = 0;
  /// True if this thread is inside `run`.
  virtual bool runs_here() const noexcept = 0;
};

}  // namespace o80
