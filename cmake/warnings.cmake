# Warnings for the code of this tree; never exported to users.
add_library(o80_warnings INTERFACE)
target_compile_options(o80_warnings INTERFACE -Wall -Wextra -Wpedantic -Wshadow)
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND CMAKE_CXX_COMPILER_VERSION VERSION_LESS 13)
  # g++ 12 sees overlapping copies in std::string's own operator+
  target_compile_options(o80_warnings INTERFACE -Wno-restrict)
endif()
if(O80_WERROR)
  target_compile_options(o80_warnings INTERFACE -Werror)
endif()
