#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>

#include "control/batch/record.hpp"
#include "memory/ring/journal.hpp"
#include "memory/ring/status_word.hpp"
#include "runtime/journal/journal_author.hpp"
#include "runtime/journal/journal_encoder.hpp"

namespace o80 {

class JournalVersion0;

/// The structs of the journal in the memory of this o80.
struct JournalLayout {
  using Head = JournalHead;
  using Owner = std::array<char, sizeof(JournalOwner)>;
  using Decision = JournalBatch;
  using Halt = JournalHalt;
  using Sender = JournalSender;
  using Burst = JournalBurst;
  using Text = JournalText;
  using Run = JournalStatusRun;
  using Batch = BatchRecord;
  using Record = RecordHead;
  static constexpr std::size_t kBlock = kBlockBytes;
  static constexpr auto kBatchKind = static_cast<std::uint16_t>(RecordKind::batch);
  static bool is_batch(std::byte first) { return first == static_cast<std::byte>(kBatchKind); }
  static StatusWord unpack(std::uint64_t word) { return StatusWord::unpack(word); }
};

/// memory => file, in the newest version
using JournalFileEncoder = JournalEncoder<JournalLayout>;

/// file => memory: decodes entries of any version into those that a ring would hold. Decodes one
/// journal in its order.
class JournalFileDecoder {
 public:
  JournalFileDecoder();
  JournalFileDecoder(JournalFileDecoder&&) noexcept;
  JournalFileDecoder& operator=(JournalFileDecoder&&) noexcept;
  ~JournalFileDecoder();

  /// Calls take(entry) for each entry in `bytes`; it may move the entry. Throws InvalidArgument for
  /// a newer version, and if the bytes are damaged; the entries before were taken then.
  void decode(std::int64_t version, std::span<const std::byte> bytes,
              const std::function<void(JournalItem&)>& take);

 private:
  std::unique_ptr<JournalVersion0> version_0_;  // null until it is needed
};

}  // namespace o80
