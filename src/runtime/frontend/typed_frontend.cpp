#include "o80/runtime/typed_frontend.hpp"

#include "describe/table.hpp"

namespace o80 {

void check_types(const Schema& expected, const Schema& found, const std::string& segment) {
  const std::string different = layout_difference(expected, found);
  if (different.empty()) return;
  throw SchemaMismatch("segment '" + segment + "' is not laid out as this program expects:\n" +
                       different + "Build the program and the robot from the same types.");
}

}  // namespace o80
