#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <vector>

namespace o80 {

/// Converts journals of the first files into version 1 of the format: they hold the layout that
/// entries had in memory then. Converts one journal in its order.
class JournalVersion0 {
 public:
  JournalVersion0();
  JournalVersion0& operator=(JournalVersion0&&) = delete;
  ~JournalVersion0();

  /// Appends the first entry in `bytes` to `to`; returns its length in `bytes`, 0 if it is invalid.
  std::size_t convert(std::span<const std::byte> bytes, std::vector<std::byte>& to);

 private:
  class Body;
  std::unique_ptr<Body> body_;
};

}  // namespace o80
