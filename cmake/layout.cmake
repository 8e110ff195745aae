# One layout for the build folder, a plain install and the wheel, so that a program finds the
# library and the robots beside it in the same way in all three.
if(DEFINED SKBUILD)
  set(CMAKE_INSTALL_LIBDIR lib)
endif()
include(GNUInstallDirs)

set(CMAKE_RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/bin)
set(CMAKE_LIBRARY_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/lib)
set(CMAKE_ARCHIVE_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/lib)
set(O80_ROBOT_BUILD_DIR ${PROJECT_BINARY_DIR}/lib/o80/robots)
set(O80_ROBOT_INSTALL_DIR ${CMAKE_INSTALL_LIBDIR}/o80/robots)
