#include "robot/driver/driver_instance.hpp"

#include <algorithm>

#include "describe/table.hpp"
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
  for (const Option& option : options_of(table)) {
    for (const auto& [name, text] : options) {
      if (option.kind != kFaceKind || name != option.name || text.empty()) continue;
      check_face(describing::face_from(text));
    }
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
  const auto take = [](void* context, const std::byte* bytes, std::uint64_t size,
                       const TypeHooks* hooks) {
    auto& out = *static_cast<Schema*>(context);
    out = describing::schema_in({bytes, size});
    out.hooks.assign(hooks, hooks + out.types.size());
  };
  const int failed = table_.describe(driver_, period, &schema, take, &fault);
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

/// What a driver answered; an unknown answer is a failure.
Served DriverInstance::served(RequestAnswer answer, std::string_view text) noexcept {
  if (answer > RequestAnswer::running) answer = RequestAnswer::failed;
  return Served::with(static_cast<Served::Kind>(answer), text);
}

Served DriverInstance::served(const RequestReport& report) noexcept {
  return served(report.answer, {report.text, strnlen(report.text, sizeof report.text)});
}

/// The same for an answer that is no report: a failure is the driver's fault.
Served DriverInstance::answered(RequestAnswer answer, const FaultText& text) noexcept {
  const Served how = served(answer, {text.text, strnlen(text.text, sizeof text.text)});
  if (how.kind == Served::Kind::failed) fault_ = text;
  return how;
}

Served DriverInstance::request(std::uint32_t index, const std::byte* payload) noexcept {
  FaultText text{};
  return answered(table_.request(driver_, index, payload, &text), text);
}

bool DriverInstance::halt() noexcept {
  return table_.halt == nullptr || table_.halt(driver_, &fault_) == 0;
}

Served DriverInstance::resume() noexcept {
  if (table_.resume == nullptr) return Served::done();
  FaultText text{};
  return answered(table_.resume(driver_, &text), text);
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
