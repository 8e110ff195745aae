#pragma once

#include <string>

namespace o80 {

/// What an error says, or "" if none is thrown.
template <class Wanted, class Call>
std::string message_of(Call&& call) {
  try {
    call();
  } catch (const Wanted& error) {
    return error.what();
  }
  return {};
}

}  // namespace o80
