#include "states.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <span>
#include <string_view>
#include <type_traits>

#include "arguments.hpp"
#include "control/batch/record.hpp"
#include "describe/visit_number.hpp"
#include "o80/base/error.hpp"

using o80::FieldRow;
using o80::InvalidArgument;
using o80::Kind;
using o80::Schema;

namespace {

template <class T>
void store(std::byte* to, T value) {
  std::memcpy(to, &value, sizeof value);
}

/// The value as a Python int if it is a whole number, otherwise null.
nb::object whole_number(nb::handle value) {
  if (PyFloat_Check(value.ptr())) {
    const double number = PyFloat_AS_DOUBLE(value.ptr());
    if (std::isfinite(number) && number == std::floor(number)) {
      return nb::steal(PyLong_FromDouble(number));
    }
    return {};
  }
  PyObject* index = PyNumber_Index(value.ptr());
  if (index == nullptr) PyErr_Clear();
  return nb::steal(index);
}

template <class T>
void write_integer(nb::handle value, std::byte* to, const std::string& what) {
  const nb::object whole = whole_number(value);
  if (!whole.is_valid()) refuse(what, "an integer", value);
  constexpr auto kMin = std::numeric_limits<T>::min();
  constexpr auto kMax = std::numeric_limits<T>::max();
  T number{};
  if (!nb::try_cast<T>(whole, number)) {
    refuse(what, std::to_string(kMin) + " to " + std::to_string(kMax), value);
  }
  store(to, number);
}

template <class T>
void write_float(nb::handle value, std::byte* to, const std::string& what) {
  const double number = PyFloat_AsDouble(value.ptr());
  if (number == -1.0 && PyErr_Occurred() != nullptr) refuse(what, "a number", value);
  store(to, static_cast<T>(number));
}

void write_boolean(nb::handle value, std::byte* to, const std::string& what) {
  const nb::object whole = whole_number(value);
  std::int64_t number = -1;
  if (whole.is_valid()) {
    if (!nb::try_cast<std::int64_t>(whole, number)) PyErr_Clear();
  } else if (nb::hasattr(value, "dtype")) {
    number = PyObject_IsTrue(value.ptr());  // numpy.bool has no __index__
  }
  if (number != 0 && number != 1) refuse(what, "True or False", value);
  store(to, static_cast<std::uint8_t>(number));
}

template <class Row>
std::string names_of(std::span<const Row> rows) {
  std::string names;
  for (const Row& row : rows) names += (names.empty() ? "" : ", ") + row.name.str();
  return names;
}

void write_label(const Schema& schema, const FieldRow& field, nb::handle value, std::byte* to,
                 const std::string& what) {
  const auto labels =
      std::span<const o80::LabelRow>(schema.labels).subspan(field.first_label, field.labels);
  const bool is_text = PyUnicode_Check(value.ptr()) != 0;
  const std::string text = is_text ? string_of(value, "a label") : "";
  const nb::object whole = is_text ? nb::object() : whole_number(value);
  std::int64_t number = 0;
  const bool is_number = whole.is_valid() && nb::try_cast<std::int64_t>(whole, number);
  const auto found = std::ranges::find_if(labels, [&](const o80::LabelRow& label) {
    return is_text ? label.name.view() == text : is_number && label.value == number;
  });
  if (found == labels.end()) refuse(what, "one of " + names_of(labels), value);
  std::memcpy(to, &found->value, field.size);  // little-endian
}

std::span<const FieldRow> fields_in(const Schema& schema, const o80::TypeRow& row) {
  return std::span(schema.fields).subspan(row.first_field, row.fields);
}

std::string fields_of(const Schema& schema, const o80::TypeRow& row) {
  const std::string there = names_of(fields_in(schema, row));
  return there.empty() ? "it has no fields" : "its fields are " + there;
}

/// Writes a Python value into the bytes of a struct.
class Writer {
 public:
  Writer(const Schema& schema, StateBytes& state, Missing missing)
      : schema_(schema), state_(state), missing_(missing) {}

  /// `number`: index of the struct's first number in the whole state.
  void write(std::uint32_t type, nb::handle value, std::byte* to, std::uint32_t number,
             const std::string& what) {
    if (const FieldRow* alone = plain_number(schema_, type)) {
      element(*alone, value, to, number, what);
    } else if (const nb::object names = names_of(value); !names.is_none()) {
      by_name(type, names, value, to, number, what);
    } else {
      in_order(type, value, to, number, what);
    }
  }

 private:
  /// The names of the fields in a mapping, a record or a structured array; None for others.
  static nb::object names_of(nb::handle value) {
    if (nb::hasattr(value, "dtype")) return value.attr("dtype").attr("names");
    if (!nb::hasattr(value, "keys")) return nb::none();
    return nb::list(nb::object(value.attr("keys")()));
  }

  void by_name(std::uint32_t type, nb::handle names, nb::handle value, std::byte* to,
               std::uint32_t number, const std::string& what) {
    const o80::TypeRow& row = schema_.types[type];
    std::uint32_t found = 0;
    std::uint32_t place = number;
    for (const FieldRow& member : fields_in(schema_, row)) {
      const nb::str name(member.name.view().data(), member.name.view().size());
      const int there = PySequence_Contains(names.ptr(), name.ptr());
      if (there < 0) throw nb::python_error();
      if (there != 0) {
        ++found;
        field(member, value[name], to + member.offset, place,
              "'" + member.name.str() + "' of " + what);
      } else {
        left_out(row, member, to, what);
      }
      place += numbers_in(member);
    }
    if (missing_ == Missing::kept && row.fields > 0 && nb::len(names) == 0) {
      throw InvalidArgument(what + " names no field: " + fields_of(schema_, row));
    }
    if (found == nb::len(names)) return;
    for (nb::handle name : names) {
      const auto is_named = [&](const FieldRow& each) {
        return name.equal(nb::str(each.name.view().data(), each.name.view().size()));
      };
      if (std::ranges::any_of(fields_in(schema_, row), is_named)) continue;
      throw InvalidArgument(what + " has no field " + repr_of(name) + ": " +
                            fields_of(schema_, row));
    }
  }

  void in_order(std::uint32_t type, nb::handle value, std::byte* to, std::uint32_t number,
                const std::string& what) {
    const o80::TypeRow& row = schema_.types[type];
    if (!is_sequence(value) && schema_.scalar_count(type) == 1) {  // its only number needs no name
      field(schema_.fields[row.first_field], value, to, number, what);
      return;
    }
    if (missing_ == Missing::kept && is_first_field(row, value)) {
      first_field(row, value, to, number, what);
      return;
    }
    if (!is_sequence_of(value, row.fields)) {
      refuse(what,
             "a number (its first field), a mapping, a record, or all its fields in order (" +
                 fields_of(schema_, row) + ")",
             value);
    }
    for (std::uint32_t i = 0; i < row.fields; ++i) {
      const FieldRow& member = schema_.fields[row.first_field + i];
      field(member, value[i], to + member.offset, number, "'" + member.name.str() + "' of " + what);
      number += numbers_in(member);
    }
  }

  /// A number, or a label if the first field is an enumeration.
  bool is_first_field(const o80::TypeRow& row, nb::handle value) const {
    if (row.fields == 0) return false;
    if (PyUnicode_Check(value.ptr()) != 0) {
      return schema_.fields[row.first_field].kind == Kind::enumeration;
    }
    return PyNumber_Check(value.ptr()) != 0 && PySequence_Check(value.ptr()) == 0;
  }

  /// The other fields keep their desired values.
  void first_field(const o80::TypeRow& row, nb::handle value, std::byte* to, std::uint32_t number,
                   const std::string& what) {
    const FieldRow& first = schema_.fields[row.first_field];
    field(first, value, to + first.offset, number, "'" + first.name.str() + "' of " + what);
    state_.whole = state_.whole && row.fields == 1;
  }

  void left_out(const o80::TypeRow& type, const FieldRow& member, std::byte* to,
                const std::string& what) {
    state_.whole = false;
    if (missing_ == Missing::kept) return;
    if (member.has_default == 0) {
      throw InvalidArgument(what + " needs '" + member.name.str() +
                            "', which has no default: " + fields_of(schema_, type));
    }
    const std::byte* from = schema_.defaults.data() + type.first_default + member.offset;
    std::memcpy(to + member.offset, from, std::size_t{member.size} * member.count());
  }

  /// A plain, a vector or a matrix field.
  void field(const FieldRow& member, nb::handle value, std::byte* to, std::uint32_t number,
             const std::string& what) {
    if (member.rows == 0) {
      element(member, value, to, number, what);
      return;
    }
    const std::uint32_t each = numbers_in(member) / member.count();
    expect_length(value, member.rows, what);
    for (std::uint32_t i = 0; i < member.rows; ++i) {
      const std::string where = what + " [" + std::to_string(i) + "]";
      const nb::object row = value[i];
      if (member.columns == 0) {
        element(member, row, to + i * member.size, number + i * each, where);
        continue;
      }
      expect_length(row, member.columns, where);
      for (std::uint32_t j = 0; j < member.columns; ++j) {
        const std::uint32_t place = i * member.columns + j;
        element(member, row[j], to + place * member.size, number + place * each,
                where + " [" + std::to_string(j) + "]");
      }
    }
  }

  void element(const FieldRow& member, nb::handle value, std::byte* to, std::uint32_t number,
               const std::string& what) {
    if (member.kind == Kind::structure) {
      write(member.type, value, to, number, what);
      return;
    }
    write_number(schema_, member, value, to, what);
    state_.mask[number / 64] |= std::uint64_t{1} << (number % 64);
  }

  static void expect_length(nb::handle value, std::uint32_t length, const std::string& what) {
    if (!is_sequence_of(value, length)) {
      refuse(what, "a sequence of " + std::to_string(length), value);
    }
  }

  std::uint32_t numbers_in(const FieldRow& member) const {
    return member.count() *
           (member.kind == Kind::structure ? schema_.scalar_count(member.type) : 1);
  }

  const Schema& schema_;
  StateBytes& state_;
  Missing missing_;
};

}  // namespace

const FieldRow* plain_number(const Schema& schema, std::uint32_t type) {
  const o80::TypeRow& row = schema.types[type];
  if (row.fields != 1) return nullptr;
  const FieldRow& field = schema.fields[row.first_field];
  const bool plain = field.name.view().empty() && field.rows == 0 && field.kind != Kind::structure;
  return plain ? &field : nullptr;
}

void write_number(const Schema& schema, const FieldRow& field, nb::handle value, std::byte* to,
                  const std::string& what) {
  switch (field.kind) {
    case Kind::boolean:
      return write_boolean(value, to, what);
    case Kind::enumeration:
      return write_label(schema, field, value, to, what);
    case Kind::structure:
      throw InvalidArgument(what + " cannot be set from Python");
    default:
      break;
  }
  o80::visit_number(field.kind, [&](auto zero) {
    using Number = decltype(zero);
    if constexpr (std::is_floating_point_v<Number>) {
      write_float<Number>(value, to, what);
    } else {
      write_integer<Number>(value, to, what);
    }
  });
}

StateBytes::StateBytes(const Schema& schema, std::uint32_t type, nb::handle value,
                       const std::string& owner, Missing missing)
    : bytes(schema.types[type].size), mask(o80::mask_words(schema.scalar_count(type))) {
  Writer(schema, *this, missing).write(type, value, bytes.data(), 0, owner);
}

std::vector<std::byte> request_bytes(const Schema& schema, std::uint32_t request,
                                     nb::handle fields) {
  const o80::RequestRow& row = schema.requests[request];
  const std::string owner = "request '" + row.name.str() + "'";
  return StateBytes(schema, row.type, fields, owner, Missing::by_default).bytes;
}
