# One test program for each folder of tests/cpp, named after it. A test finds the built programs
# and robots below O80_TEST_PREFIX, laid out as when installed.
find_package(GTest REQUIRED)
include(GoogleTest)

file(GLOB test_sources CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/tests/cpp/*/*_test.cpp)
set(test_folders)
foreach(source IN LISTS test_sources)
  cmake_path(GET source PARENT_PATH folder)
  cmake_path(GET folder FILENAME folder)
  list(APPEND test_folders ${folder})
endforeach()
list(REMOVE_DUPLICATES test_folders)

# tests are compiled for a quick build: what they test keeps its own options
if(O80_SANITIZE)
  set(test_options -O0 -g1)
else()
  set(test_options -O1 -g1)
endif()

foreach(folder IN LISTS test_folders)
  if(folder STREQUAL "mujoco" AND NOT TARGET mujoco::mujoco)
    continue()
  endif()
  set(sources ${test_sources})
  list(FILTER sources INCLUDE REGEX "/tests/cpp/${folder}/")
  set(target o80_test_${folder})
  add_executable(${target} ${sources})
  target_include_directories(${target} PRIVATE ${PROJECT_SOURCE_DIR}/tests/cpp ${PROJECT_SOURCE_DIR})
  target_compile_definitions(
    ${target}
    PRIVATE O80_TEST_PREFIX="${PROJECT_BINARY_DIR}" O80_TEST_SOURCE="${PROJECT_SOURCE_DIR}"
            O80_TEST_COMPILER="${CMAKE_CXX_COMPILER}"
  )
  target_compile_options(${target} PRIVATE ${test_options})
  target_link_libraries(${target} PRIVATE o80 o80_warnings GTest::gmock GTest::gtest GTest::gmock_main)
  # the parts of a robot that its tests look into, when the robot keeps them in a library
  if(TARGET o80_${folder})
    target_link_libraries(${target} PRIVATE o80_${folder})
  endif()
  if(o80_programs OR o80_robots)
    add_dependencies(${target} ${o80_programs} ${o80_robots})
  endif()
  gtest_discover_tests(
    ${target} DISCOVERY_MODE PRE_TEST TEST_PREFIX "${folder}." PROPERTIES TIMEOUT 120
  )
endforeach()

# each C++ file of tests/processes is a program that the process tests start: bin/<stem>
file(GLOB process_sources CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/tests/processes/*.cpp)
foreach(source IN LISTS process_sources)
  cmake_path(GET source STEM program)
  add_executable(${program} ${source})
  target_include_directories(${program} PRIVATE ${PROJECT_SOURCE_DIR})
  target_link_libraries(${program} PRIVATE o80 o80_warnings)
endforeach()
