#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "control/sending/batch_builder.hpp"
#include "memory/ring/lane_sender.hpp"
#include "o80/base/error.hpp"
#include "o80/runtime/backend.hpp"

// A backend stepped by hand, and frontends that write into their lanes whatever fits, past all that
// `pulse` refuses: what the heaviest loads are made of, for tests that count and benchmarks that
// time.

namespace o80::flood {

inline constexpr std::uint32_t kLanes = 8;

/// A robot of so many actuators of one number each. Its request 0 starts it afresh, 1 does nothing,
/// 2 runs for an iteration, with progress, and then starts it afresh.
class Robot final : private RequestServer {
 public:
  explicit Robot(const std::string& segment, std::uint32_t actuators,
                 std::uint32_t lane_blocks = 16'384, const Limits& limits = {})
      : backend(schema_of(actuators, limits),
                {.segment = segment, .history = 64, .lanes = kLanes, .lane_blocks = lane_blocks},
                this) {
    backend.publish();
  }

  void iterate() {
    if (backend.try_step() != Step::run) return;
    if (backend.runs(2)) {
      backend.show_progress(2, backend.iteration() % 2 == 0 ? "even" : "odd");
      backend.end_request(2, Served::start_afresh());
    }
    backend.publish();
  }

  std::uint32_t served = 0;  // requests so far
  UntypedBackend backend;

 private:
  static Schema schema_of(std::uint32_t actuators, const Limits& limits) {
    Schema schema;
    schema.head.robot = NameText("flooded");
    const auto type = schema.add_type("float64", {scalar_field("", Kind::float64)});
    schema.add_actuators("joint", type, actuators);
    for (std::uint32_t i = 0; i < actuators; ++i) schema.actuator(i).limits(limits);
    const auto nothing = schema.add_type("Nothing", {});
    schema.add_request("restart", nothing, "starts afresh");
    schema.add_request("nothing", nothing, "does nothing");
    schema.add_request("run", nothing, "takes an iteration");
    return schema;
  }
  Served serve(std::uint32_t request, std::span<const std::byte> /*payload*/) noexcept override {
    ++served;
    if (request == 2) return Served::running("begins");
    return request == 0 ? Served::start_afresh() : Served::done();
  }
  bool read_fresh(FreshReading& /*reading*/) noexcept override { return true; }
};

/// What owns a lane and sends blocks of its own making.
class Sender {
 public:
  explicit Sender(const std::string& segment)
      : segment_(AttachedSegment::attach(segment, Access::read_write,
                                         Deadline(std::chrono::seconds(5)))),
        lane_(std::make_unique<LaneSender>(segment_)) {}

  /// Sends what `batch` holds and empties it; false, and nothing is sent, if that does not fit.
  bool send(Iteration at = kNow, bool late_now = false) {
    if (batch.blocks() > lane_->free_blocks()) return false;
    BatchRecord record;
    record.id = lane_->next_id();
    record.at = at;
    record.late_now = late_now ? 1 : 0;
    lane_->draw_ids(record.id + batch.records() + 2);
    lane_->send(std::as_bytes(batch.seal(record)), offsetof(BatchRecord, ticket));
    batch.clear();
    return true;
  }
  void command(std::uint32_t actuator, Mode mode, Pace pace = Pace::iterations,
               std::int64_t amount = 1'000'000) {
    RecordHead head;
    head.actuator = static_cast<std::uint16_t>(actuator);
    head.mode = mode;
    head.pace = pace;
    head.amount = amount;
    const double target = 1.0;
    batch.command(head, std::as_bytes(std::span(&target, 1)));
  }
  /// One command for the actuators first, first + 1, ...
  void group(std::uint32_t first, std::uint32_t members, std::uint32_t actuators, Mode mode,
             Pace pace = Pace::iterations, std::int64_t amount = 1'000'000) {
    RecordHead head;
    head.mode = mode;
    head.pace = pace;
    if (pace == Pace::speed) {
      head.speed = 1e-3;
    } else {
      head.amount = amount;
    }
    const double target = 1.0;
    std::vector<BatchBuilder::Member> all;
    for (std::uint32_t i = 0; i < members; ++i) {
      head.actuator = static_cast<std::uint16_t>((first + i) % actuators);
      all.push_back({head, {}, std::as_bytes(std::span(&target, 1))});
    }
    batch.group(all);
  }
  std::uint32_t blocks() const { return lane_->blocks(); }
  std::uint32_t free_blocks() const { return lane_->free_blocks(); }
  LaneSender& lane() { return *lane_; }

  BatchBuilder batch;

 private:
  AttachedSegment segment_;
  std::unique_ptr<LaneSender> lane_;
};

/// One load: fills lanes, and how many senders it takes.
struct Load {
  const char* name;
  std::uint32_t senders;
  std::function<void(Sender&, std::uint32_t actuators, Iteration at)> fill;
};

/// The loads under which the first version had its longest iterations.
inline std::vector<Load> heaviest_loads() {
  // one batch that fills the lane
  const auto whole = [](auto add, bool scheduled = false) {
    return [add, scheduled](Sender& to, std::uint32_t actuators, Iteration at) {
      for (std::uint32_t i = 0; i + 17 < to.blocks(); ++i) add(to, i % actuators);
      to.send(scheduled ? at : kNow);
    };
  };
  const auto commands = [whole](Mode mode) {
    return whole([mode](Sender& to, std::uint32_t actuator) { to.command(actuator, mode); });
  };
  const auto purge = [](Sender& to, std::uint32_t) { to.batch.purge(kEveryActuator); };
  const auto request = [](Sender& to, std::uint32_t) { to.batch.request(0, {}); };
  const auto eight_requests = [](std::uint16_t index) {
    return [index](Sender& to, std::uint32_t, Iteration) {
      do {
        for (int i = 0; i < 8; ++i) to.batch.request(index, {});
      } while (to.send());
      to.batch.clear();
    };
  };
  const auto scheduled = [](Sender& to, std::uint32_t actuators, Iteration at) {
    std::uint32_t i = 0;
    do {
      to.command(i++ % actuators, Mode::overwrite);
    } while (to.send(at));
    to.batch.clear();
  };
  // the dearest batch: each request begins a part, in which no drop can stand for another
  const auto dearest = [](Sender& to, std::uint32_t actuators, Iteration) {
    const auto every = [&](auto&& add) {
      for (std::uint32_t i = 0; i < actuators; ++i) add(i);
    };
    do {
      for (int part = 0; part < 9; ++part) {
        if (part > 0) to.batch.request(0, {});
        every([&](std::uint32_t i) { to.batch.purge_own(static_cast<std::uint16_t>(i)); });
        to.batch.purge_own(kEveryActuator);
        every([&](std::uint32_t i) { to.command(i, Mode::overwrite); });
        every([&](std::uint32_t i) { to.batch.purge_own(static_cast<std::uint16_t>(i)); });
        every([&](std::uint32_t i) { to.batch.purge(static_cast<std::uint16_t>(i)); });
        to.batch.purge(kEveryActuator);
        every([&](std::uint32_t i) { to.command(i, Mode::queue); });
      }
    } while (to.send());
    to.batch.clear();
  };
  constexpr std::uint32_t kAll = 0;
  const auto groups = [](Mode mode, std::uint32_t members, Pace pace,
                         std::int64_t amount = 1'000'000) {
    return [=](Sender& to, std::uint32_t actuators, Iteration) {
      const std::uint32_t size = members == kAll ? actuators : members;
      for (std::uint32_t i = 0; to.batch.blocks() + size + 17 < to.blocks(); ++i) {
        to.group(i, size, actuators, mode, pace, amount);
      }
      to.send();
    };
  };
  return {{"idle", 0, {}},
          {"8 lanes full of commands for all actuators", 8, groups(Mode::queue, kAll, Pace::speed)},
          {"8 lanes full of commands for two actuators", 8, groups(Mode::queue, 2, Pace::direct)},
          {"8 lanes full of commands for all actuators, overwriting", 8,
           groups(Mode::overwrite, kAll, Pace::iterations)},
          {"8 lanes full of commands for two actuators, too late", 8,
           groups(Mode::queue, 2, Pace::until, 0)},
          {"16 367 queued", 1, commands(Mode::queue)},
          {"8 lanes x 16 367 queued", 8, commands(Mode::queue)},
          {"16 367 overwrites", 1, commands(Mode::overwrite)},
          {"8 lanes x 16 367 overwrites", 8, commands(Mode::overwrite)},
          {"16 367 purges of all", 1, whole(purge)},
          {"8 lanes x 16 367 purges of all", 8, whole(purge)},
          {"16 367 requests with a fresh start in a batch", 1, whole(request)},
          {"8 lanes full of batches of 8 such requests", 8, eight_requests(0)},
          {"8 lanes full of batches of 8 requests that take time", 8, eight_requests(2)},
          {"8 lanes full of the dearest batches", 8, dearest},
          {"8 lanes x 8183 batches of one overwrite, same at", 8, scheduled},
          {"8 lanes x 16 367 purges, same at", 8, whole(purge, true)}};
}

/// The iteration for which batches are meant when the loads give one.
inline constexpr Iteration kAt = 700;

}  // namespace o80::flood
