#include "runtime/backend/backend_options.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <limits>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "control/motion/number_plan.hpp"
#include "describe/table.hpp"
#include "o80/base/version.hpp"
#include "runtime/backend/work_share.hpp"
#include "runtime/journal/provenance_bytes.hpp"

namespace o80 {

namespace {

constexpr std::uint64_t kDefaultHistoryBytes = 16U << 20;
constexpr std::uint64_t kDefaultHistoryRows = 100'000;
constexpr std::int64_t kDefaultPeriod = 1'000'000;  // [ns]
constexpr std::int64_t kPeriodRounding = 100'000;
/// Least journal of a backend [bytes]: a quarter holds the blocks that one iteration copies.
constexpr std::uint64_t kMinBackendJournal = 8 * kWorkPerIteration * kBlockBytes;

std::string rate_text(std::int64_t period) {
  std::ostringstream text;
  text << 1e9 / static_cast<double>(period) << " Hz (" << static_cast<double>(period) / 1e6
       << " ms)";
  return text.str();
}

/// The shortest text that reads back as the same number.
std::string shortest(double number) {
  std::array<char, 32> text{};
  return {text.data(), std::to_chars(text.data(), text.data() + text.size(), number).ptr};
}

/// The requested period, the robot's own, or 1 ms.
std::int64_t period_of(const Schema& schema, const BackendOptions& options) {
  const std::int64_t own = schema.head.period;
  if (options.period < 0) {
    throw InvalidArgument("the period must be positive, got " +
                          shortest(static_cast<double>(options.period) * 1e-9) + " s");
  }
  // printed frequencies are rounded: 166.667 Hz means 6 ms
  const bool same = std::abs(options.period - own) * kPeriodRounding <= own;
  if (options.period > 0 && own > 0 && !same) {
    throw InvalidArgument("robot '" + std::string(schema.head.robot.view()) + "' runs at " +
                          rate_text(own) + ", not at " + rate_text(options.period) +
                          ": leave the frequency out, or ask for its own");
  }
  if (own > 0) return own;
  return options.period > 0 ? options.period : kDefaultPeriod;
}

std::uint64_t rows_of(const BackendOptions& options, std::uint32_t row_bytes) {
  if (options.history > 0) return options.history;
  return std::clamp<std::uint64_t>(kDefaultHistoryBytes / row_bytes, 16, kDefaultHistoryRows);
}

/// Size of the journal: twice the largest batch, unless the options say otherwise.
std::uint64_t journal_bytes_of(const BackendOptions& options) {
  if (options.journal == 0) return 0;
  if (options.journal < 0) {
    const std::uint64_t lane = std::uint64_t{std::bit_ceil(options.lane_blocks)} * kBlockBytes;
    return std::max(2 * lane, kMinBackendJournal);
  }
  return std::bit_ceil(std::max(static_cast<std::uint64_t>(options.journal), kMinBackendJournal));
}

/// The options with the values that take the place of the defaults.
BackendOptions effective(const Schema& schema, const BackendOptions& options) {
  BackendOptions effective = options;
  effective.period = schema.head.period;
  effective.history = rows_of(options, row_layout(schema).size);
  effective.lane_blocks = std::bit_ceil(options.lane_blocks);
  effective.journal = static_cast<std::int64_t>(journal_bytes_of(options));
  return effective;
}

/// Wall-clock time of the moment at which the clock of the rows is 0 [ns].
std::int64_t wall_clock_offset(const Schema& schema) {
  if (schema.head.clock == Clock::simulated) return wall_clock_now();
  // of several readings the one with the shortest time in between
  std::int64_t offset = 0;
  std::int64_t shortest = std::numeric_limits<std::int64_t>::max();
  for (int i = 0; i < 5; ++i) {
    const std::int64_t before = monotonic_now();
    const std::int64_t wall = wall_clock_now();
    const std::int64_t took = monotonic_now() - before;
    if (took >= shortest) continue;
    shortest = took;
    offset = wall - before - took / 2;
  }
  return offset;
}

std::string octal(mode_t mode) {
  std::array<char, 16> text{};
  return {text.data(), std::to_chars(text.data(), text.data() + text.size(), mode, 8).ptr};
}

const char* text_of(bool flag) { return flag ? "true" : "false"; }

}  // namespace

Schema prepared(Schema schema, const BackendOptions& options) {
  if (options.silence > 0 && options.stale == Stale::hold) {
    throw InvalidArgument(
        "the watchdog (silence) needs a policy: set stale to purge, halt or stop, not to hold");
  }
  if (options.silence < 0) {
    throw InvalidArgument("silence must be 0 (no watchdog) or a number of iterations, got " +
                          std::to_string(options.silence));
  }
  if (options.permission < 0400 || options.permission > 0777) {
    std::ostringstream why;
    why << "permission must be an octal mode such as 0600, 0640 or 0660, got " << options.permission
        << " (octal " << std::oct << options.permission << ")";
    throw InvalidArgument(why.str());
  }
  schema.head.period = period_of(schema, options);
  schema.head.bursting = options.bursting ? 1 : 0;
  schema.head.clock = options.bursting ? Clock::simulated : Clock::monotonic;
  schema.head.stale = options.stale_policy();
  schema.head.silence = options.silence;
  schema.head.block = round_up(schema.head.block, 8);
  check(schema);
  return schema;
}

Provenance provenance_of(const Schema& schema, const BackendOptions& options) {
  Provenance provenance = options.provenance;
  if (provenance.robot.empty()) provenance.robot = schema.head.robot.str();
  for (auto& option : texts_of(effective(schema, options)))
    provenance.run_options.push_back(std::move(option));
  provenance.version = version();
  provenance.source_hash = source_hash();
  provenance.motion_rules = kMotionRules;
  provenance.wall_clock_offset = wall_clock_offset(schema);
  return provenance;
}

OwnedSegment segment_of(const Schema& schema, const Provenance& provenance,
                        const BackendOptions& given) {
  const BackendOptions options = effective(schema, given);
  const std::vector<std::byte> bytes = to_bytes(schema);
  const std::vector<std::byte> provenance_bytes = to_bytes(provenance);
  SegmentSpec spec;
  spec.name = options.segment;
  spec.schema = bytes;
  spec.provenance = provenance_bytes;
  spec.row_bytes = row_layout(schema).size;
  spec.rows = options.history;
  spec.lanes = options.lanes;
  spec.lane_blocks = options.lane_blocks;
  spec.journal_bytes = static_cast<std::uint64_t>(options.journal);
  spec.permission = options.permission;
  spec.inherits_halt = !options.bursting && !options.resume;
  spec.anonymous = options.anonymous;
  return OwnedSegment::create(spec);
}

std::int64_t longest_gap(const Schema& schema, const BackendOptions& options) {
  constexpr std::int64_t kPeriods = 20;
  constexpr std::int64_t kMin = 100'000'000;
  if (options.bursting) return 0;
  if (options.gap >= 0) return options.gap;
  const bool guards = options.has_loop && !schema.head.is_simulated() && !schema.actuators.empty();
  const std::int64_t least = guards ? std::max(kPeriods * schema.head.period, kMin) : 0;
  const std::int64_t own = schema.head.gap * std::int64_t{1000};
  return own > 0 && (least == 0 || own < least) ? own : least;
}

Provenance::Options texts_of(const BackendOptions& options) {
  constexpr double kMebi = 1 << 20;
  Provenance::Options texts{
      {"frequency", shortest(1e9 / static_cast<double>(options.period))},
      {"bursting", text_of(options.bursting)},
      {"history", std::to_string(options.history)},
      {"lanes", std::to_string(options.lanes)},
      {"lane_blocks", std::to_string(options.lane_blocks)},
      {"journal", shortest(static_cast<double>(options.journal) / kMebi)},
      {"permission", octal(options.permission)},
      {"stale", std::string(name_of(options.stale_policy()))},
      {"resume", text_of(options.resume)},
      {"accept_reading", text_of(options.accept_reading)},
  };
  if (options.silence > 0) texts.emplace_back("silence", std::to_string(options.silence));
  if (options.gap >= 0) texts.emplace_back("gap", shortest(static_cast<double>(options.gap) / 1e9));
  if (options.max_overruns > 0)
    texts.emplace_back("max_overruns", std::to_string(options.max_overruns));
  return texts;
}

}  // namespace o80
