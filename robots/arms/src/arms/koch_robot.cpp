#include "arms/koch.hpp"

O80_ROBOT(koch, o80::arms::Koch);
