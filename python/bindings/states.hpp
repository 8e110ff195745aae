#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "nb.hpp"
#include "o80/describe/schema.hpp"

/// The field of a type that is a plain number; null for a type with named fields.
const o80::FieldRow* plain_number(const o80::Schema& schema, std::uint32_t type);

/// Writes one number; `what` names it in the error.
void write_number(const o80::Schema& schema, const o80::FieldRow& field, nb::handle value,
                  std::byte* to, const std::string& what);

/// Fields that a mapping leaves out keep their value, or get their default (an error if they have
/// none).
enum class Missing : std::uint8_t { kept, by_default };

/// A described struct from Python: a number, a mapping, a record, or a sequence of all its fields.
struct StateBytes {
  std::vector<std::byte> bytes;
  std::vector<std::uint64_t> mask;  // a bit for each number that was given
  bool whole = true;

  /// Throws InvalidArgument with `owner`, the field and the known fields.
  StateBytes(const o80::Schema& schema, std::uint32_t type, nb::handle value,
             const std::string& owner, Missing missing = Missing::kept);
};

/// The fields of a request. Those that are left out get their default.
std::vector<std::byte> request_bytes(const o80::Schema& schema, std::uint32_t request,
                                     nb::handle fields);
