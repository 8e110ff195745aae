// The texts a robot is started with.

#include <cstdlib>
#include <string>

#include "describe/table.hpp"
#include "fuzz/bytes.hpp"
#include "fuzz/robot.hpp"
#include "o80/base/error.hpp"
#include "o80/describe/options.hpp"

namespace o80::fuzz {

struct Config {
  std::string address = "192.168.0.1";
  double gain = 1.5;
  int count = -3;
  std::uint8_t small = 200;
  bool fast = true;
  Gear gear = Gear::low;
  std::array<float, 3> offsets{};
  Face like;
};
O80_DESCRIBE(Config, address, (gain, "of the loop [Nm/rad]"), count, small, fast, gear, offsets,
             like);

void run(Bytes bytes) {
  static const std::vector<Option> options = options_of<Config>();
  const auto known = bytes.number<std::uint8_t>();
  const std::string name =
      known < 128 ? options[known % options.size()].name : std::string(1, static_cast<char>(known));
  const auto rest = bytes.rest();
  const std::string text(reinterpret_cast<const char*>(rest.data()), rest.size());
  try {  // a table with the right hash, whatever it holds
    if (name == "like") check_face(describing::schema_in(rest));
  } catch (const Error&) {  // refused
  }
  Config config;
  try {
    set_option(config, name, text);
  } catch (const InvalidArgument&) {
    return;
  }
  // what was read prints as something that reads back the same
  const auto again = [&](auto member) {
    auto copy = config.*member;
    const std::string printed = describing::option_text(config.*member);
    if (!describing::parse_option(printed, copy)) std::abort();
    if (describing::option_text(copy) != printed) std::abort();
  };
  again(&Config::gain);
  again(&Config::count);
  again(&Config::small);
  again(&Config::gear);
  again(&Config::offsets);
  FieldRow field;
  try {
    set_text(field, text);
  } catch (const InvalidArgument&) {
    return;
  }
}

}  // namespace o80::fuzz
