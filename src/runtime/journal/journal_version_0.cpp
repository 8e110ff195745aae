// The layout of journals in the first files. It never changes, whatever becomes of the layout in
// memory: nothing here uses its structs.

#include "runtime/journal/journal_version_0.hpp"

#include <array>
#include <bit>
#include <cstdint>
#include <cstring>

#include "runtime/journal/journal_encoder.hpp"

namespace o80 {

namespace version_0 {

struct Head {
  std::uint16_t words;  // length of the entry with this head [8 bytes]
  std::uint8_t kind;
  std::uint8_t lane;
  std::uint32_t what;
  std::uint64_t number;
  std::int64_t iteration;
  std::uint64_t id;
};
static_assert(sizeof(Head) == 32 && std::endian::native == std::endian::little);

struct Decision {
  std::uint64_t ticket;
  std::uint64_t sender;
  std::int64_t at;
};
static_assert(sizeof(Decision) == 24);

struct Halt {
  std::uint64_t cause;
  std::array<char, 64> who;
  std::array<char, 248> text;
};
static_assert(sizeof(Halt) == 320);

struct Sender {
  std::uint64_t sender;
};
static_assert(sizeof(Sender) == 8);

struct Burst {
  std::int64_t iterations;
  std::uint64_t sender;
};
static_assert(sizeof(Burst) == 16);

struct Run {
  std::uint64_t first_id;
  std::uint64_t count;
  std::uint64_t word;
};
static_assert(sizeof(Run) == 24);

/// The oldest files have these instead of runs.
struct OneStatus {
  std::uint64_t id;
  std::uint64_t word;
};
static_assert(sizeof(OneStatus) == 16);

struct Word {
  std::uint8_t status;
  std::uint8_t reason;
  std::uint8_t detail;
  std::int64_t iteration;
};

struct Batch {
  std::uint8_t kind;
  std::uint8_t late_now;
  std::uint16_t flags;
  std::uint32_t records;
  std::uint64_t id;
  std::uint64_t ticket;
  std::int64_t at;
  std::int64_t burst;
  std::uint32_t blocks;
  std::array<std::uint32_t, 5> own;
};
static_assert(sizeof(Batch) == 64);

struct Record {
  std::uint8_t kind;
  std::uint8_t mode;
  std::uint8_t pace;
  std::uint8_t profile;
  std::uint8_t start;
  std::uint8_t masked;  // of a purge: only_own
  std::uint16_t actuator;
  std::uint64_t id;
  std::uint32_t payload_bytes;
  std::uint32_t rows;
  std::int64_t amount;  // of the pace `speed`: a double
  std::array<std::uint32_t, 4> own;
};
static_assert(sizeof(Record) == 48);

constexpr JournalKind kStatus{7};
constexpr JournalKind kStatuses{23};

struct Layout {
  using Head = version_0::Head;
  using Owner = std::array<char, 64>;
  using Decision = version_0::Decision;
  using Halt = version_0::Halt;
  using Sender = version_0::Sender;
  using Burst = version_0::Burst;
  using Text = std::array<char, 248>;
  using Run = version_0::Run;
  using Batch = version_0::Batch;
  using Record = version_0::Record;
  static constexpr std::size_t kBlock = 64;
  static constexpr std::uint16_t kBatchKind = 1;
  static bool is_batch(std::byte first) { return first == std::byte{1}; }
  static Word unpack(std::uint64_t word) {
    return {.status = static_cast<std::uint8_t>(word >> 48 & 15),
            .reason = static_cast<std::uint8_t>(word >> 52 & 15),
            .detail = static_cast<std::uint8_t>(word >> 56),
            .iteration = static_cast<std::int64_t>(word << 16) >> 16};
  }
};

}  // namespace version_0

class JournalVersion0::Body {
 public:
  std::size_t convert(std::span<const std::byte> bytes, std::vector<std::byte>& to) {
    version_0::Head head;
    if (bytes.size() < sizeof head) return 0;
    std::memcpy(&head, bytes.data(), sizeof head);
    const std::size_t length = std::size_t{head.words} * 8;
    if (length < sizeof head || length > bytes.size()) return 0;
    std::span<const std::byte> payload = bytes.first(length).subspan(sizeof head);
    if (JournalKind{head.kind} == version_0::kStatus) {
      head.kind = static_cast<std::uint8_t>(version_0::kStatuses);
      payload = runs_of(payload);
    }
    encoder_.encode(head, payload, to);
    return length;
  }

 private:
  std::span<const std::byte> runs_of(std::span<const std::byte> statuses) {
    runs_.clear();
    for (version_0::OneStatus one; statuses.size() >= sizeof one;
         statuses = statuses.subspan(sizeof one)) {
      std::memcpy(&one, statuses.data(), sizeof one);
      runs_.push_back({one.id, 1, one.word});
    }
    return std::as_bytes(std::span(runs_));
  }

  JournalEncoder<version_0::Layout> encoder_;
  std::vector<version_0::Run> runs_;
};

JournalVersion0::JournalVersion0() : body_(std::make_unique<Body>()) {}
JournalVersion0::~JournalVersion0() = default;

std::size_t JournalVersion0::convert(std::span<const std::byte> bytes, std::vector<std::byte>& to) {
  return body_->convert(bytes, to);
}

}  // namespace o80
