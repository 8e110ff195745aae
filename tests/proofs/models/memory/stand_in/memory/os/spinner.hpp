#pragma once

namespace o80 {

/// A spin is a look at the same words, which the sleep does too.
class Spinner {
 public:
  static constexpr long kLongest = 50'000;  // longest spin [ns]

  template <class Done>
  bool spin(Done&& done) noexcept {
    return done();
  }
};

}  // namespace o80
