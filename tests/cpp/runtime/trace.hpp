#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <iterator>
#include <map>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include "runtime/station.hpp"

namespace o80::test {

/// A test in a few lines: what frontends send to a station, and what is to be seen after it.
///
/// Statements end with ';' or a line, and # begins a comment. `B:` before one names the frontend,
/// which is opened at its first mention; without a name it is A.
///
// clang-format off
///     0 to 5 over 9                 adds a command for actuator 0: `over` iterations, `until`,
///                                   `speed`, `overwrite`
///     0,1 to 5 6                    one command for several
///     purge, purge own, take, release, note, reset 5, refuse       adds one of these
///     a = 0 to 5, a = pulse at 20 late      sends what was added, with that command or without
///     a = resume 1                  sends the resume of a halt
///     run 3, missed 100, read 0 1.5, close, alive, halt, burst 5   the last until it stands
///     a completed, a.1 purged silence @7    a record's status; its reason and iteration if given
///     a says out of order           part of the text of its first record
///     a waits, a waits rejected     its wait ends, or raises NotCompleted with this text
///     a taken 4, a ended 8          its first and its last iteration
///     0 is 6; 0 rows 3: 0 0.5 1     desired states: the newest one; those from row 3 on
///     halted, halted silence @7, running    the halt in force, or none
// clang-format on
class Trace {
 public:
  explicit Trace(const BackendOptions& options, const std::function<void(Schema&)>& describe = {})
      : station(options, describe) {}

  void play(const std::string& script) {
    std::istringstream lines(script);
    for (std::string line; std::getline(lines, line);) {
      std::istringstream statements(line.substr(0, line.find('#')));
      for (std::string text; std::getline(statements, text, ';');) {
        std::istringstream in(text);
        words_.assign(std::istream_iterator<std::string>(in), {});
        const ::testing::ScopedTrace where(__FILE__, __LINE__, text);
        if (!words_.empty()) play_statement();
        if (::testing::Test::HasFatalFailure()) return;
      }
    }
  }

  StartedStation station;

 private:
  double number(std::size_t i) const { return std::stod(words_.at(i)); }
  auto whole(std::size_t i) const { return static_cast<std::int64_t>(number(i)); }
  auto small(std::size_t i) const { return static_cast<std::uint32_t>(number(i)); }
  /// Place of a word, or 0.
  std::size_t find(const char* word) const {
    const auto found = std::ranges::find(words_, word);
    return found == words_.end() ? 0 : static_cast<std::size_t>(found - words_.begin());
  }
  /// Words from the third on.
  std::string rest() const {
    std::string text = words_[2];
    for (std::size_t i = 3; i < words_.size(); ++i) text += " " + words_[i];
    return text;
  }
  void drop(std::ptrdiff_t count) { words_.erase(words_.begin(), words_.begin() + count); }

  void play_statement() {
    std::string name = "A";
    if (words_[0].back() == ':') {
      name = words_[0];
      drop(1);
    }
    std::optional<UntypedFrontend>& frontend = frontends_[name];
    if (!frontend) frontend.emplace("pair");
    if (words_.size() > 1 && words_[1] == "=") {
      const std::string batch = words_[0];
      drop(2);
      PulseOptions options;
      if (find("at") > 0) options.at = whole(find("at") + 1);
      if (find("late") > 0) options.late = PulseOptions::Late::now;
      if (words_[0] == "resume") {
        batches_[batch] = send_resume(*frontend, small(1));
        return;
      }
      ASSERT_TRUE(words_[0] == "pulse" || adds(*frontend)) << "unknown command";
      batches_[batch] = frontend->pulse(options);
    } else if (words_[0] == "close") {
      frontend.reset();
    } else {
      ASSERT_TRUE(adds(*frontend) || acts(*frontend) || expects(*frontend)) << "unknown statement";
    }
  }

  bool adds(UntypedFrontend& frontend) {
    const std::string& verb = words_[0];
    if (words_.size() > 2 && words_[1] == "to") {
      CommandOptions options;
      if (find("over") > 0) options.pace = iterations(whole(find("over") + 1));
      if (find("until") > 0) options.pace = until(whole(find("until") + 1));
      if (find("speed") > 0) options.pace = speed(number(find("speed") + 1));
      if (find("overwrite") > 0) options.mode = Mode::overwrite;
      std::vector<std::uint32_t> actuators;
      std::vector<double> targets;
      std::istringstream each(words_[0]);
      for (std::string actuator; std::getline(each, actuator, ',');) {
        actuators.push_back(static_cast<std::uint32_t>(std::stoul(actuator)));
        targets.push_back(number(1 + actuators.size()));
      }
      if (actuators.size() == 1) {
        add(frontend, actuators[0], targets[0], options);
      } else {
        frontend.add_commands(actuators, std::as_bytes(std::span(targets)), options);
      }
    } else if (verb == "purge" && find("own") > 0) {
      frontend.add_purge_own();
    } else if (verb == "purge") {
      frontend.add_purge();
    } else if (verb == "take") {
      frontend.add_take_control();
    } else if (verb == "release") {
      frontend.add_release_control();
    } else if (verb == "note") {
      frontend.add_mark("a note");
    } else if (verb == "reset") {
      add_request(frontend, Reset{.seed = small(1)});
    } else if (verb == "refuse") {
      add_request<Refuse>(frontend);
    } else {
      return false;
    }
    return true;
  }

  bool acts(UntypedFrontend& frontend) {
    const std::string& verb = words_[0];
    if (verb == "run") {
      station.run(static_cast<int>(whole(1)));
    } else if (verb == "missed") {
      station.backend.set_timing({.skipped = small(1)});
    } else if (verb == "read") {
      station.now.at(small(1)) = number(2);
    } else if (verb == "alive") {
      frontend.keep_alive();
    } else if (verb == "halt") {
      frontend.halt("a halt");
    } else if (verb == "burst") {
      frontend.start_burst(whole(1));
      EXPECT_EQ(station.drive(), Step::standing);
    } else {
      return false;
    }
    return true;
  }

  bool expects(UntypedFrontend& frontend) {
    const std::string& what = words_[0];
    const std::string verb = words_.size() > 1 ? words_[1] : "";
    if (verb == "is") {
      EXPECT_EQ(desired(frontend.latest(), small(0)), number(2));
    } else if (verb == "rows") {
      std::vector<double> expected;
      for (std::size_t i = 3; i < words_.size(); ++i) expected.push_back(number(i));
      const Iteration last = whole(2) + static_cast<Iteration>(expected.size()) - 1;
      EXPECT_EQ(desired(frontend, whole(2), last, small(0)), expected);
    } else if (what == "running") {
      EXPECT_FALSE(frontend.halted());
    } else if (what == "halted") {
      const auto halt = frontend.halted();
      EXPECT_TRUE(halt);
      if (halt) expect_words(1, std::string(to_text(halt->cause)), halt->iteration);
    } else if (const auto found = batches_.find(what.substr(0, what.find('.')));
               found != batches_.end()) {
      const Batch& batch = found->second;
      const std::size_t dot = what.find('.');
      const Handle handle =
          batch.handle(dot == std::string::npos ? 0 : std::stoul(what.substr(dot + 1)));
      if (verb == "taken") {
        EXPECT_EQ(batch.first_iteration(), whole(2));
      } else if (verb == "ended") {
        EXPECT_EQ(batch.last_iteration(), whole(2));
      } else if (verb == "says") {
        EXPECT_THAT(handle.text, ::testing::HasSubstr(rest()));
      } else if (verb == "waits" && words_.size() == 2) {
        batch.wait(kAtOnce);
      } else if (verb == "waits") {
        EXPECT_THAT(message_of<NotCompleted>([&] { batch.wait(kAtOnce); }),
                    ::testing::HasSubstr(rest()));
      } else {
        EXPECT_EQ(to_text(handle.status), verb);
        expect_words(2, std::string(to_text(handle.reason)), handle.iteration);
      }
    } else {
      return false;
    }
    return true;
  }
  /// Words from `first` on: a name, and @ with an iteration.
  void expect_words(std::size_t first, const std::string& name, Iteration iteration) {
    for (std::size_t i = first; i < words_.size(); ++i) {
      EXPECT_EQ(words_[i], words_[i][0] == '@' ? "@" + std::to_string(iteration) : name);
    }
  }

  std::vector<std::string> words_;
  std::map<std::string, std::optional<UntypedFrontend>> frontends_;
  std::map<std::string, Batch> batches_;
};

inline void play(const BackendOptions& options, const std::string& script,
                 const std::function<void(Schema&)>& describe = {}) {
  Trace(options, describe).play(script);
}
inline void play(const std::string& script) { play({.segment = "pair"}, script); }

}  // namespace o80::test
