# The fuzzers of tests/fuzz: one program for each fuzz_<name>.cpp. They need clang and its libFuzzer.
option(O80_BUILD_FUZZERS "Build the fuzzers (needs clang)" OFF)
if(NOT O80_BUILD_FUZZERS)
  return()
endif()

# what they look into, watched while it runs; robots and their loop are not among it
set(fuzz_options -fsanitize=fuzzer-no-link,address,undefined -fno-sanitize-recover=all)
file(GLOB fuzzed_sources CONFIGURE_DEPENDS
     ${PROJECT_SOURCE_DIR}/src/base/*.cpp ${PROJECT_SOURCE_DIR}/src/describe/*.cpp
     ${PROJECT_SOURCE_DIR}/src/memory/*.cpp ${PROJECT_SOURCE_DIR}/src/control/*.cpp
     ${PROJECT_SOURCE_DIR}/src/runtime/*.cpp)
add_library(o80_fuzzed STATIC ${fuzzed_sources})
target_compile_options(o80_fuzzed PUBLIC ${fuzz_options} -g1)
target_link_libraries(o80_fuzzed PUBLIC o80_headers o80_warnings Threads::Threads)

file(GLOB fuzzer_sources CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/tests/fuzz/fuzz_*.cpp)
add_custom_target(fuzzers)
foreach(source IN LISTS fuzzer_sources)
  cmake_path(GET source STEM program)
  add_executable(${program} ${source})
  target_include_directories(${program} PRIVATE ${PROJECT_SOURCE_DIR}/tests)
  target_link_libraries(${program} PRIVATE o80_fuzzed)
  target_link_options(${program} PRIVATE -fsanitize=fuzzer,address,undefined)
  add_dependencies(fuzzers ${program})
endforeach()
