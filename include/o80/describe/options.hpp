#pragma once

#include <charconv>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include "o80/base/nearest_name.hpp"
#include "o80/describe/describe.hpp"

namespace o80 {

/// One option of a robot: a field of its described Config.
struct Option {
  std::string name;
  std::string kind;  // "number", "integer", "boolean", "text", "one of: a, b"
  std::string default_text;
  std::string help;
  std::string unit;
};

namespace describing {

template <class T>
std::string option_kind() {
  if constexpr (std::is_same_v<T, bool>) {
    return "boolean";
  } else if constexpr (std::is_integral_v<T>) {
    return "integer";
  } else if constexpr (std::is_floating_point_v<T>) {
    return "number";
  } else if constexpr (DescribedEnum<T>) {
    std::string names;
    o80_labels(Tag<T>{}, [&](std::string_view label, T) {
      names += (names.empty() ? "" : ", ") + std::string(label);
    });
    return "one of: " + names;
  } else if constexpr (ArrayOf<T>::value) {
    return std::to_string(ArrayOf<T>::kCount) + " x " + option_kind<typename ArrayOf<T>::Element>();
  } else {
    static_assert(std::is_same_v<T, std::string>,
                  "an option is a number, a boolean, a described enum, a std::string or a "
                  "std::array of those");
    return "text";
  }
}

template <class T>
std::string option_text(const T& value) {
  if constexpr (std::is_same_v<T, bool>) {
    return value ? "true" : "false";
  } else if constexpr (std::is_arithmetic_v<T>) {
    std::array<char, 64> text{};
    const auto end = std::to_chars(text.data(), text.data() + text.size(), value).ptr;
    return {text.data(), end};
  } else if constexpr (DescribedEnum<T>) {
    std::string name;
    o80_labels(Tag<T>{}, [&](std::string_view label, T known) {
      if (known == value) name = std::string(label);
    });
    return name;
  } else if constexpr (ArrayOf<T>::value) {
    std::string text;
    for (const auto& element : value) text += (text.empty() ? "" : ",") + option_text(element);
    return text;
  } else {
    return value;
  }
}

/// "an integer" for "integer"; "one of: a, b" and "3 x number" stay as they are.
inline std::string with_article(const std::string& kind) {
  if (kind.starts_with("one of") || (kind[0] >= '0' && kind[0] <= '9')) return kind;
  return (kind == "integer" ? "an " : "a ") + kind;
}

/// Parses a text into `value`; false if the text is invalid.
template <class T>
bool parse_option(std::string_view text, T& value) {
  if constexpr (std::is_same_v<T, bool>) {
    const bool yes = text == "true" || text == "1" || text == "yes" || text == "True";
    const bool no = text == "false" || text == "0" || text == "no" || text == "False";
    value = yes;
    return yes || no;
  } else if constexpr (std::is_arithmetic_v<T>) {
    const auto result = std::from_chars(text.data(), text.data() + text.size(), value);
    return result.ec == std::errc() && result.ptr == text.data() + text.size();
  } else if constexpr (DescribedEnum<T>) {
    bool found = false;
    o80_labels(Tag<T>{}, [&](std::string_view label, T known) {
      if (label != text) return;
      value = known;
      found = true;
    });
    return found;
  } else if constexpr (ArrayOf<T>::value) {
    for (std::size_t i = 0; i < value.size(); ++i) {
      const auto comma = text.find(',');
      const bool is_last = i + 1 == value.size();
      if ((comma == std::string_view::npos) != is_last) return false;
      if (!parse_option(text.substr(0, comma), value[i])) return false;
      if (!is_last) text.remove_prefix(comma + 1);
    }
    return true;
  } else {
    value = std::string(text);
    return true;
  }
}

}  // namespace describing

/// The options of a described Config.
template <class Config>
std::vector<Option> options_of() {
  std::vector<Option> options;
  const Config defaults{};
  o80_describe(Tag<Config>{}, [&]<class Field>(std::string_view name, Field Config::* member,
                                               std::size_t, std::string_view text) {
    FieldRow row;
    set_text(row, text);
    options.push_back({std::string(name), describing::option_kind<Field>(),
                       describing::option_text(defaults.*member), row.help.str(), row.unit.str()});
  });
  return options;
}

/// Sets one field of a Config from a text; the error for an unknown name lists the options.
template <class Config>
void set_option(Config& config, std::string_view name, std::string_view text) {
  bool known = false;
  std::vector<std::string> names;
  o80_describe(Tag<Config>{}, [&]<class Field>(std::string_view field, Field Config::* member,
                                               std::size_t, std::string_view) {
    names.emplace_back(field);
    if (field != name) return;
    known = true;
    if (!describing::parse_option(text, config.*member)) {
      throw InvalidArgument("option '" + std::string(name) + "' must be " +
                            describing::with_article(describing::option_kind<Field>()) + ", got '" +
                            std::string(text) + "'");
    }
  });
  if (!known) {
    throw InvalidArgument("there is no option '" + std::string(name) + "'" +
                          (names.empty() ? ": this robot has none" : names_instead(name, names)));
  }
}

}  // namespace o80
