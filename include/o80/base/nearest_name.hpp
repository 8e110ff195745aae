#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace o80 {

namespace nearest {

inline constexpr std::size_t kLongest = 64;  // longer names are not compared
inline constexpr std::size_t kListed = 5;    // names listed in an error

/// Maps upper to lower case, and '-' to '_'.
constexpr char folded(char c) noexcept {
  if (c >= 'A' && c <= 'Z') return static_cast<char>(c - 'A' + 'a');
  return c == '-' ? '_' : c;
}

constexpr bool is_digit(char c) noexcept { return c >= '0' && c <= '9'; }

/// Whether the digits are equal: joint_9 is another joint than joint_8, not a misspelt one.
inline bool same_digits(std::string_view a, std::string_view b) {
  const auto digits = [](std::string_view name) {
    std::string found(name);
    std::erase_if(found, [](char c) { return !is_digit(c); });
    return found;
  };
  return digits(a) == digits(b);
}

/// Number of edits from one name to the other: insert, remove, replace, swap two neighbours.
inline std::size_t edits(std::string_view a, std::string_view b) noexcept {
  if (a.size() > kLongest || b.size() > kLongest) return kLongest;
  std::array<std::array<std::size_t, kLongest + 1>, 3> rows{};
  for (std::size_t j = 0; j <= b.size(); ++j) rows[0][j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    auto& now = rows[i % 3];
    const auto& before = rows[(i - 1) % 3];
    const auto& earlier = rows[(i + 1) % 3];
    now[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const char x = folded(a[i - 1]);
      const char y = folded(b[j - 1]);
      const std::size_t replaced = x == y ? 0 : 1;
      now[j] = std::min({before[j] + 1, now[j - 1] + 1, before[j - 1] + replaced});
      const bool swapped = i > 1 && j > 1 && x == folded(b[j - 2]) && folded(a[i - 2]) == y;
      if (swapped) now[j] = std::min(now[j], earlier[j - 2] + 1);
    }
  }
  return rows[a.size() % 3][b.size()];
}

inline bool begins_with(std::string_view name, std::string_view begin) noexcept {
  return name.size() >= begin.size() && edits(name.substr(0, begin.size()), begin) == 0;
}

}  // namespace nearest

/// Returns the known name nearest to `given`; empty if none is near.
inline std::string nearest_name(std::string_view given, const std::vector<std::string>& known) {
  const std::size_t most = given.size() < 3 ? 0 : given.size() < 6 ? 1 : 2;
  std::string best;
  std::size_t least = most + 1;
  std::vector<std::string> begun;
  for (const std::string& name : known) {
    const std::size_t edits = nearest::edits(given, name);
    if (edits < least && nearest::same_digits(given, name)) {
      least = edits;
      best = name;
    }
    if (given.size() > 1 && nearest::begins_with(name, given)) begun.push_back(name);
  }
  return best.empty() && begun.size() == 1 ? begun.front() : best;
}

/// Joins the first five names or clauses, and the number of further ones.
inline std::string first_names(const std::vector<std::string>& names, const char* between = ", ",
                               const char* before_rest = " and ") {
  std::string text;
  for (std::size_t i = 0; i < names.size() && i < nearest::kListed; ++i) {
    text += (i == 0 ? "" : between) + names[i];
  }
  if (names.size() <= nearest::kListed) return text;
  return text + before_rest + std::to_string(names.size() - nearest::kListed) + " more";
}

/// Ends an error such as "there is no actuator 'elbw'": lists known names, suggests the nearest.
inline std::string names_instead(std::string_view given, const std::vector<std::string>& known) {
  if (known.empty()) return "; there are none";
  const std::string near = nearest_name(given, known);
  const std::string meant = near.empty() ? "" : ". Did you mean '" + near + "'?";
  const bool listed = near.empty() || known.size() <= nearest::kListed;
  return (listed ? "; there are: " + first_names(known) : "") + meant;
}

}  // namespace o80
