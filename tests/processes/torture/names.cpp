#include "torture/board.hpp"

namespace torture {

const char* name_of(Role role) {
  static constexpr const char* kNames[] = {
      "backend", "bursting backend", "commander", "burster",          "group burster", "halter",
      "reader",  "auditor",          "usurper",   "Python commander", "Python reader"};
  return kNames[static_cast<std::size_t>(role)];
}

const char* name_of(Fault fault) {
  static constexpr const char* kNames[] = {"none",
                                           "hangs",
                                           "torn or wrong rows",
                                           "commands lost",
                                           "commands done twice or out of order",
                                           "commands told falsely",
                                           "deaths of the living",
                                           "deaths unnoticed",
                                           "taken while alive",
                                           "wrong errors",
                                           "crashes",
                                           "halts broken",
                                           "left over"};
  return kNames[static_cast<std::size_t>(fault)];
}

}  // namespace torture
