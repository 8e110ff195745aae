#include "arms/calibration.hpp"

#include <gmock/gmock.h>
#include <stdlib.h>

#include <filesystem>
#include <fstream>
#include <stdexcept>

namespace o80::arms {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr const char* kPan = R"({
    "shoulder_pan": {
        "id": 1,
        "drive_mode": 0,
        "homing_offset": -12,
        "range_min": 750,
        "range_max": 3401
    }})";

class CalibrationFile : public testing::Test {
 protected:
  CalibrationFile() {
    std::string name = testing::TempDir() + "calibration_XXXXXX";
    folder = mkdtemp(name.data());
    setenv("HF_LEROBOT_CALIBRATION", folder.c_str(), 1);
    fs::create_directories(folder / "robots" / "new");
    fs::create_directories(folder / "robots" / "old");
  }
  ~CalibrationFile() override {
    unsetenv("HF_LEROBOT_CALIBRATION");
    fs::remove_all(folder);
  }
  std::string file(const std::string& text, const std::string& name = "old/black.json") const {
    const fs::path path = folder / "robots" / name;
    std::ofstream(path) << text;
    return path;
  }
  static std::string replaced(const std::string& old, const std::string& now) {
    std::string text = kPan;
    return text.replace(text.find(old), old.size(), now);
  }

  fs::path folder;
};

TEST_F(CalibrationFile, GivesTheAnglesOfLeRobot) {
  const auto found = read_calibration(file(kPan), {"shoulder_pan"});
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0], (Calibration{.offset = -12, .smallest = 750, .largest = 3401}));
  for (int raw = 750; raw <= 3401; ++raw) {
    const double degrees = (raw - (750 + 3401) / 2.0) * 360 / 4095;  // as LeRobot has it
    EXPECT_NEAR(found[0].angle(raw) * 180 / std::numbers::pi, degrees, 1e-13);
    EXPECT_NEAR(found[0].steps(found[0].angle(raw)), raw, 1e-9);
  }
  EXPECT_EQ(found[0].share(750), 0.0);
  EXPECT_EQ(found[0].share(3401), 1.0);
}

TEST_F(CalibrationFile, IsRefusedWithWhatIsWrong) {
  const auto refused = [&](const std::string& text, const std::string& why) {
    const std::string path = file(text);
    EXPECT_THAT([&] { read_calibration(path, {"shoulder_pan"}); },
                ThrowsMessage<std::runtime_error>(AllOf(HasSubstr(path), HasSubstr(why))));
  };
  refused(replaced("\"drive_mode\": 0", "\"drive_mode\": 1"), "drive_mode must be 0");
  refused(replaced("\"id\": 1", "\"id\": 3"), "its id must be 1, not 3");
  refused(replaced("shoulder_pan", "shoulder"), "shoulder_pan: it is missing");
  refused(replaced("range_max", "most"), "'range_max' is missing");
  refused(replaced("3401", "749"), "got 750..749");
  refused(replaced("3401", "4096"), "got 750..4096");
  refused(replaced("3401", "\"far\""), "expected a whole number");
  refused("", "expected '{'");
  refused(std::string(kPan) + "}", "expected the end");
}

TEST_F(CalibrationFile, IsFoundByNameOrAloneOrByPath) {
  EXPECT_EQ(find_calibration("", {"robots/new", "robots/old"}), "");
  const std::string black = file(kPan);
  EXPECT_EQ(find_calibration("", {"robots/new", "robots/old"}), black);
  const std::string white = file(kPan, "new/white.json");
  EXPECT_EQ(find_calibration("", {"robots/new", "robots/old"}), "") << "nobody knows which";
  EXPECT_EQ(find_calibration("black", {"robots/new", "robots/old"}), black);
  EXPECT_EQ(find_calibration("white", {"robots/new", "robots/old"}), white);
  EXPECT_EQ(find_calibration("./mine.json", {"robots/new"}), "./mine.json");
  EXPECT_THAT([] { find_calibration("blue", {"robots/new", "robots/old"}); },
              ThrowsMessage<std::runtime_error>(
                  AllOf(HasSubstr("no calibration 'blue'"), HasSubstr("--take blue`"))));
  EXPECT_THAT([] { find_calibration("blue", {"teleoperators/new"}); },
              ThrowsMessage<std::runtime_error>(HasSubstr("--take blue --leader`")));
}

}  // namespace
}  // namespace o80::arms
