#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "base/little_endian.hpp"
#include "memory/ring/journal.hpp"

namespace o80 {

/// memory => file: writes entries in the format of files (journal_format.hpp). Arbitrary entries
/// are safe.
///
/// One object encodes the entries of one journal in their order, because records of a batch may
/// span several of them.
class JournalEncoder {
 public:
  /// Appends one entry to `to`.
  void encode(const JournalHead& head, std::span<const std::byte> payload,
              std::vector<std::byte>& to);

  /// A note in a batch that was encoded.
  struct Mark {
    std::int64_t iteration = 0;  // in which the backend read it
    std::string text;            // as it was sent: any bytes
  };
  /// The marks since the last call.
  std::vector<Mark> take_marks() { return std::exchange(marks_, {}); }

 private:
  /// The batch of a lane whose blocks were read last.
  struct Open {
    std::uint64_t id = 0;
    std::uint64_t blocks = 0;  // read so far; 0: none, or the batch is invalid
    std::uint64_t left = 0;    // bytes of the last record's payload that were not read
    bool in_mark = false;      // the last record is a mark, with this text
    std::string text{};
  };

  void put_payload(LittleEndianWriter& put, const JournalHead& head,
                   std::span<const std::byte> payload);
  void put_records(LittleEndianWriter& put, const JournalHead& head,
                   std::span<const std::byte> blocks);
  void put_record(LittleEndianWriter& put, Open& open, std::int64_t iteration,
                  std::span<const std::byte>& blocks);

  std::array<Open, 256> open_{};  // by lane
  std::vector<Mark> marks_;
};

}  // namespace o80
