#pragma once

#include "memory/ring/lane_receiver.hpp"
#include "memory/ring/lane_sender.hpp"
