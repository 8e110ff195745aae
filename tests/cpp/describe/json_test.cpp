#include <gmock/gmock.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "describe/described.hpp"
#include "describe/table.hpp"

namespace o80 {
namespace {

using described::MixedRobot;
using described::schema_of;
using ::testing::HasSubstr;

/// Hands a text to a foreign reader of JSON, with a question about it as a Python expression.
bool holds(const std::string& json, const std::string& question) {
  char folder[] = "/tmp/o80-json-XXXXXX";
  EXPECT_NE(mkdtemp(folder), nullptr);
  const std::string file = std::string(folder) + "/schema.json";
  std::ofstream(file) << json;
  const std::string command = "python3 -c \"import json, math; s = json.load(open('" + file +
                              "')); assert " + question + "\"";
  const int code = std::system(command.c_str());  // NOLINT(bugprone-command-processor)
  std::filesystem::remove_all(folder);
  return code == 0;
}

TEST(Json, IsReadByOthers) {
  Schema schema = schema_of<MixedRobot>();
  schema.actuator(0).limits({.minimum = -1.0 / 3, .maximum = 2});
  const std::string json = to_json(schema);
  EXPECT_TRUE(holds(json, "s['robot'] == 'mixed' and s['period'] == 1000000"));
  EXPECT_TRUE(holds(json, "len(s['actuators']) == 9"));
  EXPECT_TRUE(holds(json, "s['actuators'][0]['limits'][0]['minimum'] == -1.0 / 3"));
  EXPECT_TRUE(holds(json, "s['actuators'][0]['limits'][0]['speed'] is None"));
  EXPECT_TRUE(holds(json, "[f['shape'] for f in s['extended']['fields']][1] == [4, 2]"));
  EXPECT_TRUE(holds(json, "s['requests'][1]['type']['fields'][1]['labels']['torque'] == 4"));
  EXPECT_TRUE(holds(json, "s['row']['desired'] == 40"));
  EXPECT_FALSE(holds(json, "s['robot'] == 'other'")) << "the question is really asked";
}

TEST(Json, EscapesWhatItMust) {
  Schema schema = schema_of<MixedRobot>();
  schema.head.robot = NameText(R"(a "quoted" \ name)");
  EXPECT_TRUE(holds(to_json(schema), R"(len(s['robot']) == 17 and chr(92) in s['robot'])"));
}

TEST(Json, OfARobotWithNothingIsStillWhole) {
  EXPECT_TRUE(holds(to_json(Schema()), "s['actuators'] == [] and s['groups'] == []"));
}

}  // namespace
}  // namespace o80
