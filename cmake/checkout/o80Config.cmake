# What find_package(o80) finds with o80_DIR=<checkout>/cmake/checkout: the headers, before the library
# is built. tools/setup.sh builds the packages of the repository with it, at the same time as o80.
add_library(o80::headers INTERFACE IMPORTED)
target_compile_features(o80::headers INTERFACE cxx_std_20)
target_include_directories(o80::headers INTERFACE ${CMAKE_CURRENT_LIST_DIR}/../../include)
include(${CMAKE_CURRENT_LIST_DIR}/../o80_add_robot.cmake)
