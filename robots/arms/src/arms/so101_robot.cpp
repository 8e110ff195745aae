#include "arms/so101.hpp"

O80_ROBOT(so101, o80::arms::So101);
