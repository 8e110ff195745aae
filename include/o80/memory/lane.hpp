#pragma once

#include "o80/memory/lane_receiver.hpp"
#include "o80/memory/lane_sender.hpp"
