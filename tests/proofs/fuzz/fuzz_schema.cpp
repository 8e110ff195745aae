// Whatever stands in a segment's schema pages, or comes from a robot library, is used whole or
// refused whole.

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <vector>

#include "control/batch/command_check.hpp"
#include "control/queue/controller.hpp"
#include "control/receiving/pool.hpp"
#include "describe/table.hpp"
#include "fuzz/bytes.hpp"
#include "fuzz/robot.hpp"
#include "o80/base/error.hpp"
#include "o80/describe/layout.hpp"

namespace o80::fuzz {
namespace {

struct Deaf final : StatusSink {
  void changed(const StatusChange&) noexcept override {}
  void freed(std::uint32_t, std::uint32_t) noexcept override {}
};

/// All that is done with a schema that was let in.
void use(const Schema& schema) {
  static const Schema known = schema_of_robot();
  // a segment's row holds the extended values, and a segment of gigabytes is another test
  const RowLayout layout = row_layout(schema);
  if (layout.size > (1U << 22)) return;
  difference(known, schema);
  layout_difference(known, schema);
  layout_difference(schema, known);
  if (!(schema_from_bytes(to_bytes(schema)) == schema)) std::abort();
  if (!difference(schema, schema).empty()) std::abort();
  hash(schema);

  // what a frontend asks of it
  const CommandCheck check(schema);
  for (std::uint32_t i = 0; i < schema.actuators.size(); ++i) {
    std::vector<std::byte> state(schema.types[schema.actuators[i].type].size);
    try {
      check.targets(check.actuator(schema.actuators[i].name.view()), state);
      check.speed(i, 1.0);
      std::fill(state.begin(), state.end(), std::byte{0xff});
      check.targets(i, state);
    } catch (const InvalidArgument&) {
      continue;
    }
  }
  // and what a backend does, which has a period
  Schema paced = schema;
  paced.head.period = std::max<std::int64_t>(schema.head.period, 1);
  BlockPool pool(16);
  Deaf deaf;
  Controller controller(paced, pool, deaf, 1);
  const std::vector<std::uint64_t> observed(layout.block / 8 + 1);
  const auto* bytes = reinterpret_cast<const std::byte*>(observed.data());
  controller.restart(bytes, nullptr, 0);
  controller.step(1, bytes);
}

template <class Row>
void edit(Bytes& bytes, std::vector<Row>& rows) {
  if (rows.empty()) return;
  Row& row = rows[bytes.below(static_cast<std::uint32_t>(rows.size()))];
  const std::uint32_t at = bytes.below(sizeof(Row));
  const auto with =
      bytes.take(std::min<std::size_t>(bytes.number<std::uint8_t>() % 9, sizeof(Row) - at));
  if (!with.empty()) std::memcpy(reinterpret_cast<std::byte*>(&row) + at, with.data(), with.size());
}

template <class Row>
void resize(Bytes& bytes, std::vector<Row>& rows) {
  rows.resize(bytes.number<std::uint8_t>() % 8, rows.empty() ? Row{} : rows.front());
}

/// Calls `change` with the rows of this place in the list.
template <class Change, class... Rows>
void change_one(std::size_t place, Change&& change, Rows&... rows) {
  std::size_t i = 0;
  ((i++ == place ? change(rows) : void()), ...);
}

/// A good schema with bytes of its rows changed: as a robot library may bring it.
Schema edited(Bytes& bytes) {
  Schema schema = schema_of_robot();
  while (!bytes.empty()) {
    const std::size_t what = bytes.number<std::uint8_t>() % 11;
    if (what < 7) {
      change_one(
          what, [&](auto& rows) { edit(bytes, rows); }, schema.types, schema.fields, schema.labels,
          schema.groups, schema.actuators, schema.limits, schema.requests);
    } else if (what < 10) {
      change_one(
          what - 7, [&](auto& rows) { resize(bytes, rows); }, schema.groups, schema.actuators,
          schema.requests);
    } else {
      std::vector<SchemaHead> head{schema.head};
      edit(bytes, head);
      schema.head = head.front();
    }
  }
  return schema;
}

}  // namespace

void run(Bytes bytes) {
  try {
    switch (bytes.number<std::uint8_t>() % 3) {
      case 0:
        use(schema_from_bytes(bytes.rest()));
        break;
      case 1:
        use(schema_from_bytes(to_bytes(edited(bytes))));
        break;
      default: {
        const Schema schema = edited(bytes);
        check(schema);
        use(schema);
      }
    }
  } catch (const Error&) {
    return;
  }
}

}  // namespace o80::fuzz
