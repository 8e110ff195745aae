// A frontend that lies: garbage in its lane and on the bell's page while the backend iterates.
// The loop goes on, no desired state leaves its limits, and another frontend is served.

#include <chrono>
#include <cmath>
#include <cstdlib>
#include <memory>
#include <optional>
#include <vector>

#include "control/sending/batch_builder.hpp"
#include "fuzz/bytes.hpp"
#include "fuzz/robot.hpp"
#include "memory/os/atomic_words.hpp"
#include "memory/private_directory.hpp"
#include "memory/ring/lane_sender.hpp"
#include "memory/segment/liveness.hpp"
#include "o80/base/error.hpp"
#include "o80/runtime/backend.hpp"
#include "o80/runtime/frontend.hpp"
#include "runtime/frontend/link.hpp"

namespace o80::fuzz {
namespace {

constexpr std::uint32_t kBlocks = 32;                 // of a lane
constexpr std::int64_t kPeriod = 1'000'000;           // [ns]
constexpr double kFarthest = kSpeed * 1e-3;           // in an iteration [rad]
constexpr std::uint64_t kAnyLine = 64 * kBlocks / 8;  // words of the transport

void must(bool holds) {
  if (!holds) std::abort();
}

/// The robot, watched: every desired state is one it can bear.
class Plant final : private RequestServer {
 public:
  Plant(bool bursting, Stale stale)
      : backend(schema_of_robot(),
                {.segment = "robot",
                 .period = kPeriod,
                 .bursting = bursting,
                 .history = 16,
                 .lanes = 2,
                 .lane_blocks = kBlocks,
                 .stale = stale},
                this) {
    backend.publish();
  }

  void iterate() {
    const Step step = backend.try_step();
    must(step != Step::ended);
    if (step != Step::run) return;
    const auto now = unpack<Robot::Actuators>(backend.desired());
    for (std::size_t i = 0; i < now.joints.size(); ++i) {
      must(std::isfinite(now.joints[i]) && std::abs(now.joints[i]) <= kReach);
      must(std::abs(now.joints[i] - last_.joints[i]) <= kFarthest * (1 + 1e-9));
    }
    must(std::isfinite(now.hand.width));
    // as bytes: a boolean that is none cannot be looked at
    const std::byte* hand = backend.desired() + sizeof now.joints;
    must(hand[offsetof(Hand, closed)] <= std::byte{1});
    const auto gear = std::to_integer<int>(hand[offsetof(Hand, gear)]);
    must(gear <= 1 || gear == 7);
    last_ = now;
    for (std::uint32_t request = 0; request < 3; ++request) end(request);
    backend.publish();
  }

  UntypedBackend backend;

 private:
  Served serve(std::uint32_t request, std::span<const std::byte> payload) noexcept override {
    must(request < 3);
    must(!backend.runs(request));
    switch (request == 0 ? unpack<Reset>(payload.data()).seed % 4 : request) {
      case 0:
        return Served::done();
      case 3:
        return Served::running("takes its time");
      case 1:
        return Served::rejected("no");
      default:
        return Served::start_afresh();
    }
  }
  /// Now and then, what runs ends.
  void end(std::uint32_t request) {
    if (!backend.runs(request)) return;
    const Iteration now = backend.iteration();
    if (now % 3 == 0) backend.show_progress(request, now % 2 == 0 ? "even" : "odd");
    if (now % 5 == 0) backend.end_request(request, Served::done());
    if (now % 7 == 0) backend.end_request(request, Served::start_afresh());
  }
  bool read_fresh(FreshReading& reading) noexcept override {
    last_ = {};
    pack(last_, reading.observed);
    return true;
  }

  Robot::Actuators last_{};
};

/// Everything the owner of a lane can write.
class HostileFrontend {
 public:
  HostileFrontend()
      : segment_(AttachedSegment::attach("robot", Access::read_write, Deadline(kAtOnce))),
        sender_(std::make_unique<LaneSender>(segment_)),
        view_(segment_.view()),
        page_(view_.lane(sender_->lane())) {}

  void write_page(Bytes& bytes) {
    const auto which = bytes.below(9);
    const std::uint64_t word = bytes.word();
    std::atomic<std::uint64_t>* const words[] = {&page_.committed,       nullptr,
                                                 &page_.incarnation,     &page_.closed,
                                                 &page_.successor_begin, &page_.owner_begin,
                                                 &page_.next_id,         &page_.dead_incarnation};
    if (which == 1) {
      page_.committed.fetch_add(bytes.below(kBlocks + 2));
    } else if (which < std::size(words)) {
      words[which]->store(word);
    } else {
      page_.owner[word % 8].store(bytes.word());
    }
  }
  void write_bell(Bytes& bytes) {
    const auto which = bytes.below(4);
    const std::uint64_t word = bytes.word();
    Bell& bell = view_.bell();
    switch (which) {
      case 0:
        bell.rung.store(static_cast<std::uint32_t>(word));
        break;
      case 1:
        bell.tickets.store(word);
        break;
      case 2:
        bell.wanted.store(static_cast<std::int64_t>(word));
        break;
      default:
        bell.passed_on.store(static_cast<std::uint32_t>(word));
    }
  }
  void write_transport(Bytes& bytes) {
    auto* words = reinterpret_cast<std::uint64_t*>(view_.transport(sender_->lane()));
    const std::uint32_t at = bytes.below(kAnyLine);
    std::atomic_ref(words[at]).store(bytes.word());
  }
  /// A batch as a frontend makes it, but for what the fuzzer changes, sent as usual.
  void send(Bytes& bytes) {
    BatchBuilder builder;
    const std::uint32_t records = bytes.below(6);
    for (std::uint32_t i = 0; i < records; ++i) add_record(bytes, builder);
    BatchRecord batch;
    const auto flags = bytes.number<std::uint8_t>();
    batch.late_now = flags & 1;
    if ((flags & 2) != 0) batch.flags = kBurstUntilEnded;
    if ((flags & 4) != 0) batch.burst = static_cast<std::int64_t>(bytes.word());
    if ((flags & 8) != 0) batch.at = static_cast<std::int64_t>(bytes.word());
    batch.id = (flags & 16) != 0 ? bytes.word() : sender_->next_id();
    sender_->draw_ids(batch.id + records + 2);
    const std::span<const Block> sealed = builder.seal(batch);
    std::vector<Block> blocks(sealed.begin(), sealed.end());
    auto* words = reinterpret_cast<std::byte*>(blocks.data());
    for (std::uint32_t i = bytes.below(4); i > 0; --i) {
      const std::uint64_t word = bytes.word();
      std::memcpy(words + 8 * bytes.below(static_cast<std::uint32_t>(8 * blocks.size())), &word, 8);
    }
    try {
      sender_->send(std::as_bytes(std::span(blocks)), offsetof(BatchRecord, ticket));
    } catch (const LaneFull&) {
      return;
    }
  }
  /// Its last words: whatever it held, it lets go of. Its batches live on.
  void leave() {
    sender_->give_back();
    page_.closed.store(~std::uint64_t{0});
  }

 private:
  static constexpr std::chrono::nanoseconds kAtOnce{0};

  static void add_record(Bytes& bytes, BatchBuilder& builder) {
    RecordHead head;
    const auto kind = bytes.below(9);
    head.actuator = static_cast<std::uint16_t>(bytes.below(4));
    if (kind == 0) {
      builder.purge(head.actuator == 3 ? kEveryActuator : head.actuator);
    } else if (kind == 1) {
      builder.purge_own(kEveryActuator);
    } else if (kind == 2) {
      head.actuator == 3 ? builder.close_plan(bytes.below(2)) : builder.take_control();
    } else if (kind == 3) {
      const std::array<std::uint64_t, 1> payload{bytes.word()};
      builder.request(0, std::as_bytes(std::span(payload)));
    } else if (kind == 8) {
      add_chunk(bytes, builder);
    } else {
      add_command(bytes, head, builder);
    }
  }
  static void add_chunk(Bytes& bytes, BatchBuilder& builder) {
    static const Schema schema = schema_of_robot();
    static const StateLayout joint(schema, schema.actuators[0].type);
    static const StateLayout hand(schema, schema.actuators[2].type);
    const std::uint32_t rows = 1 + bytes.below(20);
    std::vector<std::uint32_t> due;
    for (std::uint32_t i = 0; i < rows; ++i) {
      due.push_back((due.empty() ? 0 : due.back()) + 1 + bytes.below(5));
    }
    ChunkHead chunk;
    chunk.anchor = static_cast<Iteration>(bytes.below(64));
    chunk.ease = 1 + bytes.below(20);
    chunk.first = bytes.below(rows);
    const std::uint32_t options = bytes.below(4);
    chunk.fixed = static_cast<std::uint8_t>(options % 2);
    chunk.final = static_cast<std::uint8_t>(options / 2);
    std::vector<std::vector<std::byte>> states(1 + bytes.below(2));
    std::vector<BatchBuilder::Member> members;
    std::vector<const StateLayout*> layouts;
    for (std::vector<std::byte>& of_member : states) {
      RecordHead head;
      head.actuator = static_cast<std::uint16_t>(bytes.below(3));
      head.profile = bytes.below(2) == 0 ? Profile::smooth : Profile::hold;
      layouts.push_back(head.actuator < 2 ? &joint : &hand);
      // zeros are admitted, most other bytes are not
      of_member.resize(rows * layouts.back()->size());
      if (bytes.below(2) == 0) of_member = add_states(bytes, head.actuator, rows);
      members.push_back({head, {}, of_member});
    }
    builder.chunk(members, chunk, due, layouts);
  }
  static void add_command(Bytes& bytes, RecordHead& head, BatchBuilder& builder) {
    const std::uint32_t mode = bytes.below(4);
    head.mode = static_cast<Mode>(mode % 2);
    const bool is_group = mode >= 2;
    head.pace = static_cast<Pace>(bytes.below(5));
    head.profile = static_cast<Profile>(bytes.below(2));
    head.start = static_cast<Start>(bytes.below(2));
    head.amount = static_cast<std::int64_t>(bytes.word());
    const std::uint32_t rows = 1 + bytes.below(3);
    const std::vector<std::byte> states = add_states(bytes, head.actuator, rows);
    const bool partial = bytes.below(2) == 1;
    const std::array<std::uint64_t, 1> mask{bytes.word()};
    std::vector<std::int64_t> times;
    if (head.pace == Pace::duration && rows > 1)
      for (std::uint32_t i = 0; i < rows; ++i)
        times.push_back(static_cast<std::int64_t>(bytes.word()));
    const auto named =
        partial ? std::span<const std::uint64_t>(mask) : std::span<const std::uint64_t>();
    if (!is_group) {
      builder.command(head, named, times, rows, states);
      return;
    }
    // the same for others too, some of them twice, or alike in name only
    std::vector<BatchBuilder::Member> members{{head, named, states}};
    std::vector<std::vector<std::byte>> more(bytes.below(4));
    for (std::vector<std::byte>& of_member : more) {
      RecordHead other = head;
      other.actuator = static_cast<std::uint16_t>(bytes.below(4));
      if (bytes.below(16) == 0) other.amount = static_cast<std::int64_t>(bytes.word());
      of_member = add_states(bytes, other.actuator, rows);
      members.push_back({other, named, of_member});
    }
    builder.group(members, times, rows);
  }
  static std::vector<std::byte> add_states(Bytes& bytes, std::uint16_t actuator,
                                           std::uint32_t rows) {
    const std::size_t size = actuator < 2 ? sizeof(double) : sizeof(Hand);
    std::vector<std::byte> states(rows * size);
    for (std::byte& byte : states) byte = bytes.number<std::byte>();
    return states;
  }

  AttachedSegment segment_;
  std::unique_ptr<LaneSender> sender_;
  SegmentView view_;
  LaneSenderPage& page_;
};

class HonestFrontend {
 public:
  HonestFrontend() : frontend_("robot", {.timeout = std::chrono::nanoseconds(0)}) {
    frontend_.add_purge_own();  // takes a lane
    frontend_.pulse();
  }

  Batch send(double target, const CommandOptions& options) {
    frontend_.add_command(0, std::as_bytes(std::span(&target, 1)), options);
    return frontend_.bursting() ? frontend_.start_burst(8).batch() : frontend_.pulse();
  }
  void send_something(Bytes& bytes) {
    // it keeps room for a purge: its commands may stand behind one of the other's for ever
    if (frontend_.link()->lane()->free_blocks() < kBlocks / 2) return;
    send(bytes.below(2) == 0 ? -kReach : kReach, {.pace = iterations(1 + bytes.below(5))});
  }
  /// Once the hostile frontend is gone, what it asked for lasts no longer than its batches.
  void is_served_by(Plant& plant) {
    for (int attempt = 0; attempt < 3 * static_cast<int>(kBlocks); ++attempt) {
      if (serve(plant)) return;
    }
    std::abort();
  }

 private:
  bool serve(Plant& plant) {
    constexpr double kTarget = 0.75;
    std::optional<Batch> batch;
    for (int i = 0; i < 20; ++i) {
      // no burst of the hostile frontend stands before it for ever
      if (!batch || batch->first_iteration() < 0) plant.backend.cut_burst();
      if (!batch) {
        frontend_.add_purge();
        batch = send(kTarget, {.pace = iterations(5), .mode = Mode::overwrite});
      }
      plant.iterate();
      if (batch && batch->ended()) break;
    }
    if (!batch->ended()) return false;
    return batch->handle(1).status == Status::completed &&
           unpack<double>(frontend_.wait_for(batch->last_iteration(), std::chrono::nanoseconds(0))
                              .desired()) == kTarget;
  }

  UntypedFrontend frontend_;
};

}  // namespace

void run(Bytes bytes) {
  static const PrivateDirectory directory;
  // a backend of its own keeps the helper thread of this process from coming and going
  static const UntypedBackend idle(schema_of_robot(),
                                   {.segment = "idle", .history = 1, .lanes = 1, .lane_blocks = 1});
  const auto kind = bytes.number<std::uint8_t>();
  Plant plant((kind & 1) != 0, (kind & 2) != 0 ? Stale::purge : Stale::hold);
  HostileFrontend hostile;
  HonestFrontend honest;
  for (int operations = 0; operations < 200 && !bytes.empty(); ++operations) {
    switch (bytes.number<std::uint8_t>() % 8) {
      case 0:
        hostile.write_page(bytes);
        break;
      case 1:
        hostile.write_bell(bytes);
        break;
      case 2:
        hostile.write_transport(bytes);
        break;
      case 3:
      case 4:
        hostile.send(bytes);
        break;
      case 5:
        honest.send_something(bytes);
        break;
      default:
        for (auto n = bytes.below(4); n < 4; ++n) plant.iterate();
    }
  }
  hostile.leave();
  honest.is_served_by(plant);
}

}  // namespace o80::fuzz
