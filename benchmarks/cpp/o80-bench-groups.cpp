// Iterations a second of an inline group on two threads, beside the same drivers stepped by plain
// calls on two threads. Arguments: rounds, a word for the samples, a robot library, its options.
// `pam` sends one target a burst, `twin` one for each iteration, as the table-tennis environment.
//
// With `count SIDE BURSTS` instead of the rounds: makes so many bursts of four copies in one
// thread, for a tool that counts instructions. SIDE is group or plain.

#include <array>

#include "o80/describe/layout.hpp"
#include "robot/driver/library.hpp"
#include "robot/group/inline_group.hpp"
#include "sample.hpp"

namespace o80::bench {
namespace {

constexpr std::size_t kThreads = 2;
constexpr std::int64_t kIterations = 5;  // of a step of the table-tennis environment
constexpr std::array<std::size_t, 2> kCopies = {64, 16};
constexpr double kLongEnough = 0.05e9;  // of a sample [ns]
constexpr auto kPatience = std::chrono::seconds(60);

/// A driver behind its table of functions, with the memory of a row.
class PlainDriver {
 public:
  PlainDriver(const RobotTable& table, const OptionValues& options)
      : driver_(table, options),
        schema_(driver_.describe()),
        layout_(row_layout(schema_)),
        row_(layout_.size / 8 + 1),
        interrupted_(layout_.mask_words + 1),
        reports_(schema_.requests.size()) {
    if (!driver_.start()) throw DriverError(driver_.fault());
    read();
    std::copy_n(bytes() + layout_.observed, layout_.block, bytes() + layout_.desired);
  }
  void run() {
    for (std::int64_t i = 0; i < kIterations; ++i) {
      ++iteration_;
      const DesiredView view{bytes() + layout_.desired,
                             reinterpret_cast<const std::uint64_t*>(bytes() + layout_.active),
                             iteration_, iteration_ * schema_.head.period, schema_.head.period};
      if (!driver_.write(view)) throw DriverError(driver_.fault());
      read();
    }
  }

 private:
  std::byte* bytes() { return reinterpret_cast<std::byte*>(row_.data()); }
  void read() {
    ReadingView view{};
    view.observed = bytes() + layout_.observed;
    view.extended = bytes() + layout_.extended;
    view.interrupted = interrupted_.data();
    view.requests = reports_.data();
    view.iteration = iteration_;
    if (!driver_.read(view)) throw DriverError(driver_.fault());
  }

  DriverInstance driver_;
  Schema schema_;
  RowLayout layout_;
  std::vector<std::uint64_t> row_;
  std::vector<std::uint64_t> interrupted_;
  std::vector<RequestReport> reports_;
  Iteration iteration_ = 0;
};

/// Plain calls in as many threads.
class Plain {
 public:
  Plain(const RobotTable& table, const OptionValues& options, std::size_t copies,
        std::size_t threads = kThreads)
      : pool_(threads - 1) {
    for (std::size_t i = 0; i < copies; ++i) {
      drivers_.push_back(std::make_unique<PlainDriver>(table, options));
    }
  }
  void step() {
    const auto task = [&](std::uint32_t i) { drivers_[i]->run(); };
    pool_.run(static_cast<std::uint32_t>(drivers_.size()), task, [] {});
  }

 private:
  std::vector<std::unique_ptr<PlainDriver>> drivers_;
  WorkerPool pool_;
};

/// A group that holds its first actuators, of one type, where they are.
class Group {
 public:
  Group(const std::string& word, const RobotTable& table, const OptionValues& options,
        std::size_t copies, std::size_t threads = kThreads)
      : group_(table, options,
               {.copies = copies, .threads = threads, .backend = InlineGroup::default_options()}),
        rows_(copies * kIterations * group_.description().layout.size) {
    const Schema& schema = group_.description().schema;
    const std::uint32_t type = schema.actuators[0].type;
    for (std::uint32_t i = 0; i < schema.actuators.size() && schema.actuators[i].type == type; ++i)
      plan_.actuators.push_back(i);
    const UntypedObservation row = group_.attach(0)->latest();
    const std::size_t size = schema.types[type].size;
    plan_.command.pace = iterations(1);
    if (word == "pam") {
      plan_.command.mode = Mode::overwrite;
      plan_.delay = 1;
    } else {
      plan_.steps = kIterations;
    }
    for (std::uint32_t i = 0; i < copies; ++i) {
      all_.push_back(i);
      for (std::size_t at = 0; at < size * plan_.actuators.size(); at += size) {
        for (std::uint32_t step = 0; step < plan_.steps; ++step) {
          targets_.insert(targets_.end(), row.desired() + at, row.desired() + at + size);
        }
      }
    }
    plan_.iterations = kIterations;
    plan_.targets = targets_;
    plan_.rows = rows_;
    group_.check(plan_);
  }
  void step() { group_.burst(plan_, all_, kPatience); }

 private:
  InlineGroup group_;
  std::vector<std::byte> targets_, rows_;
  std::vector<std::uint32_t> all_;
  InlineGroup::BurstPlan plan_;
};

/// Iterations a second of all copies together.
template <class Side>
double rate(Side& side, std::size_t copies, int calls) {
  const double time = nanoseconds([&] {
    for (int i = 0; i < calls; ++i) side.step();
  });
  return 1e9 * static_cast<double>(copies) * kIterations * calls / time;
}

void measure(int rounds, const std::string& word, const RobotTable& table,
             const OptionValues& options) {
  for (const std::size_t copies : kCopies) {
    Plain plain(table, options, copies);
    Group group(word, table, options, copies);
    const double step = nanoseconds([&] { plain.step(); });
    const int calls = std::max(1, static_cast<int>(kLongEnough / step));
    rate(group, copies, calls);
    const std::string name = "group_" + word + "_" + std::to_string(copies);
    for (int round = 0; round < rounds; ++round) {
      sample((name + "_plain").c_str(), "iterations/s", rate(plain, copies, calls));
      sample(name.c_str(), "iterations/s", rate(group, copies, calls));
    }
  }
}

/// Bursts of one side alone.
int count(const std::string& side, int bursts, const std::string& word, const RobotTable& table,
          const OptionValues& options) {
  constexpr std::size_t kCopiesCounted = 4;
  const auto step = [&](auto&& counted) {
    for (int i = 0; i < bursts; ++i) counted.step();
  };
  if (side == "plain") {
    step(Plain(table, options, kCopiesCounted, 1));
  } else {
    step(Group(word, table, options, kCopiesCounted, 1));
  }
  return 0;
}

}  // namespace
}  // namespace o80::bench

int main(int argc, char** argv) {
  const bool counts = argc > 1 && std::string(argv[1]) == "count";
  const int first = counts ? 4 : 2;  // argument
  if (argc < first + 2) {
    std::fprintf(stderr, "usage: %s ROUNDS | count SIDE BURSTS  WORD LIBRARY [OPTION=VALUE...]\n",
                 argv[0]);
    return 2;
  }
  o80::OptionValues options;
  for (int i = first + 2; i < argc; ++i) {
    const std::string text = argv[i];
    const std::size_t sign = text.find('=');
    options.emplace_back(text.substr(0, sign), text.substr(sign + 1));
  }
  const o80::RobotLibrary library = o80::RobotLibrary::load(argv[first + 1]);
  const std::string word = argv[first];
  if (counts) return o80::bench::count(argv[2], std::atoi(argv[3]), word, *library.table, options);
  o80::bench::take_priority();
  o80::bench::measure(o80::bench::rounds_of(argc, argv), word, *library.table, options);
}
