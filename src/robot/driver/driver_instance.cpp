#include "robot/driver/driver_instance.hpp"

#include <algorithm>

#include "memory/os/fork.hpp"
#include "memory/os/random_bits.hpp"
#include "o80/base/version.hpp"

namespace o80 {

std::vector<Option> options_of(const RobotTable& table) {
  std::vector<Option> options;
  table.options(table.self, &options, [](void* context, const OptionRow* row) {
    static_cast<std::vector<Option>*>(context)->push_back(
        {row->name, row->kind, row->default_text, row->help, row->unit});
  });
  return options;
}

void check_table(const RobotTable& table, const std::string& where) {
  if (table.version != kRobotTableVersion || table.size != sizeof(RobotTable) ||
      table.row_sizes != kSchemaRowSizes) {
    throw DriverError(
        "the robot library '" + where + "' was built for another version of o80" +
        (table.version == kRobotTableVersion ? " (" + std::string(table.built_with) + ")" : "") +
        ": build it again with this one (" O80_VERSION ")");
  }
}

namespace {

/// A random number as text. It fits in 53 bits, so that every language reads it exactly.
std::string drawn_seed() { return std::to_string(random_bits() >> 11); }

std::vector<OptionValue> plain(const OptionValues& options) {
  std::vector<OptionValue> values;
  values.reserve(options.size());
  for (const auto& [name, text] : options) values.push_back({name.c_str(), text.c_str()});
  return values;
}

}  // namespace

void check_options(const RobotTable& table, const OptionValues& options) {
  const std::vector<OptionValue> values = plain(options);
  FaultText fault{};
  if (table.accepts(table.self, values.data(), static_cast<std::uint32_t>(values.size()), &fault) !=
      0) {
    throw InvalidArgument("robot '" + std::string(table.name) + "': " + fault.text);
  }
}

OptionValues effective_options(const RobotTable& table, const OptionValues& given) {
  OptionValues effective;
  for (const Option& option : options_of(table)) {
    std::string text = option.kind == kSeedKind ? drawn_seed() : option.default_text;
    for (const auto& [name, value] : given)
      if (name == option.name) text = value;
    effective.emplace_back(option.name, std::move(text));
  }
  return effective;
}

DriverInstance::DriverInstance(const RobotTable& table, const OptionValues& options)
    : table_(table) {
  const ForkGuard guard;
  check_table(table, table.name);
  check_options(table, options);
  options_ = effective_options(table, options);
  const std::vector<OptionValue> values = plain(options_);
  driver_ =
      table.create(table.self, values.data(), static_cast<std::uint32_t>(values.size()), &fault_);
  if (guard.forked()) end_forked_child(table.name, "its constructor");
  if (driver_ == nullptr) {
    throw DriverError("robot '" + std::string(table.name) +
                      "' cannot be constructed: " + fault_.text);
  }
}

DriverInstance::~DriverInstance() {
  stop();
  table_.destroy(driver_);
}

Schema DriverInstance::describe(std::int64_t period) const {
  const ForkGuard guard;
  Schema schema;
  FaultText fault{};
  const auto copy = [](void* context, const SchemaRows* rows) {
    auto& out = *static_cast<Schema*>(context);
    out.head = *rows->head;
    out.types.assign(rows->types, rows->types + rows->type_count);
    out.hooks.assign(rows->hooks, rows->hooks + rows->type_count);
    out.keys.resize(rows->type_count);
    out.fields.assign(rows->fields, rows->fields + rows->field_count);
    out.labels.assign(rows->labels, rows->labels + rows->label_count);
    out.groups.assign(rows->groups, rows->groups + rows->group_count);
    out.actuators.assign(rows->actuators, rows->actuators + rows->actuator_count);
    out.limits.assign(rows->limits, rows->limits + rows->limit_count);
    out.integrals.assign(rows->integrals, rows->integrals + rows->integral_count);
    out.requests.assign(rows->requests, rows->requests + rows->request_count);
    out.defaults.assign(rows->defaults, rows->defaults + rows->default_count);
    out.shown = {.mjcf = rows->mjcf,
                 .file = rows->mjcf_file,
                 .values = {rows->shown, rows->shown + rows->shown_count}};
  };
  const int failed = table_.describe(driver_, period, &schema, copy, &fault);
  if (guard.forked()) end_forked_child(table_.name, "describe");
  if (failed != 0) {
    throw DriverError("robot '" + std::string(table_.name) + "' cannot be started: " + fault.text);
  }
  return schema;
}

bool DriverInstance::start() noexcept {
  started_ = true;
  return table_.start(driver_, &fault_) == 0;
}
bool DriverInstance::wait(std::int64_t due) noexcept {
  return table_.wait(driver_, due, &fault_) == 0;
}
bool DriverInstance::write(const DesiredView& desired) noexcept {
  return table_.write(driver_, &desired, &fault_) == 0;
}
bool DriverInstance::read(ReadingView& reading) noexcept {
  return table_.read(driver_, &reading, &fault_) == 0;
}

Served DriverInstance::served(RequestAnswer answer, const FaultText& text) noexcept {
  switch (answer) {
    case RequestAnswer::done:
      return Served::done();
    case RequestAnswer::rejected:
      return Served::rejected(text.text);
    case RequestAnswer::start_afresh:
      return Served::start_afresh();
    case RequestAnswer::running:
      return Served::running(text.text);
    default:
      std::copy_n(text.text, sizeof text.text, fault_.text);
      return Served::failed(text.text);
  }
}

Served DriverInstance::served(const RequestReport& report) noexcept {
  const std::string_view text(report.text, strnlen(report.text, sizeof report.text));
  switch (report.answer) {
    case RequestAnswer::done:
      return Served::done();
    case RequestAnswer::rejected:
      return Served::rejected(text);
    case RequestAnswer::start_afresh:
      return Served::start_afresh();
    case RequestAnswer::running:
      return Served::running(text);
    default:
      return Served::failed(text);
  }
}

Served DriverInstance::request(std::uint32_t index, const std::byte* payload) noexcept {
  FaultText text{};
  return served(table_.request(driver_, index, payload, &text), text);
}

bool DriverInstance::halt() noexcept {
  return table_.halt == nullptr || table_.halt(driver_, &fault_) == 0;
}

Served DriverInstance::resume() noexcept {
  if (table_.resume == nullptr) return Served::done();
  FaultText text{};
  return served(table_.resume(driver_, &text), text);
}

std::span<const std::byte> DriverInstance::snapshot_bytes(std::uint32_t slot) noexcept {
  if (table_.snapshot_bytes == nullptr) return {};
  std::uint64_t size = 0;
  const std::byte* bytes = table_.snapshot_bytes(driver_, slot, &size);
  return bytes == nullptr ? std::span<const std::byte>() : std::span(bytes, size);
}

bool DriverInstance::load_snapshot(std::uint32_t slot, std::span<const std::byte> bytes) noexcept {
  return table_.load_snapshot != nullptr &&
         table_.load_snapshot(driver_, slot, bytes.data(), bytes.size(), &fault_) == 0;
}

void DriverInstance::stop() noexcept {
  if (!started_) return;
  started_ = false;
  table_.stop(driver_);
}

}  // namespace o80
