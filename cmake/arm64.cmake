# Toolchain: the instruction set of 64-bit ARM, its programs run by an emulator of one process.
# A page of QEMU_PAGESIZE bytes, if that is set in the environment of what runs (4096 otherwise).
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(CMAKE_CXX_COMPILER aarch64-linux-gnu-g++)

set(arm64_root /usr/aarch64-linux-gnu)
set(CMAKE_FIND_ROOT_PATH ${arm64_root})
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_PACKAGE ONLY)
set(CMAKE_CROSSCOMPILING_EMULATOR qemu-aarch64-static -L ${arm64_root})

# the emulator's futexes fail where two threads meet at a mutex that inherits priorities
add_compile_definitions(O80_WITHOUT_PRIORITY_INHERITANCE)
