# One test program for each folder of tests/cpp, the rooms in it included, and for the folder
# tests/cpp of each robot and simulator, which is named after the robot. A test finds the built programs and robots beside itself
# (tests/cpp/places.hpp), laid out as when installed.
include(cmake/googletest.cmake)
include(GoogleTest)

file(GLOB test_sources CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/tests/cpp/*/*.cpp
     ${PROJECT_SOURCE_DIR}/tests/cpp/*/*/*.cpp
     ${PROJECT_SOURCE_DIR}/robots/*/tests/cpp/*.cpp ${PROJECT_SOURCE_DIR}/simulators/*/tests/cpp/*.cpp
     ${PROJECT_SOURCE_DIR}/devices/tests/cpp/*.cpp
)
set(test_folders)
foreach(source IN LISTS test_sources)
  cmake_path(GET source PARENT_PATH folder)
  cmake_path(RELATIVE_PATH folder BASE_DIRECTORY ${PROJECT_SOURCE_DIR}/tests/cpp OUTPUT_VARIABLE name)
  string(REGEX REPLACE "/.*" "" name ${name})
  if(name STREQUAL "..") # of a robot
    cmake_path(SET robot NORMALIZE ${folder}/../..)
    cmake_path(GET robot PARENT_PATH robot)
    cmake_path(GET robot FILENAME name)
  endif()
  list(APPEND test_folders ${name})
  list(APPEND test_sources_of_${name} ${source})
endforeach()
list(REMOVE_DUPLICATES test_folders)
if(O80_TEST_FOLDERS)
  set(test_folders ${O80_TEST_FOLDERS})
endif()
# the thread sanitizer reads the memory layer, and of the others what starts a thread or a process
if(O80_SANITIZE STREQUAL "thread")
  foreach(folder IN ITEMS runtime robot)
    foreach(source IN LISTS test_sources_of_${folder})
      file(STRINGS ${source} parallel REGEX "thread|fork|Child|Program|Group|BurstingBackend")
      if(NOT parallel)
        list(REMOVE_ITEM test_sources_of_${folder} ${source})
      endif()
    endforeach()
  endforeach()
endif()
set(folders_with_tools robot)
set(test_targets)

# tests are compiled for a quick build, what they test keeps its own options; an emulator is slow
if(CMAKE_CROSSCOMPILING)
  set(test_options -O1 -g1)
else()
  set(test_options -O0 -g1)
endif()

# the layers that do the work of an iteration once more, with that work counted
file(GLOB_RECURSE counted_sources CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/src/control/*.cpp
     ${PROJECT_SOURCE_DIR}/src/runtime/*.cpp
)
add_library(o80_bounded OBJECT EXCLUDE_FROM_ALL ${counted_sources})
target_compile_definitions(o80_bounded PUBLIC O80_COUNT_BLOCKS)
target_compile_options(o80_bounded PRIVATE -ffp-contract=off -O1)
target_link_libraries(o80_bounded PRIVATE o80_private_headers o80_warnings)

# the memory layer once more, with labelled points at which a process can be killed
file(GLOB_RECURSE memory_sources CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/src/memory/*.cpp)
add_library(o80_killed OBJECT EXCLUDE_FROM_ALL ${memory_sources})
target_compile_definitions(o80_killed PUBLIC O80_CRASH_POINTS)
target_compile_options(o80_killed PRIVATE ${test_options})
target_link_libraries(o80_killed PRIVATE o80_private_headers o80_warnings)

# BusyMachineTest proves something on a real-time machine only: `make rt` runs it.
set(elsewhere "BusyMachineTest.*")

foreach(folder IN LISTS test_folders)
  if(folder STREQUAL "mujoco" AND NOT TARGET mujoco_driver)
    continue()
  endif()
  # one stands in front of shared libraries, as sanitizers do; the others hold parts of the library
  # a second time
  if(folder STREQUAL "iteration" AND O80_STATIC)
    continue()
  endif()
  if(folder MATCHES "^(iteration|bounded|killed)$" AND O80_SANITIZE)
    continue()
  endif()
  set(target o80_test_${folder})
  list(APPEND test_targets ${target})
  add_executable(${target} ${test_sources_of_${folder}})
  target_include_directories(${target} PRIVATE ${PROJECT_SOURCE_DIR}/tests/cpp ${PROJECT_SOURCE_DIR})
  target_compile_definitions(
    ${target}
    PRIVATE O80_TEST_SOURCE="${PROJECT_SOURCE_DIR}" O80_TEST_COMPILER="${CMAKE_CXX_COMPILER}"
  )
  if(O80_SANITIZE)
    target_compile_definitions(${target} PRIVATE O80_TEST_SANITIZED)
  endif()
  if(O80_SANITIZE STREQUAL "thread")
    target_compile_definitions(${target} PRIVATE O80_TEST_THREAD_SANITIZED)
  endif()
  if(CMAKE_CROSSCOMPILING_EMULATOR)
    list(JOIN CMAKE_CROSSCOMPILING_EMULATOR " " emulator)
    target_compile_definitions(${target} PRIVATE O80_TEST_EMULATOR="${emulator}")
  endif()
  target_compile_options(${target} PRIVATE ${test_options})
  target_link_libraries(${target} PRIVATE o80 o80_private_headers o80_warnings GTest::gmock GTest::gtest GTest::gmock_main)
  # the parts of a robot that its tests look into, when the robot keeps them in a library
  if(TARGET o80_${folder})
    target_link_libraries(${target} PRIVATE o80_${folder})
  endif()
  if(o80_programs OR o80_robots)
    add_dependencies(${target} ${o80_programs} ${o80_robots})
  endif()
  if(CMAKE_CROSSCOMPILING)
    # each start of an emulator is slow; what maps memory is tested with large pages too
    set(pages 4096)
    set(left_out)
    if(folder STREQUAL "robot")
      # signals, privileges and scheduling of o80-run would be the emulator's
      set(left_out --gtest_filter=-RunTest*)
    endif()
    if(folder MATCHES "^(memory|runtime|robot)$")
      list(APPEND pages 65536)
    endif()
    foreach(page IN LISTS pages)
      add_test(NAME ${folder}.pages_of_${page} COMMAND ${target} ${left_out})
      set_tests_properties(
        ${folder}.pages_of_${page} PROPERTIES TIMEOUT 600 ENVIRONMENT QEMU_PAGESIZE=${page}
      )
    endforeach()
  elseif(O80_SANITIZE)
    # a process for each program, not for each test: a sanitizer makes each start slow
    add_test(
      NAME ${folder}
      COMMAND ${target} --gtest_brief=1 "--gtest_filter=-${elsewhere}"
    )
    set_tests_properties(${folder} PROPERTIES TIMEOUT 900)
  else()
    # suites named *WithTools need programs that only `make check` asks for
    gtest_discover_tests(
      ${target}
      DISCOVERY_MODE PRE_TEST
      TEST_PREFIX "${folder}."
      TEST_FILTER "-${elsewhere}:*WithTools.*"
      PROPERTIES TIMEOUT 300
    )
    if(folder IN_LIST folders_with_tools)
      gtest_discover_tests(
        ${target}
        DISCOVERY_MODE PRE_TEST
        TEST_PREFIX "${folder}."
        TEST_FILTER "*WithTools.*"
        TEST_LIST ${target}_WITH_TOOLS
        PROPERTIES TIMEOUT 300 LABELS check
      )
    endif()
  endif()
endforeach()

# the folders chosen, and what their tests start
add_custom_target(o80-core-tests DEPENDS ${test_targets})

# the machine with a real-time kernel runs these beside the tests
if(O80_STATIC)
  foreach(program o80-rt-loop o80-rt-frontend)
    add_executable(${program} ${PROJECT_SOURCE_DIR}/tests/proofs/real_time/${program}.cpp)
    target_include_directories(${program} PRIVATE ${PROJECT_SOURCE_DIR}/tests/cpp)
    target_link_libraries(${program} PRIVATE o80 o80_private_headers o80_warnings)
  endforeach()
endif()

# each C++ file of tests/processes is a program that the process tests start: bin/<stem>
file(GLOB process_sources CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/tests/processes/*.cpp)
foreach(source IN LISTS process_sources)
  cmake_path(GET source STEM program)
  add_executable(${program} ${source})
  target_include_directories(${program} PRIVATE ${PROJECT_SOURCE_DIR})
  target_link_libraries(${program} PRIVATE o80 o80_private_headers o80_warnings)
endforeach()

include(cmake/torture.cmake)
