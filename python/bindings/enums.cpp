#include "enums.hpp"

#include <array>

#include <string>

#include "arguments.hpp"
#include "o80/base/error.hpp"

namespace {

/// The value whose text is `word`; the error lists all values.
template <class Value, std::size_t N>
Value parse(nb::handle word, const std::array<Value, N>& values, const char* name) {
  Py_ssize_t size = 0;
  const char* text =
      PyUnicode_Check(word.ptr()) ? PyUnicode_AsUTF8AndSize(word.ptr(), &size) : nullptr;
  std::string there;
  for (const Value value : values) {
    const std::string_view known = o80::to_text(value);
    if (text != nullptr && known == std::string_view(text, static_cast<std::size_t>(size))) {
      return value;
    }
    there += (there.empty() ? "'" : ", '") + std::string(known) + "'";
  }
  refuse(name, "one of " + there, word);
}

/// The member of a Python enumeration, looked up once and kept until the process ends.
/// `count`: number of values; a value beyond them becomes the first one.
template <std::size_t count, class Value>
nb::object member(Value value, const char* type) {
  static std::array<PyObject*, count> known{};
  const auto index = static_cast<std::size_t>(value) < count ? static_cast<std::size_t>(value) : 0;
  if (known[index] == nullptr) {
    const std::string_view text = o80::to_text(value);
    known[index] = nb::module_::import_("o80.base.words")
                       .attr(type)(nb::str(text.data(), text.size()))
                       .release()
                       .ptr();
  }
  return nb::borrow(known[index]);
}

}  // namespace

o80::Mode mode_of(nb::handle word) {
  using enum o80::Mode;
  return parse(word, std::array{queue, overwrite}, "mode");
}

o80::Profile profile_of(nb::handle word) {
  using enum o80::Profile;
  const bool is_pace =
      PyUnicode_Check(word.ptr()) && PyUnicode_CompareWithASCIIString(word.ptr(), "fastest") == 0;
  if (is_pace) {
    throw o80::InvalidArgument(
        "'fastest' is a pace, not a profile: give fastest=True instead of a duration, speed or "
        "iterations");
  }
  return parse(word, std::array{linear, minimum_jerk, as_sent}, "profile");
}

o80::Profile profile_of_rows(nb::handle word) {
  using enum o80::Profile;
  return parse(word, std::array{smooth, monotone, linear, hold}, "the profile of a chunk");
}

o80::Profile profile_of_trajectory(nb::handle word) {
  using enum o80::Profile;
  return parse(word, std::array{smooth, monotone, linear, hold, minimum_jerk},
               "the profile of a trajectory");
}

o80::Start start_of(nb::handle word) {
  using enum o80::Start;
  return parse(word, std::array{desired, observed}, "start");
}

nb::object python_word(o80::Status status) { return member<o80::kStatuses>(status, "Status"); }
nb::object python_word(o80::Reason reason) { return member<o80::kReasons>(reason, "Reason"); }
