#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "o80/memory/journal_kind.hpp"
#include "runtime/journal/journal_author.hpp"

// The format of journals in files, version 1. It does not depend on the layout in memory. All
// numbers are little-endian.
//
// An entry:
//   u32 length of the entry, u8 kind, u8 lane, u32 what, u64 number, i64 iteration, u64 id:
//     as in JournalHead
//   then, depending on its kind, the fields in visit_payload(), runs of statuses (run_fields), the
//   records of a batch, or any bytes (a snapshot, and kinds that this o80 does not know). Those of
//   chunk_begun are i64 shift, then for each number u32 actuator, u32 number, and as f64 place,
//   slope and curvature; `what` is the row that is reached first.
//
// A record of a batch:
//   u16 kind, u16 length of its fields, u32 length of its payload, u32 bytes of the payload here
//   then the fields and the payload, whose parts are those that RecordHead describes.
// The blocks of a large batch are several entries in memory. Where one of them ends in a payload,
// the next one continues with a record kMore, whose fields are empty.
//
// Rules, so that files stay readable:
// - The numbers of kinds and of other enumerations are part of the format: append only.
// - The fields of a kind never change. A kind with other fields gets a new number. A reader that
//   does not know the number skips the record or the entry, and names it.
// - Whatever else changes is a new version: kJournalCodec.
// tests/data/recordings holds a file of each version, and what must be found in it.

namespace o80 {

/// Version of the format in which journals are written to files.
inline constexpr std::int64_t kJournalCodec = 1;

namespace journal_format {

static_assert(static_cast<int>(JournalKind::records) == 1 &&
              static_cast<int>(JournalKind::status) == 7 &&
              static_cast<int>(JournalKind::burst_ended) == 15 &&
              static_cast<int>(JournalKind::snapshot) == 24);

// records that are none in memory
inline constexpr std::uint16_t kMore = 256;  // the payload of the record before continues
/// Blocks that are no whole batch: invalid, or the blocks before them were missed.
inline constexpr std::uint16_t kLost = 257;

/// A note: its payload is a text. JournalEncoder collects them.
inline constexpr std::uint16_t kMark = 10;
/// By which row the batch before it was decided. The batch does not count it among its records.
inline constexpr std::uint16_t kSeen = 11;

inline constexpr std::size_t kRecordFields = 27;
inline constexpr std::size_t kBatchFields = 47;

// Lists of fields: `io` writes or reads them.

template <class Io, class Head>
void head_fields(Io& io, Head& head) {
  io.u8(head.kind, head.lane);
  io.u32(head.what);
  io.u64(head.number, head.iteration, head.id);
}

template <class Io, class Run, class Word>
void run_fields(Io& io, Run& run, Word& word) {
  io.u64(run.first_id, run.count);
  io.u8(word.status, word.reason, word.detail);
  io.u64(word.iteration);
}

template <class Io, class Batch>
void batch_fields(Io& io, Batch& batch) {
  io.u8(batch.late_now);
  io.u16(batch.flags);
  io.u32(batch.records, batch.blocks, batch.clipped);
  io.u64(batch.id, batch.ticket, batch.at, batch.burst);
}

template <class Io, class Record>
void record_fields(Io& io, Record& record) {
  io.u8(record.mode, record.pace, record.profile, record.start, record.masked);
  io.u16(record.actuator);
  io.u32(record.rows);
  io.u64(record.id, record.amount);
}

/// Calls visit(payload, fields) if an entry of this kind has a struct as its payload: an empty
/// struct, and its list of fields. Else false.
template <class Visit>
bool visit_payload(JournalKind kind, Visit&& visit) {
  switch (kind) {
    case JournalKind::owner:
      visit(std::array<char, sizeof(JournalOwner)>{}, [](auto& io, auto& name) { io.text(name); });
      return true;
    case JournalKind::taken:
    case JournalKind::scheduled:
    case JournalKind::rejected:
      visit(JournalBatch{},
            [](auto& io, auto& batch) { io.u64(batch.ticket, batch.sender, batch.at); });
      return true;
    case JournalKind::halt:
    case JournalKind::halt_reason:
      visit(JournalHalt{}, [](auto& io, auto& halt) {
        io.u32(halt.cause);
        io.text(halt.who);
        io.text(halt.text);
      });
      return true;
    case JournalKind::resume:
    case JournalKind::burst_ended:
      visit(JournalSender{}, [](auto& io, auto& by) { io.u64(by.sender); });
      return true;
    case JournalKind::burst:
      visit(JournalBurst{}, [](auto& io, auto& burst) { io.u64(burst.iterations, burst.sender); });
      return true;
    case JournalKind::ended:
      visit(JournalText{}, [](auto& io, auto& text) { io.text(text); });
      return true;
    default:
      return false;
  }
}

}  // namespace journal_format
}  // namespace o80
