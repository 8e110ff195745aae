#include "two_joints.hpp"

O80_ROBOT(two_joints, TwoJoints);
