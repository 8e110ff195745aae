#pragma once

namespace o80 {

/// A spin is a look at the same words, which the sleep does too.
class Spinner {
 public:
  template <class Done>
  bool spin(Done&& done) noexcept {
    return done();
  }
};

}  // namespace o80
