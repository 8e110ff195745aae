#pragma once

#include "memory/attached_segment.hpp"
#include "memory/owned_segment.hpp"
#include "o80/memory/segment_list.hpp"
