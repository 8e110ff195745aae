// Copies of a robot that are stepped together (robot/group/inline_group.hpp).

#include "robot/group/inline_group.hpp"

#include <nanobind/stl/optional.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <tuple>
#include <utility>

#include "arguments.hpp"
#include "bindings.hpp"
#include "buffer.hpp"
#include "enums.hpp"
#include "frontend.hpp"
#include "loop_options.hpp"
#include "pickling.hpp"
#include "robot/driver/library.hpp"
#include "states.hpp"
#include "waiting.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace {

const o80::KeepWaiting kKeepWaiting = Waiting::keep_waiting;

template <class T>
std::span<const T> numbers_of(const Bytes& bytes) {
  return {reinterpret_cast<const T*>(bytes.span().data()), bytes.span().size() / sizeof(T)};
}

template <class T>
std::span<T> writable_numbers_of(const Bytes& bytes) {
  return {reinterpret_cast<T*>(bytes.writable().data()), bytes.writable().size() / sizeof(T)};
}

/// A burst that is repeated: its options, and the caller's memory for targets and rows.
struct GroupPlan {
  GroupPlan(std::vector<std::uint32_t> actuators, std::uint32_t steps, nb::handle each,
            nb::handle mode, nb::handle profile, nb::handle start, std::int64_t delay,
            std::int64_t iterations, nb::handle given, nb::handle filled)
      : targets(given, PyBUF_WRITABLE), rows(filled, PyBUF_WRITABLE) {
    plan.actuators = std::move(actuators);
    plan.steps = steps;
    plan.command = {.pace = pace_of(nb::none(), nb::none(), nb::none(), each),
                    .mode = mode_of(mode),
                    .profile = profile_of(profile),
                    .start = start_of(start)};
    plan.iterations = iterations;
    plan.delay = delay;
    plan.targets = targets.span();
    plan.rows = rows.writable();
  }

  Bytes targets;
  Bytes rows;
  o80::InlineGroup::BurstPlan plan;
};

/// A burst of another group that follows one: the compiled half of o80.ChainedBurst.
struct GroupChain {
  /// From, to, stride, size: as in o80::InlineGroup::Feed [bytes].
  using Feed = std::tuple<std::uint32_t, std::uint32_t, std::uint32_t, std::uint32_t>;

  GroupChain(GroupPlan& following, const std::vector<Feed>& given) : plan(following) {
    for (const auto& [from, to, stride, size] : given) feeds.push_back({from, to, stride, size});
  }
  o80::InlineGroup::Following in(o80::InlineGroup& group) const {
    return {&group, &plan.plan, plan.targets.writable(), feeds};
  }

  GroupPlan& plan;
  std::vector<o80::InlineGroup::Feed> feeds;
};

/// Offset in the row and type of a number, as NumPy names it.
using NumberPlace = std::tuple<std::uint32_t, std::string>;

o80::RowNumber row_number(const NumberPlace& place) {
  using o80::Kind;
  constexpr std::pair<const char*, Kind> kKinds[] = {
      {"f8", Kind::float64}, {"f4", Kind::float32}, {"i1", Kind::int8},    {"i2", Kind::int16},
      {"i4", Kind::int32},   {"i8", Kind::int64},   {"u1", Kind::uint8},   {"u2", Kind::uint16},
      {"u4", Kind::uint32},  {"u8", Kind::uint64},  {"b1", Kind::boolean},
  };
  for (const auto& [name, kind] : kKinds) {
    if (std::get<1>(place) == name) return {std::get<0>(place), kind};
  }
  throw o80::InvalidArgument("'" + std::get<1>(place) + "' is no type of a number");
}

o80::EventFlag::Compare compare_of(const std::string& word) {
  using Compare = o80::EventFlag::Compare;
  constexpr std::pair<const char*, Compare> kWords[] = {
      {"==", Compare::equal},      {"!=", Compare::unequal}, {"<", Compare::less},
      {"<=", Compare::less_equal}, {">", Compare::greater},  {">=", Compare::greater_equal}};
  for (const auto& [name, compare] : kWords) {
    if (word == name) return compare;
  }
  throw o80::InvalidArgument("a flag compares with ==, !=, <, <=, > or >=, got '" + word + "'");
}

/// The compiled half of o80.InlineGroup.
class Group {
 public:
  using Number = std::tuple<NumberPlace, double, double, double, double>;
  using Flag = std::tuple<NumberPlace, std::string, double>;

  explicit Group(std::shared_ptr<o80::InlineGroup> group) : group_(std::move(group)) {}

  o80::InlineGroup& inner() const { return *group_; }
  Attachment attach(std::size_t copy) const { return {group_->attach(copy), nullptr}; }
  void publish(std::size_t copy, const std::string& name) const {
    const Waiting waiting;
    group_->publish_as(copy, name);
  }
  void burst(const GroupPlan& plan, nb::handle copies, nb::handle timeout) const {
    const Bytes chosen(copies);
    const o80::Timeout patience = timeout_of(timeout);
    const auto group = group_;
    const Waiting waiting;
    group->burst(plan.plan, numbers_of<std::uint32_t>(chosen), patience, kKeepWaiting);
  }
  void check_chain(const GroupPlan& plan, const Group& second, const GroupChain& chain) const {
    group_->check(plan.plan, chain.in(*second.group_));
  }
  void burst_chain(const GroupPlan& plan, const Group& second, const GroupChain& chain,
                   nb::handle copies, nb::handle timeout) const {
    const Bytes chosen(copies);
    const o80::Timeout patience = timeout_of(timeout);
    const auto group = group_;
    const auto following = second.group_;
    const o80::InlineGroup::Following then = chain.in(*following);
    const Waiting waiting;
    group->burst(plan.plan, numbers_of<std::uint32_t>(chosen), patience, kKeepWaiting, &then);
  }
  /// `fields`: a mapping for each copy.
  void request(const std::string& name, nb::handle copies, const std::vector<nb::object>& fields,
               nb::handle timeout) const {
    const Bytes chosen(copies);
    const o80::Timeout patience = timeout_of(timeout);
    const auto group = group_;
    const std::uint32_t index = group->request_index(name);
    const o80::Schema& schema = group->description().schema;
    std::vector<std::byte> payloads;
    for (const nb::object& each : fields) {
      const StateBytes payload(schema, schema.requests[index].type, each, "request '" + name + "'",
                               Missing::by_default);
      payloads.insert(payloads.end(), payload.bytes.begin(), payload.bytes.end());
    }
    const Waiting waiting;
    group->request(index, numbers_of<std::uint32_t>(chosen), payloads, patience, kKeepWaiting);
  }
  /// The bytes of a request with these fields.
  nb::bytes payload(const std::string& name, const nb::object& fields) const {
    const o80::Schema& schema = group_->description().schema;
    const std::uint32_t index = group_->request_index(name);
    const StateBytes payload(schema, schema.requests[index].type, fields, "request '" + name + "'",
                             Missing::by_default);
    return nb::bytes(payload.bytes.data(), payload.bytes.size());
  }
  std::uint32_t request_index(const std::string& name) const { return group_->request_index(name); }
  /// `payloads`: one for each of the copies; `rows`: one for each copy of the group.
  void send_request(std::uint32_t request, nb::handle copies, nb::handle payloads, nb::handle rows,
                    nb::handle timeout) const {
    const Bytes chosen(copies);
    const Bytes given(payloads);
    const Bytes filled(rows, PyBUF_WRITABLE);
    const o80::Timeout patience = timeout_of(timeout);
    const auto group = group_;
    const Waiting waiting;
    group->request(request, numbers_of<std::uint32_t>(chosen), given.span(), patience, kKeepWaiting,
                   filled.writable());
  }
  void latest(nb::handle copies, nb::handle rows) const {
    const Bytes chosen(copies);
    const Bytes filled(rows, PyBUF_WRITABLE);
    group_->latest(numbers_of<std::uint32_t>(chosen), filled.writable());
  }
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
    group_->gather(std::move(gather), {writable_numbers_of<float>(memory->first),
                                       writable_numbers_of<std::uint8_t>(memory->second)});
    gathered_ = std::move(memory);
  }
  void close() const {
    const auto group = group_;
    const Waiting waiting;
    group->close();
  }

 private:
  std::shared_ptr<o80::InlineGroup> group_;
  std::unique_ptr<std::pair<Bytes, Bytes>> gathered_;  // memory that every call writes
};

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
  nb::class_<GroupPlan> plan(m, "GroupPlan", "The compiled half of o80.GroupBurst.");
  refuse_to_pickle(plan, "a burst of a group", "its targets and its rows");
  plan.def(nb::init<std::vector<std::uint32_t>, std::uint32_t, nb::handle, nb::handle, nb::handle,
                    nb::handle, std::int64_t, std::int64_t, nb::handle, nb::handle>(),
           "actuators"_a, "steps"_a, "each"_a, "mode"_a, "profile"_a, "start"_a, "delay"_a,
           "iterations"_a, "targets"_a, "rows"_a);

  nb::class_<GroupChain> chain(m, "GroupChain", "The compiled half of o80.ChainedBurst.");
  refuse_to_pickle(chain, "a burst of two groups", "what each of them sends");
  chain.def(nb::init<GroupPlan&, const std::vector<GroupChain::Feed>&>(), "following"_a, "feeds"_a,
            nb::keep_alive<1, 2>());

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
           [](const Group& self, const GroupPlan& checked) { self.inner().check(checked.plan); })
      .def("burst", &Group::burst, "plan"_a, "copies"_a, "timeout"_a.none())
      .def("check_chain", &Group::check_chain, "plan"_a, "second"_a, "chain"_a)
      .def("burst_chain", &Group::burst_chain, "plan"_a, "second"_a, "chain"_a, "copies"_a,
           "timeout"_a.none())
      .def("request", &Group::request, "name"_a, "copies"_a, "fields"_a, "timeout"_a.none())
      .def("payload", &Group::payload, "name"_a, "fields"_a)
      .def("request_index", &Group::request_index, "name"_a)
      .def("send_request", &Group::send_request, "request"_a, "copies"_a, "payloads"_a, "rows"_a,
           "timeout"_a.none())
      .def("latest", &Group::latest, "copies"_a, "rows"_a)
      .def("gather", &Group::gather, "numbers"_a, "flags"_a, "observations"_a, "raised"_a)
      .def("close", &Group::close);
  m.def("start_group", &start_group, "library"_a, "copies"_a, "threads"_a, "sharing"_a.none(),
        "loop"_a, "options"_a);
}
