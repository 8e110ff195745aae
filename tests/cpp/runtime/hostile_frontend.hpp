#pragma once

#include <array>
#include <atomic>
#include <cstring>
#include <iterator>
#include <limits>
#include <memory>
#include <random>

#include "control/sending/batch_builder.hpp"
#include "memory/ring/lane_sender.hpp"
#include "runtime/manual_backend.hpp"

namespace o80::test {

/// The pages that a frontend can write: its lane's and the bell's.
class HostileFrontend {
 public:
  HostileFrontend()
      : segment_(AttachedSegment::attach("pair", Access::read_write, Deadline(kPatience))),
        sender_(std::make_unique<LaneSender>(segment_)) {}

  const SegmentView& view() const { return segment_.view(); }
  LaneSenderPage& page() { return view().lane(sender_->lane()); }
  Bell& bell() { return view().bell(); }
  LaneSender& sender() { return *sender_; }
  /// Lets go of the lane; the pages stay writable.
  void leave() { sender_->give_back(); }

  std::uint64_t send(BatchBuilder& builder, BatchRecord batch) {
    return sender_->send(std::as_bytes(builder.seal(batch)), offsetof(BatchRecord, ticket));
  }
  /// Sends a command for the first actuator.
  std::uint64_t command(double target, BatchRecord batch, RecordHead head = {}) {
    BatchBuilder builder;
    builder.command(head, std::as_bytes(std::span(&target, 1)));
    return send(builder, batch);
  }
  /// The id of a batch with one record.
  CommandId draw_id() {
    const CommandId id = sender_->next_id();
    sender_->draw_ids(id + 3);
    return id;
  }
  Status status(CommandId id) const { return static_cast<Status>(sender_->status(id).word.status); }
  /// One scribble somewhere, of something that was meant to be a batch, a count, or nothing.
  void scribble(std::mt19937_64& random) {
    const std::uint64_t word = random() >> random() % 64;
    LaneSenderPage& own = page();
    switch (random() % 10) {
      case 0:
        own.committed = word;
        break;
      case 1:
        own.committed += random() % 20;
        break;
      case 2:
        own.incarnation = word;
        break;
      case 3:
        own.closed = word;
        break;
      case 4:
        own.next_id = word;
        break;
      case 5:
        bell().tickets += word % 3;
        break;
      case 6:
        bell().wanted = static_cast<std::int64_t>(word);
        break;
      default: {
        // a block that looks like a batch with a command behind it, and ten more that do not
        auto* words = reinterpret_cast<std::uint64_t*>(view().transport(sender_->lane()));
        const std::uint64_t blocks = view().shape.lane_blocks;
        const std::uint64_t at = own.committed % blocks;
        write(words + 8 * at, batch_of(random));
        for (std::uint64_t i = 1; i < 10; ++i)
          write(words + 8 * ((at + i) % blocks), record_of(random, i));
        own.committed += 1 + random() % 10;
        bell().rung += 1;
      }
    }
  }

 private:
  using Words = std::array<std::uint64_t, 8>;

  static void write(std::uint64_t* to, const Words& words) {
    for (std::size_t i = 0; i < words.size(); ++i)
      std::atomic_ref(to[i]).store(words[i], std::memory_order_relaxed);
  }
  Words batch_of(std::mt19937_64& random) {
    BatchRecord batch;
    batch.records = static_cast<std::uint32_t>(random() % 10);
    batch.blocks = static_cast<std::uint32_t>(random() % 11);
    batch.id = sender_->next_id() + random() % 100;
    batch.ticket = bell().tickets.fetch_add(1);
    if (random() % 4 == 0) batch.at = static_cast<std::int64_t>(random() % 5000);
    Words words;
    std::memcpy(words.data(), &batch, sizeof batch);
    // but for the flags and the burst: to burst without end is a frontend's right
    constexpr std::size_t kSpoilt[] = {1, 2, 3, 5, 6, 7};
    if (random() % 3 == 0) words[kSpoilt[random() % std::size(kSpoilt)]] = random();
    return words;
  }
  Words record_of(std::mt19937_64& random, std::uint64_t place) {
    RecordHead head;
    head.kind = static_cast<RecordKind>(2 + random() % 3);  // no control, which would be its right
    head.mode = static_cast<Mode>(random() % 3);
    head.pace = static_cast<Pace>(random() % 6);
    head.profile = static_cast<Profile>(random() % 3);
    head.actuator = static_cast<std::uint16_t>(random() % 3);
    head.id = sender_->next_id() + random() % 100 + place;
    head.payload_bytes = random() % 2 == 0 ? 8 : static_cast<std::uint32_t>(random());
    head.amount = static_cast<std::int64_t>(random() >> random() % 64);
    // the requests of the manual backend that break it are a frontend's right too
    if (head.kind == RecordKind::request) head.kind = RecordKind::command;
    if (random() % 8 == 0) head.kind = RecordKind::seen;
    constexpr double kTargets[] = {0.5,
                                   -0.5,
                                   1e300,
                                   -1e300,
                                   5.0,
                                   std::numeric_limits<double>::infinity(),
                                   std::numeric_limits<double>::quiet_NaN()};
    const double target = kTargets[random() % std::size(kTargets)];
    Words words{};
    std::memcpy(words.data(), &head, sizeof head);
    std::memcpy(words.data() + 6, &target, sizeof target);
    return words;
  }

  AttachedSegment segment_;
  std::unique_ptr<LaneSender> sender_;
};

/// What a hostile frontend left in its lane is thrown away first.
inline Batch pulse_as_soon_as_there_is_room(UntypedFrontend& frontend, ManualBackend& manual) {
  for (int i = 0; i < 10'000; ++i) {
    try {
      return frontend.pulse();
    } catch (const LaneFull&) {
      manual.iterate();
    }
  }
  ADD_FAILURE() << "the lane stays full";
  return {};
}

}  // namespace o80::test
