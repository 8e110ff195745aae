# Warnings for the code of this tree; never exported to users.
add_library(o80_warnings INTERFACE)
target_compile_options(o80_warnings INTERFACE -Wall -Wextra -Wpedantic -Wshadow)
if(O80_WERROR)
  target_compile_options(o80_warnings INTERFACE -Werror)
endif()
