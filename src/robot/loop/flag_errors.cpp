#include "robot/loop/flag_errors.hpp"

#include <algorithm>

#include "o80/base/nearest_name.hpp"

namespace o80 {

namespace {

std::string takes_no_value(const std::string& flag, std::string_view value) {
  return "--" + flag + " takes no value, got '" + std::string(value) +
         "': give it without a value, or leave it out";
}

/// "--name=value" => name; without dashes: nothing.
std::string_view flag_name(std::string_view word) {
  if (!word.starts_with("--")) return {};
  word.remove_prefix(2);
  return word.substr(0, word.find('='));
}

}  // namespace

std::string refused_flag(std::string_view word, const std::vector<std::string>& flags,
                         const std::vector<std::string>& switches) {
  std::string name(flag_name(word));
  std::ranges::replace(name, '_', '-');
  const std::string::size_type value = word.find('=');
  if (value != std::string_view::npos && std::ranges::find(switches, name) != switches.end()) {
    return takes_no_value(name, word.substr(value + 1));
  }
  std::vector<std::string> begun;
  for (const std::string& flag : flags) {
    if (!name.empty() && flag.starts_with(name)) begun.push_back("--" + flag);
  }
  const std::string given(word.substr(0, value));
  if (begun.size() > 1) return given + " may be " + first_names(begun) + ": write it out";
  const std::string near = nearest_name(name, flags);
  return "there is no flag " + given +
         (near.empty() ? "; see --help" : ". Did you mean --" + near + "? See --help");
}

std::string refused_word(std::string_view word, std::span<const std::string> words,
                         const std::vector<std::string>& switches) {
  for (std::size_t i = 1; i < words.size(); ++i) {
    const std::string before(flag_name(words[i - 1]));
    if (words[i] == word && std::ranges::find(switches, before) != switches.end()) {
      return takes_no_value(before, word);
    }
  }
  const bool flag_without_dashes = word.find('=') != std::string_view::npos;
  return "'" + std::string(word) + "' is not a flag: flags begin with --" +
         (flag_without_dashes ? ", for example --" + std::string(word) : "; see --help");
}

}  // namespace o80
