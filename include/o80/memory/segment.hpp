#pragma once

#include "o80/memory/attached_segment.hpp"
#include "o80/memory/owned_segment.hpp"
#include "o80/memory/segment_list.hpp"
