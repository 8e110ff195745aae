#include "robot/loop/robot_provenance.hpp"

#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <random>

#include "robot/fake_driver.hpp"
#include "robot/loop/loop.hpp"
#include "runtime/backend/backend_options.hpp"

namespace o80::test {
namespace {

using ::testing::SizeIs;

/// A robot that draws something at random, and one of whose options names a file.
struct Dice {
  enum class Colour : std::uint8_t { red, blue };
  struct Config {
    Seed seed;
    Seed second;
    std::string model;
    std::array<double, 2> offsets{0.5, 0.1};
    Colour colour = Colour::blue;
    bool loaded = true;
    float bias = 0.1F;
  };
  using Actuators = std::array<double, 1>;
  explicit Dice(const Config& config) : seeds{config.seed.value, config.second.value} {}
  void start() {}
  void write(const Desired<Dice>&) {}
  void read(Reading<Dice>& reading) { reading.observed[0] = static_cast<double>(seeds[0] % 1000); }
  void stop() noexcept {}
  std::array<std::uint64_t, 2> seeds;
};
O80_DESCRIBE_ENUM(Dice::Colour, red, blue);
O80_DESCRIBE(Dice::Config, (seed, "of the dice"), second, model, offsets, colour, loaded, bias);

const RobotTable& dice() { return *robot_table<Dice>("dice"); }

std::map<std::string, std::string> map_of(const OptionValues& options) {
  return {options.begin(), options.end()};
}

TEST(EffectiveOptionsTest, AreTheGivenTextsAndTheDefaults) {
  const auto effective =
      map_of(effective_options(dice(), {{"model", "a.xml"}, {"seed", "7"}, {"colour", "red"}}));
  EXPECT_THAT(effective, SizeIs(7));
  EXPECT_EQ(effective.at("model"), "a.xml");
  EXPECT_EQ(effective.at("seed"), "7");
  EXPECT_EQ(effective.at("offsets"), "0.5,0.1");
  EXPECT_EQ(effective.at("colour"), "red");
  EXPECT_EQ(effective.at("loaded"), "true");
  EXPECT_EQ(effective.at("bias"), "0.1");
}

TEST(EffectiveOptionsTest, HaveADrawnSeedWhereNoneIsGiven) {
  const auto first = map_of(effective_options(dice(), {}));
  const auto second = map_of(effective_options(dice(), {}));
  EXPECT_NE(first.at("seed"), second.at("seed"));
  EXPECT_NE(first.at("seed"), first.at("second"));
  EXPECT_LT(std::stoull(first.at("seed")), 1ULL << 53);
}

TEST(EffectiveOptionsTest, StartTheSameRobotAgain) {
  const OptionValues effective = effective_options(dice(), {});
  EXPECT_EQ(effective_options(dice(), effective), effective);
  const DriverInstance instance(dice(), effective);
  EXPECT_EQ(instance.options(), effective);
}

TEST(SeedTest, IsAnOptionThatIsANumber) {
  const std::vector<Option> options = options_of(dice());
  EXPECT_EQ(options[0].kind, "seed");
  EXPECT_EQ(options[0].default_text, "drawn at each start");
  EXPECT_THAT(message_of<InvalidArgument>([] { check_options(dice(), {{"seed", "-1"}}); }),
              HasSubstr("option 'seed' must be a whole number, at least 0, got '-1'"));
}

class RobotProvenanceTest : public FakeDriverTest {};

TEST_F(RobotProvenanceTest, OfARobotSaysHowToStartItAgain) {
  Loop loop(std::make_unique<DriverInstance>(dice(), OptionValues{{"model", "a.xml"}}),
            {.segment = "dice", .bursting = true});
  loop.start();
  const UntypedFrontend frontend("dice");
  const Provenance found = frontend.provenance();
  EXPECT_EQ(found.robot, "dice");
  EXPECT_THAT(found.built_with, HasSubstr("o80 "));
  EXPECT_EQ(found.library, std::filesystem::canonical("/proc/self/exe").string());
  EXPECT_THAT(found.library_sha256, SizeIs(64));

  // the recorded seed is the one that the driver has drawn from
  double seen = 0;
  std::memcpy(&seen, frontend.latest().observed(), sizeof seen);
  EXPECT_EQ(seen, static_cast<double>(std::stoull(map_of(found.options).at("seed")) % 1000));
}

TEST_F(RobotProvenanceTest, NamesTheFilesOfOptionsWithTheirHashes) {
  const auto folder = std::filesystem::path(::testing::TempDir());
  const auto model = folder / "provenance_model.xml";
  std::ofstream(model) << "abc";
  const Provenance found = provenance_of(dice(), {{"model", model.string()}, {"bias", "1"}});
  std::filesystem::remove(model);
  ASSERT_THAT(found.files, SizeIs(1));
  EXPECT_EQ(found.files[0].option, "model");
  EXPECT_EQ(found.files[0].path, model.string());
  EXPECT_EQ(found.files[0].sha256,
            "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  // not a file, and a folder
  EXPECT_THAT(provenance_of(dice(), {{"model", model.string()}}).files, SizeIs(0));
  EXPECT_THAT(provenance_of(dice(), {{"model", folder.string()}}).files, SizeIs(0));
}

/// Options of a backend and its loop that are drawn from a seed; each may occur.
LoopOptions drawn_options(std::uint32_t seed) {
  std::mt19937_64 random(seed);
  const auto chance = [&] { return random() % 2 == 0; };
  LoopOptions options;
  options.backend.period = static_cast<std::int64_t>(1000 + random() % 1'000'000'000'000ULL);
  options.backend.bursting = chance();
  options.backend.history = 1 + random() % 1'000'000'000;
  options.backend.lanes = static_cast<std::uint32_t>(1 + random() % 256);
  options.backend.lane_blocks = 16U << random() % 18;
  options.backend.journal = chance() ? 0 : std::int64_t{1} << (19 + random() % 17);
  options.backend.permission = 0400 + random() % 0400;
  options.backend.stale = static_cast<Stale>(random() % 4);
  options.backend.silence = chance() ? 0 : static_cast<std::int64_t>(1 + random() % 1'000'000'000);
  options.backend.max_overruns = chance() ? 0 : static_cast<std::uint32_t>(1 + random() % 100'000);
  options.backend.resume = chance();
  options.backend.gap =
      chance() ? -1 : static_cast<std::int64_t>(1'000'000 + random() % 1'000'000'000);
  options.backend.accept_reading = chance();
  options.real_time.policy = static_cast<RealTimeOptions::Policy>(random() % 3);
  if (options.real_time.policy != RealTimeOptions::Policy::other)
    options.real_time.priority = static_cast<int>(1 + random() % 99);
  for (std::size_t i = random() % 4; i > 0; --i)
    options.real_time.processors.push_back(static_cast<int>(random() % 1024));
  options.real_time.lock_memory = chance();
  return options;
}

Provenance::Options texts_of_all(const LoopOptions& options) {
  Provenance::Options texts = texts_of(options.backend);
  for (auto& text : texts_of(options.real_time)) texts.push_back(std::move(text));
  return texts;
}

TEST(RunOptionTextsTest, GiveTheSameOptionsWhenTheyAreReadAgain) {
  for (std::uint32_t seed = 0; seed < 500; ++seed) {
    SCOPED_TRACE(seed);
    const LoopOptions drawn = drawn_options(seed);
    LoopOptions again;
    const Provenance::Options texts = texts_of_all(drawn);
    for (const auto& [name, text] : texts) {
      const LoopOption* option = find_loop_option(name);
      ASSERT_NE(option, nullptr) << name;
      set_loop_option(again, *option, text, name);
    }
    ASSERT_EQ(texts_of_all(again), texts);
  }
}

TEST(RunOptionTextsTest, NameEveryOptionOfABackend) {
  LoopOptions all = drawn_options(0);
  all.backend.silence = 1;
  all.backend.max_overruns = 1;
  all.backend.gap = 0;
  all.real_time.policy = RealTimeOptions::Policy::fifo;
  all.real_time.processors = {0};
  const auto named = map_of(texts_of_all(all));
  for (const LoopOption& option : loop_options()) {
    const bool is_flag_only = (option.scope & LoopOption::kFlag) != 0;
    EXPECT_NE(named.contains(option.name), is_flag_only) << option.name;
  }
}

}  // namespace
}  // namespace o80::test
