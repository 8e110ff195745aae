#include "balls/ball_requests.hpp"

#include <cstdio>

namespace o80::mujoco {
namespace {

Served no_balls() noexcept {
  return Served::rejected("this simulation has no balls: name some with balls=... at its start");
}

template <class... Values>
Served rejected(const char* format, Values... values) noexcept {
  char text[160];
  std::snprintf(text, sizeof text, format, values...);
  return Served::rejected(text);
}

}  // namespace

Served clear_contacts(Balls* balls, const ClearContacts& request) noexcept {
  if (balls == nullptr) return no_balls();
  if (request.ball > balls->size()) {
    return rejected("ball must be from 1 to %zu, or 0 for all balls, got %u", balls->size(),
                    request.ball);
  }
  for (std::size_t i = 0; i < balls->size(); ++i) {
    if (request.ball == 0 || request.ball == i + 1) balls->clear(i);
  }
  return Served::done();
}

Served fly_out(Balls* balls, const FlyOut& request) noexcept {
  if (balls == nullptr) return no_balls();
  if (request.ball < 1 || request.ball > balls->size()) {
    return rejected("ball must be from 1 to %zu, got %u", balls->size(), request.ball);
  }
  if (request.every < 1 || request.most < 1 || request.most > kMaxFlownOut) {
    return rejected("every must be at least 1, got %u, and most from 1 to %u, got %u",
                    request.every, kMaxFlownOut, request.most);
  }
  if (balls->imposed(request.ball - 1)) {
    return rejected("a command moved ball %u in the last iteration: wait for its end, or purge it",
                    request.ball);
  }
  balls->fly_out(request);
  return Served::done();
}

}  // namespace o80::mujoco
