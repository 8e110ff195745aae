# What to build. A user who only wants the library needs none of these.
if(DEFINED SKBUILD)
  set(building_wheel ON)
  set(building_all OFF)
else()
  set(building_wheel OFF)
  set(building_all ON)
endif()

option(O80_BUILD_PYTHON "Build the Python module o80._core" ${building_wheel})
option(O80_BUILD_PACKAGES "Build the robots of the repository's other packages too" ${building_all})
option(O80_BUILD_TESTS "Build the C++ tests (needs GoogleTest)" OFF)
option(O80_BUILD_EXAMPLES "Build the C++ examples" OFF)
option(O80_BUILD_BENCHMARKS "Build the benchmarks" OFF)
option(O80_WERROR "Treat warnings as errors" OFF)
option(O80_CCACHE "Compile through ccache where it is installed" OFF)
option(O80_TIDY "Check all compiled sources with clang-tidy" OFF)
option(O80_STATIC "Link everything statically; such programs load no robot libraries" OFF)
set(O80_TEST_FOLDERS "" CACHE STRING "Folders of tests/cpp to build; empty: all that can be built")
set(O80_BUILD_MUJOCO "AUTO" CACHE STRING "Build the MuJoCo simulator: AUTO (if MuJoCo is found), ON or OFF")
set(O80_SANITIZE "" CACHE STRING "Sanitizers for everything built, as for -fsanitize=")

if(NOT CMAKE_BUILD_TYPE AND NOT CMAKE_CONFIGURATION_TYPES)
  set(CMAKE_BUILD_TYPE Release CACHE STRING "Kind of build" FORCE)
endif()

if(O80_CCACHE AND NOT CMAKE_CXX_COMPILER_LAUNCHER)
  find_program(O80_CCACHE_PROGRAM ccache)
  if(O80_CCACHE_PROGRAM)
    set(CMAKE_CXX_COMPILER_LAUNCHER ${O80_CCACHE_PROGRAM})
  endif()
endif()

set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
set(CMAKE_POSITION_INDEPENDENT_CODE ON)

if(O80_SANITIZE)
  add_compile_options(-fsanitize=${O80_SANITIZE} -fno-omit-frame-pointer -fno-sanitize-recover=all)
  add_link_options(-fsanitize=${O80_SANITIZE})
endif()

# a source is checked when it is compiled: again only after a change of what it includes, of the
# settings or of clang-tidy
if(O80_TIDY)
  execute_process(
    COMMAND clang-tidy --version OUTPUT_VARIABLE tidy_version COMMAND_ERROR_IS_FATAL ANY
  )
  file(READ ${PROJECT_SOURCE_DIR}/.clang-tidy tidy_settings)
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/.clang-tidy)
  string(SHA256 tidy_state "${tidy_version} ${tidy_settings}")
  # the static analyzer also checks included headers; it finds most within few nodes
  set(CMAKE_CXX_CLANG_TIDY clang-tidy --quiet --extra-arg=-DO80_TIDY_STATE=${tidy_state})
  foreach(option IN ITEMS -analyzer-opt-analyze-headers -analyzer-config max-nodes=30000)
    list(APPEND CMAKE_CXX_CLANG_TIDY --extra-arg=-Xclang --extra-arg=${option})
  endforeach()
endif()
