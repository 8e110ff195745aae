#pragma once

#include "memory/lane_receiver.hpp"
#include "memory/lane_sender.hpp"
