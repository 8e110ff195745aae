# The fuzzers of tests/proofs/fuzz: one program for each fuzz_<name>.cpp, against a library that is watched
# while it runs. They need clang and its libFuzzer, and a sanitizer to notice anything.
option(O80_BUILD_FUZZERS "Build the fuzzers (needs clang)" OFF)
if(NOT O80_BUILD_FUZZERS)
  return()
endif()

target_compile_options(o80 PRIVATE -fsanitize=fuzzer-no-link)

file(GLOB fuzzer_sources CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/tests/proofs/fuzz/fuzz_*.cpp)
add_custom_target(fuzzers)
foreach(source IN LISTS fuzzer_sources)
  cmake_path(GET source STEM program)
  add_executable(${program} EXCLUDE_FROM_ALL ${source})
  target_include_directories(${program} PRIVATE ${PROJECT_SOURCE_DIR}/tests/proofs ${PROJECT_SOURCE_DIR}/tests/cpp)
  target_link_libraries(${program} PRIVATE o80 o80_private_headers o80_warnings)
  target_link_options(${program} PRIVATE -fsanitize=fuzzer)
  add_dependencies(fuzzers ${program})
endforeach()
