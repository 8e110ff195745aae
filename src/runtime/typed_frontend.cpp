#include "o80/runtime/typed_frontend.hpp"

namespace o80 {

void check_types(const Schema& expected, const Schema& found, const std::string& segment) {
  // what is the backend's own affair is taken over before the rest is compared
  Schema aligned = expected;
  aligned.head = found.head;
  aligned.head.extended = expected.head.extended;
  aligned.head.block = round_up(expected.head.block, 8);
  for (std::size_t i = 0; i < aligned.actuators.size() && i < found.actuators.size(); ++i) {
    ActuatorRow& actuator = aligned.actuators[i];
    actuator.name = found.actuators[i].name;
    actuator.when_idle = found.actuators[i].when_idle;
  }
  if (aligned.limits.size() == found.limits.size()) aligned.limits = found.limits;
  for (std::size_t i = 0; i < aligned.requests.size() && i < found.requests.size(); ++i) {
    aligned.requests[i].help = found.requests[i].help;
  }
  const std::string different = difference(aligned, found);
  if (different.empty()) return;
  throw SchemaMismatch("segment '" + segment + "' is not laid out as this program expects:\n" +
                       different + "Build the program and the robot from the same types.");
}

}  // namespace o80
