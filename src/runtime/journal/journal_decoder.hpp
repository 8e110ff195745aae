#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "memory/ring/journal.hpp"
#include "o80/runtime/journal.hpp"
#include "o80/runtime/observation.hpp"
#include "runtime/journal/journal_author.hpp"

namespace o80 {

/// Decodes the entries of a journal, from the ring of a segment or from a recording. It joins the
/// records of a batch to the decision on it, and names owners. Any content is possible: what is
/// invalid is left out.
class JournalDecoder {
 public:
  /// `max_kept`: bytes of batches without a decision that are kept; the oldest are dropped.
  explicit JournalDecoder(std::shared_ptr<const Description> description,
                          std::uint64_t max_kept = ~std::uint64_t{0});

  /// Also returns the entries `at_rest`.
  void show_rests() noexcept { shows_rests_ = true; }
  /// Entries before this number are not returned. Forgets all batches.
  void start_at(std::uint64_t number);

  /// Keeps the name in item() if it is one; for a pass over a ring before it is read.
  void note_name() {
    if (item_.head.kind == JournalKind::owner) keep_name();
  }
  // read into item(), call take(), then next() until it returns false
  JournalItem& item() noexcept { return item_; }
  void take();
  bool next(JournalEntry& entry);

 private:
  using BatchKey = std::pair<std::uint32_t, CommandId>;  // lane and id
  /// Blocks of a batch on which no final decision was read yet.
  struct Kept {
    std::vector<std::byte> blocks;
    bool scheduled = false;
  };
  struct OneStatus {
    CommandId id = 0;
    std::uint64_t word = 0;  // a StatusWord
  };
  using Batches = std::map<BatchKey, Kept>;

  void keep_blocks();
  void drop(Batches::iterator batch);
  void keep_name();
  void keep_statuses();
  void fill_status(JournalEntry& entry);
  void fill(JournalEntry& entry);
  void fill_batch(JournalEntry& entry);
  void fill_chunk(JournalEntry& entry) const;
  void name(JournalEntry& entry, std::uint64_t owner) const;

  std::shared_ptr<const Description> description_;
  std::uint64_t max_kept_;
  JournalItem item_;
  std::size_t entries_ = 0;  // in item_: one, or its statuses
  std::vector<OneStatus> statuses_;
  std::size_t returned_ = 0;  // of them
  std::uint64_t first_ = 0;   // number of the first entry to return
  std::uint64_t missed_ = 0;  // entries missed since the last one returned
  Batches batches_;
  std::uint64_t kept_bytes_ = 0;
  bool shows_rests_ = false;
  std::map<BatchKey, std::string> names_;  // by lane and incarnation
};

}  // namespace o80
