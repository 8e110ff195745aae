#pragma once

#include <charconv>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include "o80/base/nearest_name.hpp"
#include "o80/describe/describe.hpp"
#include "o80/describe/face.hpp"

namespace o80 {

/// One option of a robot: a field of its described Config, or of a described struct in it.
struct Option {
  std::string name;
  std::string kind;  // "number", "integer", "boolean", "text", "one of: a, b", "seed", "face"
  std::string default_text;
  std::string help;
  std::string unit;
};

/// Seed of a driver's random numbers, as a field of its Config. If the option is not given,
/// o80 draws a seed at the robot's start, and records the seed with the other options, so that each
/// run can be repeated. 0 in a Config that a program creates.
struct Seed {
  std::uint64_t value = 0;
};
inline constexpr std::string_view kSeedKind = "seed";

namespace describing {

template <class T>
std::string option_kind() {
  if constexpr (std::is_same_v<T, Seed>) {
    return std::string(kSeedKind);
  } else if constexpr (std::is_same_v<T, Face>) {
    return std::string(kFaceKind);
  } else if constexpr (std::is_same_v<T, bool>) {
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
                  "an option is a number, a boolean, a described enum, a std::string, a std::array "
                  "of those, or a described struct of options");
    return "text";
  }
}

template <class T>
std::string option_text(const T& value) {
  if constexpr (std::is_same_v<T, Seed>) {
    return option_text(value.value);
  } else if constexpr (std::is_same_v<T, Face>) {
    return "";  // no seed unless given
  } else if constexpr (std::is_same_v<T, bool>) {
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
  if (kind == kSeedKind) return "a whole number, at least 0";
  if (kind.starts_with("one of") || (kind[0] >= '0' && kind[0] <= '9')) return kind;
  return (kind == "integer" ? "an " : "a ") + kind;
}

/// Parses a text into `value`; false if the text is invalid.
template <class T>
bool parse_option(std::string_view text, T& value) {
  if constexpr (std::is_same_v<T, Seed>) {
    return parse_option(text, value.value);
  } else if constexpr (std::is_same_v<T, Face>) {
    if (!text.empty()) value.schema = face_from(text);
    return true;
  } else if constexpr (std::is_same_v<T, bool>) {
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

/// Calls `visit(name, member of Config, text)` for every option. The options of a described struct
/// among the fields take their place, under their own names.
template <class Config, class Visit>
constexpr void each_option(Config& config, Visit&& visit) {
  using Described = std::remove_const_t<Config>;
  o80_describe(Tag<Described>{}, [&]<class Field>(std::string_view name, Field Described::* member,
                                                  std::size_t, std::string_view text) {
    if constexpr (DescribedStruct<Field>) {
      describing::each_option(config.*member, visit);
    } else {
      visit(name, config.*member, text);
    }
  });
}

/// Collects the option names of a Config, to find duplicates.
template <class Config, class Names>
constexpr void collect_option_names(Names& names, std::size_t& count) {
  o80_describe(Tag<Config>{}, [&]<class Field>(std::string_view name, Field Config::*, std::size_t,
                                               std::string_view) {
    if constexpr (DescribedStruct<Field>) {
      collect_option_names<Field>(names, count);
    } else {
      names[count++] = name;
    }
  });
}
template <class Config>
consteval bool has_repeated_option() {
  std::array<std::string_view, 1024> names;  // more than the options of any robot
  std::size_t count = 0;
  collect_option_names<Config>(names, count);
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t k = 0; k < i; ++k) {
      if (names[i] == names[k]) return true;
    }
  }
  return false;
}

}  // namespace describing

/// Options of a described Config. The fields of a nested described struct become options,
/// too, so that the options of a part can be a struct of that part.
template <class Config>
std::vector<Option> options_of() {
  static_assert(!describing::has_repeated_option<Config>(),
                "two options of this Config, or of the structs in it, have the same name");
  std::vector<Option> options;
  const Config defaults{};
  describing::each_option(
      defaults, [&]<class Value>(std::string_view name, const Value& value, std::string_view text) {
        FieldRow row;
        set_text(row, text);
        const std::string otherwise =
            std::is_same_v<Value, Seed> ? "drawn at each start" : describing::option_text(value);
        options.push_back({std::string(name), describing::option_kind<Value>(), otherwise,
                           row.help.str(), row.unit.str()});
      });
  return options;
}

/// Sets one field of a Config from a text; the error for an unknown name lists the options.
template <class Config>
void set_option(Config& config, std::string_view name, std::string_view text) {
  bool known = false;
  std::vector<std::string> names;
  describing::each_option(
      config, [&]<class Value>(std::string_view option, Value& value, std::string_view) {
        names.emplace_back(option);
        if (option != name) return;
        known = true;
        if (!describing::parse_option(text, value)) {
          throw InvalidArgument("option '" + std::string(name) + "' must be " +
                                describing::with_article(describing::option_kind<Value>()) +
                                ", got '" + std::string(text) + "'");
        }
      });
  if (!known) {
    throw InvalidArgument("there is no option '" + std::string(name) + "'" +
                          (names.empty() ? ": this robot has none" : names_instead(name, names)));
  }
}

}  // namespace o80
