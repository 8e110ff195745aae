#pragma once

#include <memory>
#include <string>

#include "o80/robot/inline_robot.hpp"
#include "o80/runtime/frontend.hpp"

/// A frontend before Python has made a class of it: attached, or that of an inline robot.
struct Attachment {
  std::shared_ptr<o80::UntypedFrontend> frontend;
  std::shared_ptr<o80::InlineRobot> robot;
};
