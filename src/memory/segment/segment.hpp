#pragma once

#include "memory/segment/attached_segment.hpp"
#include "memory/segment/owned_segment.hpp"
#include "o80/memory/segment_list.hpp"
