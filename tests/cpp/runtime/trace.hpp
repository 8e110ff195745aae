#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <iterator>
#include <map>
#include <optional>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include "o80/base/error.hpp"
#include "o80/runtime/journal.hpp"
#include "runtime/manual_backend.hpp"

namespace o80::test {

/// A test in a few lines: what frontends send to a manual backend, and what is to be seen after it.
///
/// Statements end with ';' or a line, and # begins a comment. `B:` before one names the frontend,
/// which is opened at its first mention; without a name it is A.
///
// clang-format off
///     0 to 5 over 9                 adds a command for actuator 0: `over` iterations, `for` ms,
///                                   `until`, `speed`, `fastest`, `overwrite`
///     0,1 to 5 6                    one command for several
///     purge, purge 0, purge own, take, release, note         adds one of these
///     reset 5, snapshot, refuse, break, home, calibrate      adds a request
///     a = 0 to 5, a = pulse at 20 late      sends what was added, with that command or without
///     a = resume 1 accepting        sends the resume of a halt, accepting the reading or not
///     a = burst 5 at 3, a = to end  sends what was added with a burst, or one until its end
///     run 3, drive                  iterates so often; until it stands still
///     cancel a, cut                 calls a burst off; the backend cuts the one under way
///     missed 100, read 0 1.5, offset 0 6, close, alive, halt enough, burst 5   the last until it stands
///     interrupt 0, driver halts hot, end stopped, end failed hot, stop   what the driver does
///     home ends, home ends rejected why, home progress text  of a request that runs
///     in 4 STATEMENT                is played in the row of iteration 4, before it is published
///     while refused STATEMENT       is played while a request `refuse` is served
///
///     a completed, a.1 purged silence @7    a record's status; its reason and iteration if given
///     a says out of order           part of the text of its first record
///     a shows looks for             the progress of its first record, or nothing
///     a waits, a waits rejected     its wait ends, or raises NotCompleted with this text
///     a raises BackendHalted hot    its wait raises this error with this text
///     a taken 4, a ended 8, a open  its first and its last iteration; it has not ended
///     a done 5, a undone            the last iteration of a burst
///     0 is 6; 0 rows 3: 0 0.5 1     desired states: the newest one; those from row 3 on
///     row 3 fresh, row 3 halted, row 3 free      its marks
///     last 7                        the newest row
///     halted, halted silence @7, running    the halt in force, or none; `halted why TEXT`
///     runs home calibrate           the requests that run
///     homed 2, fresh starts 1       how often the driver was asked
///     ends, fails hot, brakes       no iteration follows; the reason; a last one brakes
///     journal taken@3 completed@5   the entries since the last look: kind or status, iteration
// clang-format on
class Trace {
 public:
  explicit Trace(const BackendOptions& options, const std::function<void(Schema&)>& describe = {})
      : manual(options, describe) {
    observer_.emplace("pair", FrontendOptions{.access = Access::read_only});
    journal_.emplace(*observer_);
    manual.on_refuse = [this] { play_all(std::exchange(while_refused_, {})); };
    manual.before_publish = [this] {
      if (auto found = in_row_.extract(manual.backend.iteration())) play_all(found.mapped());
    };
  }

  void play(const std::string& script) {
    std::istringstream lines(script);
    for (std::string line; std::getline(lines, line);) {
      std::istringstream statements(line.substr(0, line.find('#')));
      for (std::string text; std::getline(statements, text, ';');) {
        play_all({text});
        if (::testing::Test::HasFatalFailure()) return;
      }
    }
  }

  StartedBackend manual;

 private:
  using Statements = std::vector<std::string>;
  using Verbs = std::map<std::string, std::function<void(UntypedFrontend&)>>;

  void play_all(const Statements& statements) {
    for (const std::string& text : statements) {
      std::istringstream in(text);
      const auto before = std::exchange(
          words_, {std::istream_iterator<std::string>(in), std::istream_iterator<std::string>()});
      const ::testing::ScopedTrace where(__FILE__, __LINE__, text);
      if (!words_.empty()) play_statement();
      words_ = before;
    }
  }
  double number(std::size_t i) const { return std::stod(words_.at(i)); }
  std::int64_t whole(std::size_t i) const { return static_cast<std::int64_t>(number(i)); }
  std::uint32_t small(std::size_t i) const { return static_cast<std::uint32_t>(number(i)); }
  /// Place of a word, or 0.
  std::size_t find(const char* word) const {
    const auto found = std::ranges::find(words_, word);
    return found == words_.end() ? 0 : static_cast<std::size_t>(found - words_.begin());
  }
  /// Words from here on.
  std::string rest(std::size_t first = 2) const {
    std::string text;
    for (std::size_t i = first; i < words_.size(); ++i) text += (i > first ? " " : "") + words_[i];
    return text;
  }
  bool begins(std::string_view words) const { return (rest(0) + " ").starts_with(words); }
  void drop(std::ptrdiff_t count) { words_.erase(words_.begin(), words_.begin() + count); }

  void play_statement() {
    std::string name = "A:";
    if (words_[0].back() == ':') {
      name = words_[0];
      drop(1);
    }
    if (words_[0] == "in") return in_row_[whole(1)].push_back(name + " " + rest());
    if (begins("while refused ")) return while_refused_.push_back(name + " " + rest());
    std::optional<UntypedFrontend>& frontend = frontends_[name];
    if (!frontend) frontend.emplace("pair");
    if (words_.size() > 1 && words_[1] == "=") {
      const std::string batch = words_[0];
      drop(2);
      batches_[batch] = sent(*frontend, batch);
    } else if (words_[0] == "close") {
      frontend.reset();
    } else {
      ASSERT_TRUE(adds(*frontend) || acts(*frontend) || expects(*frontend)) << "unknown statement";
    }
  }

  Batch sent(UntypedFrontend& frontend, const std::string& name) {
    PulseOptions options;
    if (find("at") > 0) options.at = whole(find("at") + 1);
    if (find("late") > 0) options.late = PulseOptions::Late::now;
    if (words_[0] == "resume") return send_resume(frontend, small(1), find("accepting") > 0);
    if (begins("to end ")) return frontend.pulse_to_end();
    if (words_[0] == "burst") {
      bursts_.insert_or_assign(name, frontend.start_burst(whole(1), options));
      return bursts_.at(name).batch();
    }
    EXPECT_TRUE(words_[0] == "pulse" || adds(frontend)) << "unknown command";
    return frontend.pulse(options);
  }

  bool plays(const Verbs& verbs, UntypedFrontend& frontend) {
    const auto verb = verbs.find(words_[0]);
    if (verb == verbs.end()) return false;
    verb->second(frontend);
    return true;
  }

  bool adds(UntypedFrontend& frontend) {
    const std::string second = words_.size() > 1 ? words_[1] : "";
    if (second == "ends" || second == "progress") return false;
    if (second != "to" || words_.size() == 2) return plays(adding_, frontend);
    CommandOptions options;
    if (find("over") > 0) options.pace = iterations(whole(find("over") + 1));
    if (find("for") > 0) {
      options.pace =
          duration(std::chrono::microseconds(std::lround(1e3 * number(find("for") + 1))));
    }
    if (find("until") > 0) options.pace = until(whole(find("until") + 1));
    if (find("speed") > 0) options.pace = speed(number(find("speed") + 1));
    if (find("fastest") > 0) options.pace = fastest();
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
    return true;
  }
  const Verbs adding_{
      {"purge",
       [this](auto& frontend) {
         if (begins("purge own ")) {
           frontend.add_purge_own();
         } else {
           frontend.add_purge(words_.size() > 1 ? small(1) : kEveryActuator);
         }
       }},
      {"take", [](auto& frontend) { frontend.add_take_control(); }},
      {"release", [](auto& frontend) { frontend.add_release_control(); }},
      {"note", [](auto& frontend) { frontend.add_mark("a note"); }},
      {"reset", [this](auto& frontend) { add_request(frontend, Reset{.seed = small(1)}); }},
      {"refuse", [](auto& frontend) { add_request<Refuse>(frontend); }},
      {"break", [](auto& frontend) { add_request<Break>(frontend); }},
      {"snapshot", [](auto& frontend) { add_request<Snapshot>(frontend); }},
      {"home", [](auto& frontend) { add_request<Home>(frontend); }},
      {"calibrate", [](auto& frontend) { add_request<Calibrate>(frontend); }},
  };

  bool acts(UntypedFrontend& frontend) {
    const std::string second = words_.size() > 1 ? words_[1] : "";
    if (second == "progress") {
      manual.backend.show_progress(frontend.request_index(words_[0]), rest());
    } else if (second == "ends") {
      manual.backend.end_request(frontend.request_index(words_[0]), how_it_ends());
    } else {
      return plays(acting_, frontend);
    }
    return true;
  }
  const Verbs acting_{
      {"run", [this](auto&) { manual.run(static_cast<int>(whole(1))); }},
      {"drive", [this](auto&) { EXPECT_EQ(manual.drive(), Step::standing); }},
      {"burst",
       [this](auto& frontend) {
         frontend.start_burst(whole(1));
         EXPECT_EQ(manual.drive(), Step::standing);
       }},
      {"cancel", [this](auto&) { bursts_.at(words_[1]).cancel(); }},
      {"cut", [this](auto&) { manual.backend.cut_burst(); }},
      {"missed", [this](auto&) { manual.backend.set_timing({.skipped = small(1)}); }},
      {"read", [this](auto&) { manual.now.at(small(1)) = number(2); }},
      {"offset", [this](auto&) { manual.offset.at(small(1)) = number(2); }},
      {"alive", [](auto& frontend) { frontend.keep_alive(); }},
      {"halt", [this](auto& frontend) { frontend.halt(rest(1)); }},
      {"interrupt", [this](auto&) { manual.backend.interrupt(small(1)); }},
      {"driver", [this](auto&) { manual.backend.halt(HaltCause::driver, rest()); }},
      {"end",
       [this](auto&) {
         const bool fails = words_.at(1) == "failed";
         manual.backend.end(fails ? BackendState::failed : BackendState::stopped, rest());
       }},
      {"stop", [this](auto&) { manual.backend.ask_to_stop(); }},
      {"last", [this](auto& frontend) { EXPECT_EQ(frontend.published(), whole(1)); }},
      {"running", [](auto& frontend) { EXPECT_FALSE(frontend.halted()); }},
      {"halted", [this](auto& frontend) { expect_halt(frontend.halted()); }},
      {"homed", [this](auto&) { EXPECT_EQ(manual.homed, whole(1)); }},
      {"fresh", [this](auto&) { EXPECT_EQ(manual.fresh_starts, whole(2)); }},
      {"ends", [this](auto&) { EXPECT_EQ(manual.iterate(), Step::ended); }},
      {"brakes", [this](auto&) { EXPECT_EQ(manual.backend.brake(), Step::run); }},
      {"fails",
       [this](auto&) { EXPECT_THAT(std::string(manual.backend.failure()), HasSubstr(rest(1))); }},
  };
  Served how_it_ends() const {
    if (find("afresh") > 0) return Served::start_afresh();
    if (find("rejected") > 0) return Served::rejected(rest(3));
    return find("failed") > 0 ? Served::failed(rest(3)) : Served::done();
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
    } else if (what == "row") {
      const RowHead head = frontend.wait_for(whole(1), kAtOnce).head();
      EXPECT_EQ(head.fresh != 0, find("fresh") > 0);
      EXPECT_EQ(head.halted != 0, find("halted") > 0);
    } else if (what == "runs") {
      std::string names;
      for (const auto& each : frontend.running_requests()) names += " " + each.name;
      EXPECT_EQ(what + names, rest(0));
    } else if (what == "journal") {
      std::string entries;
      for (JournalEntry entry; journal_->next(entry);) entries += " " + text_of(entry);
      EXPECT_EQ(what + entries, rest(0));
    } else if (const auto found = batches_.find(what.substr(0, what.find('.')));
               found != batches_.end()) {
      expect_of(found->second, verb);
    } else {
      return false;
    }
    return true;
  }
  /// What was decided, by whom and when: `taken@3`, `rejected:late@3`, `completed@5`.
  static std::string text_of(const JournalEntry& entry) {
    using enum JournalKind;
    std::string text(to_text(entry.kind));
    if (entry.kind == status) text = to_text(entry.status);
    if (entry.kind == rejected) text += ":" + std::string(to_text(entry.reason));
    const auto is_one_of = [&](auto... kinds) { return ((entry.kind == kinds) || ...); };
    if (is_one_of(taken, scheduled, rejected, resume, control_taken, control_released, silent,
                  burst, burst_ended) ||
        entry.cause == HaltCause::frontend) {
      EXPECT_THAT(entry.who, HasSubstr("pid " + std::to_string(getpid()))) << text;
    }
    return text + "@" + std::to_string(entry.iteration);
  }
  void expect_halt(const std::optional<Halt>& halt) {
    ASSERT_TRUE(halt);
    if (find("why") > 0) {
      EXPECT_EQ(halt->reason(), rest(find("why") + 1));
      words_.resize(find("why"));
    }
    expect_words(1, std::string(to_text(halt->cause)), halt->iteration);
  }
  void expect_of(const Batch& batch, const std::string& verb) {
    const std::size_t dot = words_[0].find('.');
    const std::size_t place = dot == std::string::npos ? 0 : std::stoul(words_[0].substr(dot + 1));
    const Handle handle = place < batch.size() ? batch.handle(place) : Handle{};
    const auto burst = bursts_.find(words_[0]);
    const auto wait = [&] {
      burst == bursts_.end() ? batch.wait(kAtOnce) : static_cast<void>(burst->second.wait(kAtOnce));
    };
    if (verb == "taken") {
      EXPECT_EQ(batch.first_iteration(), whole(2));
    } else if (verb == "ended") {
      EXPECT_EQ(batch.last_iteration(), whole(2));
    } else if (verb == "open") {
      EXPECT_FALSE(batch.ended());
    } else if (verb == "done") {
      EXPECT_EQ(burst->second.wait_done(kAtOnce), whole(2));
    } else if (verb == "undone") {
      EXPECT_FALSE(burst->second.done());
    } else if (verb == "says") {
      EXPECT_THAT(handle.text, HasSubstr(rest()));
    } else if (verb == "shows") {
      EXPECT_EQ(handle.progress, rest());
    } else if (verb == "waits" && words_.size() == 2) {
      wait();
    } else if (verb == "waits") {
      EXPECT_THAT(message_of<NotCompleted>(wait), HasSubstr(rest()));
    } else if (verb == "raises") {
      expect_error(words_.at(2), wait);
    } else {
      EXPECT_EQ(to_text(handle.status), verb);
      expect_words(2, std::string(to_text(handle.reason)), handle.iteration);
    }
  }
  template <class Call>
  void expect_error(const std::string& type, const Call& call) {
    const auto text = HasSubstr(rest(3));
    if (type == "BackendHalted") {
      EXPECT_THAT(message_of<BackendHalted>(call), text);
    } else if (type == "BackendStopped") {
      EXPECT_THAT(message_of<BackendStopped>(call), text);
      EXPECT_THROW(call(), BackendStopped);
    } else if (type == "BackendFailed") {
      EXPECT_THAT(message_of<BackendFailed>(call), text);
    } else {
      ASSERT_EQ(type, "TimeoutError");
      EXPECT_THROW(call(), TimeoutError);
    }
  }
  /// Words from `first` on: a name, and @ with an iteration.
  void expect_words(std::size_t first, const std::string& name, Iteration iteration) {
    for (std::size_t i = first; i < words_.size(); ++i) {
      EXPECT_EQ(words_[i], words_[i][0] == '@' ? "@" + std::to_string(iteration) : name);
    }
  }

  Statements words_;
  std::map<Iteration, Statements> in_row_;
  Statements while_refused_;
  std::map<std::string, std::optional<UntypedFrontend>> frontends_;
  std::map<std::string, Batch> batches_;
  std::map<std::string, Burst> bursts_;
  std::optional<UntypedFrontend> observer_;
  std::optional<Journal> journal_;
};

inline void play(const BackendOptions& options, const std::string& script,
                 const std::function<void(Schema&)>& describe = {}) {
  Trace(options, describe).play(script);
}
inline void play(const std::string& script) { play({.segment = "pair"}, script); }
inline void play_bursts(const std::string& script) {
  play({.segment = "pair", .bursting = true}, script);
}

}  // namespace o80::test
