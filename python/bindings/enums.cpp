#include "enums.hpp"

#include <algorithm>
#include <array>
#include <string>

#include "arguments.hpp"
#include "o80/base/error.hpp"

std::size_t place_of(nb::handle word, std::span<const std::string_view> known, const char* name) {
  Py_ssize_t size = 0;
  const char* text =
      PyUnicode_Check(word.ptr()) ? PyUnicode_AsUTF8AndSize(word.ptr(), &size) : nullptr;
  if (text != nullptr) {
    const std::string_view given(text, static_cast<std::size_t>(size));
    const auto found = std::ranges::find(known, given);
    if (found != known.end()) return static_cast<std::size_t>(found - known.begin());
  }
  const bool is_pair = known.size() == 2;
  std::string there;
  for (const std::string_view one : known) {
    if (!there.empty()) there += is_pair ? " or " : ", ";
    there += "'" + std::string(one) + "'";
  }
  refuse(name, (is_pair ? "" : "one of ") + there, word);
}

namespace {

/// The value whose text is `word`.
template <class Value, std::size_t N>
Value parse(nb::handle word, const std::array<Value, N>& values, const char* name) {
  std::array<std::string_view, N> words;
  std::ranges::transform(values, words.begin(), [](Value value) { return o80::to_text(value); });
  return values[place_of(word, words, name)];
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
