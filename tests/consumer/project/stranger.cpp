#include "o80/base/version.hpp"

// hidden unless said otherwise, as everything in a robot library
int not_for_others() { return 1; }

extern "C" __attribute__((visibility("default"))) int stranger() { return not_for_others(); }
