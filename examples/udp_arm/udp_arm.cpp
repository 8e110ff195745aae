#include "udp_arm.hpp"

O80_ROBOT(udp_arm, udp_arm::UdpArm)
