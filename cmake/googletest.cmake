# GTest::gtest, GTest::gmock and GTest::gmock_main: of this machine, or compiled from the sources
# that Debian's package googletest brings, for another one.
if(NOT CMAKE_CROSSCOMPILING)
  find_package(GTest REQUIRED)
  return()
endif()

set(O80_GOOGLETEST_DIR "/usr/src/googletest" CACHE PATH "GoogleTest's sources, for other machines")
if(NOT EXISTS ${O80_GOOGLETEST_DIR}/googlemock/src/gmock-all.cc)
  message(FATAL_ERROR "GoogleTest's sources are not in '${O80_GOOGLETEST_DIR}'. Install them with "
                      "`apt-get install googletest`, or give their folder with -DO80_GOOGLETEST_DIR=..."
  )
endif()
find_package(Threads REQUIRED)
add_library(
  o80_googletest STATIC
  ${O80_GOOGLETEST_DIR}/googletest/src/gtest-all.cc
  ${O80_GOOGLETEST_DIR}/googlemock/src/gmock-all.cc
  ${O80_GOOGLETEST_DIR}/googlemock/src/gmock_main.cc
)
target_include_directories(
  o80_googletest SYSTEM PUBLIC ${O80_GOOGLETEST_DIR}/googletest/include
                               ${O80_GOOGLETEST_DIR}/googlemock/include
)
target_include_directories(
  o80_googletest SYSTEM PRIVATE ${O80_GOOGLETEST_DIR}/googletest ${O80_GOOGLETEST_DIR}/googlemock
)
target_compile_options(o80_googletest PRIVATE -O0 -g0)
target_link_libraries(o80_googletest PUBLIC Threads::Threads)
foreach(part gtest gmock gmock_main)
  add_library(GTest::${part} ALIAS o80_googletest)
endforeach()
