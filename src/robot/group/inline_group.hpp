#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <memory>
#include <span>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "memory/os/fork.hpp"
#include "o80/base/error.hpp"
#include "o80/base/keep_waiting.hpp"
#include "o80/control/command.hpp"
#include "o80/memory/halt.hpp"
#include "o80/runtime/frontend.hpp"
#include "robot/driver/driver_instance.hpp"
#include "robot/group/inline_robot.hpp"
#include "robot/group/row_gather.hpp"
#include "robot/group/worker_pool.hpp"

namespace o80 {

/// Some copies of a group failed in a call; all others have done it.
class CopyFailed : public Error {
 public:
  struct Failure {
    std::size_t copy;
    std::exception_ptr error;
  };
  CopyFailed(const std::string& text, std::vector<Failure> failures)
      : Error(text), failures_(std::move(failures)) {}
  /// By copy, at least one.
  const std::vector<Failure>& failures() const noexcept { return failures_; }

 private:
  std::vector<Failure> failures_;
};

/// Copies of one robot in this process, stepped together by several threads.
///
/// Each copy is an InlineRobot with a frontend of its own, so it does what a single inline robot
/// does, bit for bit, with any number of threads. Its segment has no name (SegmentSpec::anonymous).
///
/// Writer:   one thread at a time; a second one gets an Error. Frontends of single copies
/// (`attach`)
///           may be used by other threads at any time.
/// Realtime: no. burst() allocates nothing, unless a copy fails.
class InlineGroup {
 public:
  struct Options {
    std::size_t copies = 1;
    std::size_t threads = 0;  // the calling thread included; 0: one for each processor
    /// A group whose threads this one uses, instead of `threads` of its own. The two are called in
    /// turn, never at the same time.
    const InlineGroup* sharing = nullptr;
    /// `segment` is the begin of the names in messages: "pam[3]".
    BackendOptions backend;
  };
  struct Following;
  /// What a burst sends and gets, in the caller's memory; the same for every call.
  struct BurstPlan {
    std::vector<std::uint32_t> actuators;  // that get targets; none: a burst without commands
    std::uint32_t steps = 1;               // targets of each actuator
    CommandOptions command = {.pace = o80::iterations(1)};
    std::int64_t iterations = 1;
    std::int64_t delay = 0;  // iterations of a burst before its targets are taken
    /// For each copy the states of its first actuator, then those of its second, and so on.
    std::span<std::byte> targets;
    std::span<std::byte> rows;        // for each copy `iterations` rows
    const Following* then = nullptr;  // a burst of another group, in the same call

    /// Adds the targets of one copy to the next batch of its frontend.
    void add_targets(UntypedFrontend& frontend, std::span<const std::byte> own) const;
  };
  /// A number of the rows of a burst that becomes a target of the burst that follows it: row i
  /// gives target i.
  struct Feed {
    std::uint32_t from = 0;    // in a row [bytes]
    std::uint32_t to = 0;      // in the targets of a copy: that of the first row [bytes]
    std::uint32_t stride = 0;  // from target to target [bytes]
    std::uint32_t size = 0;    // [bytes]
  };
  /// A burst of another group that follows, copy by copy: a simulation that mirrors a robot, say.
  struct Following {
    InlineGroup* group = nullptr;     // as many copies, on the same threads
    const BurstPlan* plan = nullptr;  // its own `then` is ignored
    std::span<const Feed> feeds;
  };
  /// A request that some copies of a call run instead of a burst.
  struct Instead {
    std::span<const std::uint8_t> copies;  // for each copy of the group whether; none: no copy
    std::uint32_t request;
    std::span<const std::byte> payloads;  // for each copy of the group
  };
  /// Memory for what a RowGather reads of each copy.
  struct Gathered {
    std::span<float> observations;
    std::span<std::uint8_t> flags;
  };

  /// Options for little memory, because the threads write one copy after the other: a short
  /// history, two small lanes, no journal.
  static BackendOptions default_options();

  /// Starts the copies one after the other. Throws as InlineRobot, and Error if the process may not
  /// open so many files.
  InlineGroup(const RobotTable& table, const OptionValues& options, const Options& group,
              const KeepWaiting& keep_waiting = {});
  InlineGroup& operator=(InlineGroup&&) = delete;
  ~InlineGroup();

  std::size_t copies() const noexcept { return copies_.size(); }
  std::size_t threads() const noexcept { return pool_->workers() + 1; }
  const Description& description() const;
  /// Throws InvalidArgument with the known requests.
  std::uint32_t request_index(const std::string& name) const;
  /// Another frontend of one copy; it takes the second lane. Throws InvalidArgument.
  std::shared_ptr<UntypedFrontend> attach(std::size_t copy) const;
  /// Gives the segment of one copy a name. Throws as UntypedBackend::publish_as.
  void publish_as(std::size_t copy, const std::string& name);

  /// Throws InvalidArgument if the memory of the plan does not have the size it needs, or if its
  /// iterations do not fit into the history, or if the burst that follows does not fit it.
  void check(const BurstPlan& plan) const;
  /// Sends the targets of the chosen copies and runs their iterations, then those of the same
  /// copies of the group that follows, if any. `chosen`: their numbers, each once. Copies between
  /// two iterations when it throws: CopyFailed; TimeoutError, Cancelled and what `keep_waiting`
  /// throws, after which copies whose turn had not come have run nothing. All rows of a copy that a
  /// halt has ended are its last one. Those of `instead` run a request, as request() does;
  /// all their rows are then their newest one.
  void burst(const BurstPlan& plan, std::span<const std::uint32_t> chosen, Timeout timeout = {},
             const KeepWaiting& keep_waiting = {}, const Instead& instead = {});
  /// Sends a request to the chosen copies, with a payload for each, and runs each until its request
  /// has ended. Throws as burst(); a request that is not completed is a failure of its copy.
  /// `rows`: if not empty, a row for each copy of the group, in which those that were chosen get
  /// their newest one.
  void request(std::uint32_t request, std::span<const std::uint32_t> chosen,
               std::span<const std::byte> payloads, Timeout timeout = {},
               const KeepWaiting& keep_waiting = {}, std::span<std::byte> rows = {});
  /// The halts that are in force or requested, by copy. One that a thread of a driver has requested
  /// since the last iteration of its copy is in force, and seen, from the next one on.
  std::vector<std::pair<std::size_t, Halt>> halted() const;
  /// Ends the halts of the chosen copies: each runs until it is at rest, then starts afresh where
  /// it is. A copy that is not halted does nothing. Throws as burst(); a resume that is refused is
  /// a failure of its copy.
  void resume(std::span<const std::uint32_t> chosen, Timeout timeout = {},
              const KeepWaiting& keep_waiting = {});
  /// Copies the newest rows of the chosen copies.
  void latest(std::span<const std::uint32_t> chosen, std::span<std::byte> rows);

  /// From now on every call reads the newest row of each of its copies into `memory`, which must
  /// outlive the group or the next call of this function. Reads all copies now.
  void gather(RowGather gather, Gathered memory);

  /// Stops all copies. Later calls throw Closed.
  void close() noexcept;
  /// Throws Closed, UsedAfterFork.
  void check_usable() const;

 private:
  struct Copy;
  class Call;

  void add_copy(const RobotTable& table, const OptionValues& options,
                const BackendOptions& backend);
  Copy& at(std::size_t copy) const;
  /// False if certainly no copy is halted. Reads no segment: those that other threads have written
  /// are not in the cache of this one.
  bool may_be_halted() const noexcept {
    const auto is_halted = [](const std::atomic<bool>& each) { return each.load(); };
    return published_ || std::ranges::any_of(*halted_, is_halted);
  }
  bool runs_here() const noexcept;
  bool may_continue();
  void poll() noexcept;
  template <class Each>
  void for_each(std::span<const std::uint32_t> chosen, Timeout timeout,
                const KeepWaiting& keep_waiting, Each&& each);
  void choose(std::span<const std::uint32_t> chosen);
  [[noreturn]] void throw_failures();
  void check_following(const BurstPlan& plan) const;
  void request_copy(std::uint32_t request, std::span<const std::byte> payload, std::uint32_t i);
  void burst_copy(const BurstPlan& plan, bool may_be_direct, std::uint32_t i);
  void follow(const BurstPlan& plan, bool may_be_direct, std::uint32_t i);
  void show_last_row(std::uint32_t i, std::span<std::byte> rows);
  bool may_be_direct(const BurstPlan& plan) const;
  bool burst_directly(Copy& copy, const BurstPlan& plan, std::span<const std::byte> targets,
                      std::span<std::byte> rows) const;
  void read_gathered(std::uint32_t copy, const std::byte* row) noexcept;

  std::string name_;
  std::vector<std::unique_ptr<Copy>> copies_;
  // by copy, after its last iteration; robots may outlive the group
  std::shared_ptr<std::vector<std::atomic<bool>>> halted_;
  bool published_ = false;  // a copy has a name: other processes may halt it
  RowGather gather_;
  Gathered gathered_;
  KeepWaiting otherwise_;     // asked in bursts that are no call of the group
  KeepWaiting may_continue_;  // calls may_continue()

  // of the call that runs
  std::atomic<std::uint32_t> running_{0};      // 1: a call runs
  std::atomic<InlineGroup*> leader_{nullptr};  // the group whose call runs this one too
  std::atomic<bool> cancelled_{false};
  std::thread::id caller_;
  const KeepWaiting* ask_ = nullptr;
  std::exception_ptr requested_;  // what it threw
  Deadline deadline_{Timeout()};
  bool timed_out_ = false;
  std::int64_t ask_at_ = 0;          // time of the next question [ns]
  std::atomic<bool> failed_{false};  // at least one copy

  std::atomic<bool> closed_{false};
  ForkGuard guard_;
  std::shared_ptr<WorkerPool> pool_;  // last: its threads end first
};

}  // namespace o80
