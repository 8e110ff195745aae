#pragma once

#include <cstddef>
#include <cstring>
#include <span>
#include <vector>

#include "o80/describe/schema.hpp"

// Bytes of a schema in segments, recordings, the interface of robot libraries,
// and the text of a Face: TableHead, SchemaHead, the rows of each table; then, if not
// empty, the model and the integrals.

namespace o80 {
namespace describing {

struct TableHead {
  std::uint64_t magic = 0x616D656863533038;  // "80Schema"
  std::uint32_t counts[8] = {};
  std::uint32_t sizes[8] = {};
};

/// Calls `visit` for every table of a schema, in the order of the bytes.
template <class SchemaLike, class Visit>
void each_table(SchemaLike& schema, Visit&& visit) {
  visit(0, schema.types);
  visit(1, schema.fields);
  visit(2, schema.labels);
  visit(3, schema.groups);
  visit(4, schema.actuators);
  visit(5, schema.limits);
  visit(6, schema.requests);
  visit(7, schema.defaults);
}

/// Head of the model: precedes its rows, file name and text.
struct ShownHead {
  std::uint64_t magic = 0x6E776F6853303880;  // "80Shown" behind a byte that is no text
  std::uint32_t rows = 0;
  std::uint32_t row_size = sizeof(ShownRow);
  std::uint32_t file = 0;  // [bytes]
  std::uint32_t mjcf = 0;  // [bytes]
};

/// Head of the bounds of integrals: precedes their rows.
struct IntegralsHead {
  std::uint64_t magic = 0x6C6172676E4980;  // "80Ingral" behind a byte that is no text
  std::uint32_t rows = 0;
  std::uint32_t row_size = sizeof(IntegralRow);
};

/// Reads parts of arbitrary bytes.
class PartReader {
 public:
  explicit PartReader(std::span<const std::byte> bytes) : left_(bytes) {}

  /// Reads a head; false if the next bytes do not have its magic number.
  template <class Head>
  bool begins(Head& head) {
    const std::uint64_t magic = head.magic;
    if (left_.size() < sizeof head || std::memcmp(left_.data(), &magic, sizeof magic) != 0) {
      return false;
    }
    take(&head, sizeof head);
    return true;
  }
  /// Reads rows; throws InvalidArgument(why) if there are fewer.
  template <class Rows>
  void rows(Rows& rows, std::size_t count, const char* why) {
    using Row = typename Rows::value_type;
    if (count > left_.size() / sizeof(Row)) throw InvalidArgument(why);
    rows.resize(count);
    if (count > 0) take(rows.data(), count * sizeof(Row));
  }
  /// Copies bytes; the caller has checked their number.
  void take(void* out, std::size_t size) {
    std::memcpy(out, left_.data(), size);
    left_ = left_.subspan(size);
  }

 private:
  std::span<const std::byte> left_;
};

/// Parses a schema without checking its indices and sizes.
/// Throws InvalidArgument for truncated bytes or rows of another size.
inline Schema schema_in(std::span<const std::byte> bytes) {
  Schema schema;
  PartReader reader(bytes);
  TableHead head;
  if (bytes.size() < sizeof head + sizeof schema.head) throw InvalidArgument("too short");
  if (!reader.begins(head)) throw InvalidArgument("it has no schema");
  reader.take(&schema.head, sizeof schema.head);
  each_table(schema, [&]<class Row>(int i, std::vector<Row>& rows) {
    if (head.sizes[i] != sizeof(Row)) throw InvalidArgument("entries of another size");
    reader.rows(rows, head.counts[i], "too short");
  });
  schema.hooks.resize(schema.types.size());
  schema.keys.resize(schema.types.size());
  ShownHead shown;
  if (reader.begins(shown)) {
    if (shown.row_size != sizeof(ShownRow)) throw InvalidArgument("a model of another size");
    reader.rows(schema.shown.values, shown.rows, "the model is cut off");
    reader.rows(schema.shown.file, shown.file, "the model is cut off");
    reader.rows(schema.shown.mjcf, shown.mjcf, "the model is cut off");
  }
  IntegralsHead integrals;
  if (reader.begins(integrals)) {
    const bool fits = integrals.row_size == sizeof(IntegralRow);
    reader.rows(schema.integrals, fits ? integrals.rows : SIZE_MAX,
                "integral bounds of another size");
  }
  return schema;
}

/// FNV-1a, 64 bits.
inline std::uint64_t hash_of(std::span<const std::byte> bytes) {
  std::uint64_t value = 0xCBF29CE484222325;
  for (const std::byte byte : bytes) {
    value = (value ^ static_cast<std::uint64_t>(byte)) * 0x100000001B3;
  }
  return value;
}

}  // namespace describing

/// Serializes a schema.
inline std::vector<std::byte> to_bytes(const Schema& schema) {
  std::vector<std::byte> bytes;
  const auto put = [&](const auto& rows) {
    const auto part = std::as_bytes(std::span(rows));
    const std::size_t end = bytes.size();
    bytes.resize(end + part.size());  // g++ 12 warns of an insert() here, at -O3
    if (!part.empty()) std::memcpy(&bytes[end], part.data(), part.size());
  };
  describing::TableHead head;
  describing::each_table(schema, [&]<class Row>(int i, const std::vector<Row>& rows) {
    head.counts[i] = static_cast<std::uint32_t>(rows.size());
    head.sizes[i] = sizeof(Row);
  });
  put(std::span(&head, 1));
  put(std::span(&schema.head, 1));
  describing::each_table(schema, [&](int, const auto& rows) { put(rows); });
  if (const ShownModel& shown = schema.shown; !shown.empty()) {
    const describing::ShownHead shown_head{.rows = static_cast<std::uint32_t>(shown.values.size()),
                                           .file = static_cast<std::uint32_t>(shown.file.size()),
                                           .mjcf = static_cast<std::uint32_t>(shown.mjcf.size())};
    put(std::span(&shown_head, 1));
    put(shown.values);
    put(shown.file);
    put(shown.mjcf);
  }
  if (!schema.integrals.empty()) {
    const describing::IntegralsHead integrals{
        .rows = static_cast<std::uint32_t>(schema.integrals.size())};
    put(std::span(&integrals, 1));
    put(schema.integrals);
  }
  return bytes;
}

}  // namespace o80
