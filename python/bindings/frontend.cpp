#include "frontend.hpp"

#include <array>
#include <cstring>

#include "arguments.hpp"
#include "bindings.hpp"
#include "describe/table.hpp"
#include "runtime/frontend/link.hpp"
#include "states.hpp"
#include "verb.hpp"
#include "waiting.hpp"

using o80::InvalidArgument;
using o80::UntypedFrontend;

Frontend::Frontend(const Attachment& attachment, std::shared_ptr<Decoder> decoder)
    : untyped_(attachment.frontend), robot_(attachment.robot), decoder_(std::move(decoder)) {
  const o80::Schema& schema = decoder_->description->schema;  // valid also after a reattach
  for (std::uint32_t i = 0; i < schema.actuators.size(); ++i) {
    const auto name = schema.actuators[i].name.view();
    indices_[nb::str(name.data(), name.size())] = i;
    plain_.push_back(plain_number(schema, schema.actuators[i].type));
  }
  for (const o80::GroupRow& group : schema.groups) {
    const nb::str name(group.name.view().data(), group.name.view().size());
    if (group.name.view().empty() || indices_.contains(name)) continue;
    nb::list actuators;
    for (std::uint32_t i = 0; i < group.count; ++i) actuators.append(group.first_actuator + i);
    groups_[name] = actuators;
  }
}

nb::object Frontend::expanded(nb::handle named) const {
  if (!PyUnicode_Check(named.ptr())) return nb::borrow(named);
  PyObject* found = PyDict_GetItemWithError(groups_.ptr(), named.ptr());
  return nb::borrow(found != nullptr ? nb::handle(found) : named);
}

bool Frontend::names_one(nb::handle named) const {
  return !named.is_none() && !is_sequence(expanded(named));
}

std::uint32_t Frontend::actuator(nb::handle named) const {
  const std::shared_ptr<UntypedFrontend> frontend = untyped_;
  if (PyUnicode_Check(named.ptr())) {
    PyObject* found = PyDict_GetItemWithError(indices_.ptr(), named.ptr());
    if (found != nullptr) return static_cast<std::uint32_t>(PyLong_AsLong(found));
    return frontend->actuator(string_of(named, "the name of an actuator"));
  }
  const nb::object index = nb::steal(PyNumber_Index(named.ptr()));
  std::int64_t number = 0;
  if (PyBool_Check(named.ptr()) || !index.is_valid() ||
      !nb::try_cast<std::int64_t>(index, number)) {
    refuse("an actuator", "given by its index or its name", named);
  }
  return frontend->command_check().actuator(number);
}

/// Writes the target of an actuator whose state is a number.
void Frontend::write(std::uint32_t index, const o80::FieldRow& number, nb::handle target,
                     std::byte* to) const {
  if (number.kind == o80::Kind::float64 && PyFloat_Check(target.ptr())) {
    const double value = PyFloat_AS_DOUBLE(target.ptr());
    std::memcpy(to, &value, sizeof value);
  } else {
    write_number(decoder_->description->schema, number, target, to, name_of(index));
  }
}

std::uint32_t Frontend::add_command(nb::handle named, nb::handle target,
                                    const o80::CommandOptions& options) const {
  const std::shared_ptr<UntypedFrontend> frontend = untyped_;
  const std::uint32_t index = actuator(named);
  const o80::Schema& schema = decoder_->description->schema;
  if (const o80::FieldRow* number = plain_[index]) {
    alignas(8) std::array<std::byte, 8> state;
    write(index, *number, target, state.data());
    return frontend->add_command(index, {state.data(), number->size}, options);
  }
  const StateBytes state(schema, schema.actuators[index].type, target, name_of(index));
  return frontend->add_command(index, state.bytes, options,
                               state.whole ? std::span<const std::uint64_t>{} : state.mask);
}

std::vector<std::uint32_t> Frontend::actuators(nb::handle named) const {
  std::vector<std::uint32_t> indices;
  const auto add = [&](nb::handle one) {
    const nb::object group = expanded(one);
    if (group.is(one)) return indices.push_back(actuator(one));
    for (const nb::handle each : group) indices.push_back(actuator(each));
  };
  if (named.is_none()) {
    for (std::uint32_t i = 0; i < plain_.size(); ++i) indices.push_back(i);
  } else if (is_sequence(named)) {
    for (const nb::handle one : named) add(one);
  } else {
    add(named);
  }
  return indices;
}

void Frontend::clip(nb::handle clip, Targets& targets, std::uint32_t rows) const {
  if (!truth_of(clip, "clip")) return;
  const std::shared_ptr<UntypedFrontend> frontend = untyped_;
  const o80::CommandCheck& check = frontend->command_check();
  std::span<std::byte> states = targets.states;
  std::span<const std::uint64_t> masks = targets.masks;
  for (const std::uint32_t index : targets.actuators) {
    const std::size_t size =
        std::min<std::size_t>(states.size(), rows * check.layout(index).size());
    const auto mask = masks.first(masks.empty() ? 0 : check.words_of_mask(index));
    targets.clipped += check.clip(index, states.first(size), mask);
    states = states.subspan(size);
    masks = masks.subspan(mask.size());
  }
}

void Frontend::note_clipped(const Targets& targets) const {
  if (targets.clipped == 0) return;
  clipped += static_cast<std::int64_t>(targets.clipped);
  untyped_->note_clipped(targets.clipped);
}

Targets Frontend::targets_of(nb::handle named, nb::handle given) const {
  std::vector<std::uint32_t> chosen = actuators(named);
  const nb::object targets = names_one(named) ? nb::make_tuple(given) : nb::borrow(given);
  const o80::Schema& schema = decoder_->description->schema;
  if (!is_sequence_of(targets, chosen.size())) {
    throw InvalidArgument("a command for " + std::to_string(chosen.size()) +
                          " actuators needs a target for each, in their order, got " +
                          repr_of(targets));
  }
  std::vector<std::byte> states;
  std::vector<std::uint64_t> masks;
  bool whole = true;
  std::size_t i = 0;
  for (const nb::handle target : targets) {
    const std::uint32_t index = chosen.at(i++);
    if (const o80::FieldRow* number = plain_[index]) {
      states.resize(states.size() + number->size);
      write(index, *number, target, states.data() + states.size() - number->size);
      masks.push_back(1);
      continue;
    }
    const StateBytes state(schema, schema.actuators[index].type, target, name_of(index));
    states.insert(states.end(), state.bytes.begin(), state.bytes.end());
    masks.insert(masks.end(), state.mask.begin(), state.mask.end());
    whole = whole && state.whole;
  }
  if (whole) masks.clear();
  return {std::move(chosen), std::move(states), std::move(masks)};
}

void Frontend::close() {
  const std::shared_ptr<UntypedFrontend> frontend = untyped_;
  const std::shared_ptr<o80::InlineRobot> robot = std::move(robot_);
  const Waiting waiting;
  frontend->close();
  if (robot) robot->stop();
}

void Frontend::reattach(const Attachment& attachment, std::shared_ptr<Decoder> decoder) {
  untyped_->link()->check_usable();
  untyped_ = attachment.frontend;
  decoder_ = std::move(decoder);
  next = -1;  // a new run has other iterations
}

std::string Frontend::name_of(std::uint32_t index) const {
  return "the target of actuator '" + decoder_->description->schema.actuators[index].name.str() +
         "'";
}

namespace {

Attachment attach(const std::string& segment, Patience timeout, bool read_only, bool dead,
                  const o80::KeepWaiting& keep_waiting) {
  const o80::FrontendOptions options{
      .timeout = timeout,
      .access = read_only ? o80::Access::read_only : o80::Access::read_write,
      .dead = dead,
      .keep_waiting = keep_waiting};
  const Waiting waiting;
  return {std::make_shared<UntypedFrontend>(segment, options), nullptr};
}

/// Successor that takes the place of a frontend; its closing ends the wait.
Attachment attach_again(const Frontend& self, Patience timeout, bool read_only) {
  const std::shared_ptr<UntypedFrontend> former = self.shared();
  former->link()->check_usable();
  const o80::KeepWaiting keep_waiting = Waiting::keep_waiting;
  return attach(former->segment(), timeout, read_only, false,
                former->link()->guarded(keep_waiting));
}

}  // namespace

void bind_frontend(nb::module_& m) {
  nb::class_<Attachment>(m, "Attachment", "A frontend that has no class yet.")
      .def_prop_ro("description",
                   [](const Attachment& self) { return self.frontend->description(); })
      .def_prop_ro("robot",
                   [](const Attachment& self) { return self.frontend->schema().head.robot.str(); });
  m.def(
      "attach",
      [](const std::string& segment, Patience timeout, bool read_only, bool dead) {
        return attach(segment, timeout, read_only, dead, Waiting::keep_waiting);
      },
      "segment"_a, "timeout"_a.none(), "read_only"_a, "dead"_a);
  m.def("difference", [](const o80::Description& expected, const o80::Description& found) {
    return o80::difference(expected.schema, found.schema);
  });

  nb::class_<Frontend> frontend(m, "Frontend", "The compiled half of o80.Frontend.");
  frontend.def(nb::init<const Attachment&, std::shared_ptr<Decoder>>());
  bind_sending(m, frontend);
  bind_moving(m, frontend);
  bind_reading(m, frontend);
  bind_halting(m, frontend);
  def_noun(frontend, verbs::segment, &of_core<&UntypedFrontend::segment>);
  def_noun(frontend, verbs::epoch, &of_core<&UntypedFrontend::epoch>);
  def_noun(frontend, verbs::bursting, &of_core<&UntypedFrontend::bursting>);
  def_noun(frontend, verbs::closed, &of_core<&UntypedFrontend::closed>);
  def_noun(frontend, verbs::life,
           [](const Frontend& self) { return std::string(name_of(self.untyped().life())); });
  frontend.def_prop_ro("_is_inline", &Frontend::is_inline)
      .def("_close", &Frontend::close)
      .def("_check_usable", [](const Frontend& self) { self.untyped().link()->check_usable(); })
      .def_prop_ro(
          "_forked", [](const Frontend& self) { return self.untyped().link()->segment.forked(); },
          "Whether this is a child that was forked since.")
      .def_prop_ro(
          "_has_lane",
          [](const Frontend& self) { return self.untyped().link()->lane_if_taken() != nullptr; })
      .def("_attach_again", &attach_again, "timeout"_a.none(), "read_only"_a)
      .def("_reattach", &Frontend::reattach, "attachment"_a, "decoder"_a);
}
