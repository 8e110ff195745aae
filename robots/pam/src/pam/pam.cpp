#include "pam/driver.hpp"

O80_ROBOT(pam, o80::pam::PamDriver);
