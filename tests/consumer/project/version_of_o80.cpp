#include <iostream>

#include "o80/base/version.hpp"

int main() { std::cout << o80::version() << '\n'; }
