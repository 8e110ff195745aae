// Copies of a robot that are stepped together (robot/group/inline_group.hpp), and prepared bursts
// of them and of single robots.

#include "robot/group/inline_group.hpp"

#include <map>
#include <optional>
#include <tuple>
#include <utility>

#include "arguments.hpp"
#include "bindings.hpp"
#include "enums.hpp"
#include "frontend.hpp"
#include "loop_options.hpp"
#include "pickling.hpp"
#include "robot/driver/library.hpp"
#include "schema_builder.hpp"
#include "states.hpp"
#include "waiting.hpp"

namespace {

const o80::KeepWaiting kKeepWaiting = Waiting::keep_waiting;

using ConstBytes = std::span<const std::byte>;
using Copies = std::span<const std::uint32_t>;  // their numbers

template <class T>
std::span<T> numbers_in(const Bytes& bytes) {
  return {static_cast<T*>(bytes.view.buf), bytes.writable().size() / sizeof(T)};
}

class Group;

/// The options of a burst of a robot or of copies, and the caller's memory for its targets and
/// rows: the compiled half of o80.PreparedBurst and o80.GroupBurst.
class PreparedBurst {
 public:
  /// From, to, stride, size: as in o80::InlineGroup::Feed [bytes].
  using Feed = std::tuple<std::uint32_t, std::uint32_t, std::uint32_t, std::uint32_t>;

  PreparedBurst(std::vector<std::uint32_t> actuators, std::uint32_t steps,
                const o80::CommandOptions& options, std::int64_t delay, std::int64_t iterations,
                nb::handle targets, nb::handle rows)
      : targets_(std::in_place, targets, PyBUF_WRITABLE),
        rows_(std::in_place, rows, PyBUF_WRITABLE) {
    plan_.actuators = std::move(actuators);
    plan_.steps = steps;
    plan_.command = options;
    plan_.iterations = iterations;
    plan_.delay = delay;
    plan_.targets = targets_->writable();
    plan_.rows = rows_->writable();
  }
  /// `first`, whose memory it uses, and a burst of another group that follows it.
  PreparedBurst(const PreparedBurst& first, const Group& group, const PreparedBurst& following,
                const std::vector<Feed>& feeds);

  const o80::InlineGroup::BurstPlan& plan() const { return plan_; }
  /// As the burst of one robot. Returns its last iteration.
  o80::Iteration run(const Frontend& self, Patience timeout, nb::handle at, nb::handle late,
                     nb::handle seen) const {
    const o80::PulseOptions options = pulse_options(at, late, seen);
    const auto frontend = self.shared();
    plan_.add_targets(*frontend, plan_.targets);
    const Waiting waiting;
    return frontend->burst_rows(plan_.rows, timeout, Waiting::keep_waiting, options);
  }

 private:
  std::optional<Bytes> targets_;
  std::optional<Bytes> rows_;
  std::vector<o80::InlineGroup::Feed> feeds_;
  o80::InlineGroup::Following following_;
  o80::InlineGroup::BurstPlan plan_;
};

/// Offset in the row and kind of a number.
using NumberPlace = std::tuple<std::uint32_t, std::string>;

o80::RowNumber row_number(const NumberPlace& place) {
  return {std::get<0>(place), kind_of(std::get<1>(place))};
}

o80::EventFlag::Compare compare_of(nb::handle word) {
  constexpr std::string_view kWords[] = {"==", "!=", "<", "<=", ">", ">="};  // in their order
  return static_cast<o80::EventFlag::Compare>(place_of(word, kWords, "the comparison of a flag"));
}

/// The compiled half of o80.InlineGroup.
class Group {
 public:
  using Number = std::tuple<NumberPlace, double, double, double, double>;
  using Flag = std::tuple<NumberPlace, nb::object, double>;

  explicit Group(std::shared_ptr<o80::InlineGroup> group) : group_(std::move(group)) {}

  o80::InlineGroup& inner() const { return *group_; }
  Attachment attach(std::size_t copy) const { return {group_->attach(copy), nullptr}; }
  void publish(std::size_t copy, const std::string& name) const {
    const Waiting waiting;
    group_->publish_as(copy, name);
  }
  /// `instead`: for each copy of the group whether it runs a request; `payloads`: for each copy.
  void burst(const PreparedBurst& burst, Copies copies, Patience timeout,
             std::span<const std::uint8_t> instead, std::uint32_t request,
             ConstBytes payloads) const {
    const Waiting waiting;
    group_->burst(burst.plan(), copies, timeout, kKeepWaiting, {instead, request, payloads});
  }
  /// The bytes of requests with these fields, one after the other. `each`: a mapping for each.
  nb::bytes payloads(std::uint32_t request, const std::vector<nb::object>& each) const {
    std::vector<std::byte> all;
    for (const nb::object& fields : each) {
      const auto payload = request_bytes(group_->description().schema, request, fields);
      all.insert(all.end(), payload.begin(), payload.end());
    }
    return bytes_of(all);
  }
  std::uint32_t request_index(const std::string& name) const { return group_->request_index(name); }
  /// `payloads`: one for each of the copies; `rows`: none, or one for each copy of the group.
  void request(std::uint32_t request, Copies copies, ConstBytes payloads, std::span<std::byte> rows,
               Patience timeout) const {
    const Waiting waiting;
    group_->request(request, copies, payloads, timeout, kKeepWaiting, rows);
  }
  /// By copy.
  std::map<std::size_t, HaltFields> halted() const {
    std::map<std::size_t, HaltFields> found;
    for (const auto& [copy, halt] : group_->halted()) found.emplace(copy, *halt_fields(halt));
    return found;
  }
  void resume(Copies copies, Patience timeout) const {
    const Waiting waiting;
    group_->resume(copies, timeout, kKeepWaiting);
  }
  void latest(Copies copies, std::span<std::byte> rows) const { group_->latest(copies, rows); }
  void gather(const std::vector<Number>& numbers, const std::vector<Flag>& flags,
              nb::handle observations, nb::handle raised) {
    o80::RowGather gather;
    for (const auto& [place, offset, scale, low, high] : numbers) {
      gather.numbers.push_back({row_number(place), offset, scale, low, high});
    }
    for (const auto& [place, compare, value] : flags) {
      gather.flags.push_back({row_number(place), compare_of(compare), value});
    }
    auto memory = std::make_unique<std::pair<Bytes, Bytes>>(
        std::piecewise_construct, std::forward_as_tuple(observations, PyBUF_WRITABLE),
        std::forward_as_tuple(raised, PyBUF_WRITABLE));
    group_->gather(std::move(gather),
                   {numbers_in<float>(memory->first), numbers_in<std::uint8_t>(memory->second)});
    gathered_ = std::move(memory);
  }
  void close() const {
    const Waiting waiting;
    group_->close();
  }

 private:
  std::shared_ptr<o80::InlineGroup> group_;
  std::unique_ptr<std::pair<Bytes, Bytes>> gathered_;  // memory that every call writes
};

PreparedBurst::PreparedBurst(const PreparedBurst& first, const Group& group,
                             const PreparedBurst& following, const std::vector<Feed>& feeds)
    : following_{&group.inner(), &following.plan_, {}}, plan_(first.plan_) {
  if (first.plan_.then != nullptr || following.plan_.then != nullptr) {
    throw o80::InvalidArgument("a burst that is followed already cannot be part of another chain");
  }
  for (const auto& [from, to, stride, size] : feeds) feeds_.push_back({from, to, stride, size});
  following_.feeds = feeds_;
  plan_.then = &following_;
}

std::shared_ptr<o80::Description> description_of(const Group& self) {
  return std::make_shared<o80::Description>(self.inner().description());
}

/// Starts copies of a robot in this process.
Group start_group(const o80::RobotLibrary& library, std::size_t copies, std::size_t threads,
                  const Group* sharing, const o80::OptionValues& loop,
                  const o80::OptionValues& options) {
  const Waiting waiting;
  o80::LoopOptions defaults;
  defaults.backend = o80::InlineGroup::default_options();
  const o80::InlineGroup::Options group{.copies = copies,
                                        .threads = threads,
                                        .sharing = sharing == nullptr ? nullptr : &sharing->inner(),
                                        .backend = loop_options_of(loop, defaults).backend};
  return Group(std::make_shared<o80::InlineGroup>(*library.table, options, group, kKeepWaiting));
}

}  // namespace

void bind_inline_group(nb::module_& m) {
  nb::class_<PreparedBurst> burst(m, "PreparedBurst",
                                  "The compiled half of o80.PreparedBurst and o80.GroupBurst.");
  refuse_to_pickle(burst, "a prepared burst", "its targets and its rows");
  burst
      .def(nb::init<std::vector<std::uint32_t>, std::uint32_t, const o80::CommandOptions&,
                    std::int64_t, std::int64_t, nb::handle, nb::handle>(),
           "actuators"_a, "steps"_a, "options"_a, "delay"_a, "iterations"_a, "targets"_a, "rows"_a)
      .def(nb::init<const PreparedBurst&, const Group&, const PreparedBurst&,
                    const std::vector<PreparedBurst::Feed>&>(),
           "first"_a, "group"_a, "following"_a, "feeds"_a, nb::keep_alive<1, 2>(),
           nb::keep_alive<1, 3>(), nb::keep_alive<1, 4>())
      .def("run", &PreparedBurst::run, "frontend"_a, "timeout"_a.none(), "at"_a.none(), "late"_a,
           "seen"_a.none());

  nb::class_<Group> group(m, "InlineGroup", "The compiled half of o80.InlineGroup.");
  refuse_to_pickle(group, "an inline group", "its rows");
  group.def_prop_ro("copies", [](const Group& self) { return self.inner().copies(); })
      .def_prop_ro("threads", [](const Group& self) { return self.inner().threads(); })
      .def_prop_ro(
          "robot",
          [](const Group& self) { return self.inner().description().schema.head.robot.str(); })
      .def_prop_ro("description", &description_of)
      .def("check_usable", [](const Group& self) { self.inner().check_usable(); })
      .def("attach", &Group::attach, "copy"_a)
      .def("publish", &Group::publish, "copy"_a, "name"_a)
      .def("check",
           [](const Group& self, const PreparedBurst& given) { self.inner().check(given.plan()); })
      .def("burst", &Group::burst, "burst"_a, "copies"_a, "timeout"_a.none(),
           "instead"_a = nb::bytes("", 0), "request"_a = 0, "payloads"_a = nb::bytes("", 0))
      .def("payloads", &Group::payloads, "request"_a, "each"_a)
      .def("request_index", &Group::request_index, "name"_a)
      .def("request", &Group::request, "request"_a, "copies"_a, "payloads"_a, "rows"_a,
           "timeout"_a.none())
      .def("halted", &Group::halted)
      .def("resume", &Group::resume, "copies"_a, "timeout"_a.none())
      .def("latest", &Group::latest, "copies"_a, "rows"_a)
      .def("gather", &Group::gather, "numbers"_a, "flags"_a, "observations"_a, "raised"_a)
      .def("close", &Group::close);
  m.def("start_group", &start_group, "library"_a, "copies"_a, "threads"_a, "sharing"_a.none(),
        "loop"_a, "options"_a);
}
