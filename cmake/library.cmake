# o80::headers for robot libraries, o80::o80 for programs.
find_package(Threads REQUIRED)

add_library(o80_headers INTERFACE)
add_library(o80::headers ALIAS o80_headers)
set_target_properties(o80_headers PROPERTIES EXPORT_NAME headers)
target_compile_features(o80_headers INTERFACE cxx_std_20)
target_include_directories(
  o80_headers INTERFACE $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/include>
                        $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>
)

# what o80's own programs, bindings and tests include beside them; never installed
add_library(o80_private_headers INTERFACE)
target_link_libraries(o80_private_headers INTERFACE o80_headers)
target_include_directories(o80_private_headers INTERFACE ${PROJECT_SOURCE_DIR}/src)

file(GLOB_RECURSE o80_sources CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/src/*.cpp)
list(FILTER o80_sources EXCLUDE REGEX "/src/programs/")
# the hash of all sources is a source of its own, compiled alone because it changes with each of them
file(GLOB_RECURSE hashed_sources CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/include/o80/*.hpp
     ${PROJECT_SOURCE_DIR}/src/*.hpp ${PROJECT_SOURCE_DIR}/src/*.cpp
)
set(source_hash ${PROJECT_BINARY_DIR}/source_hash.cpp)
add_custom_command(
  OUTPUT ${source_hash}
  COMMAND ${CMAKE_COMMAND} -DROOT=${PROJECT_SOURCE_DIR} -DOUTPUT=${source_hash} -P
          ${PROJECT_SOURCE_DIR}/cmake/source_hash.cmake
  DEPENDS ${hashed_sources} ${PROJECT_SOURCE_DIR}/cmake/source_hash.cmake
  COMMENT "Hashing the sources of the library" VERBATIM
)
set_source_files_properties(${source_hash} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
list(APPEND o80_sources ${source_hash})

if(O80_STATIC)
  add_library(o80 STATIC ${o80_sources})
  add_link_options(-static)
else()
  add_library(o80 SHARED ${o80_sources})
endif()
add_library(o80::o80 ALIAS o80)
set_target_properties(o80 PROPERTIES DEFINE_SYMBOL "") # shared and static compile alike
target_link_libraries(
  o80 PUBLIC o80_headers Threads::Threads PRIVATE ${CMAKE_DL_LIBS} o80_private_headers o80_warnings
)
# no fused multiply-add: machines agree on every desired state, bit for bit
target_compile_options(o80 PRIVATE -ffp-contract=off)
# calls inside the library are direct, and may be inlined across its files
target_compile_options(o80 PRIVATE -fno-semantic-interposition)
include(CheckIPOSupported)
check_ipo_supported(RESULT o80_can_inline_across_files OUTPUT o80_why_not LANGUAGES CXX)
if(o80_can_inline_across_files)
  set_target_properties(o80 PROPERTIES INTERPROCEDURAL_OPTIMIZATION_RELEASE ON)
endif()
if(NOT O80_SANITIZE) # whose functions are in the program
  target_link_options(o80 PRIVATE -Wl,--no-undefined)
endif()
if(NOT DEFINED SKBUILD) # a wheel has no symbolic links and would carry three copies
  set_target_properties(o80 PROPERTIES VERSION ${PROJECT_VERSION} SOVERSION ${PROJECT_VERSION_MAJOR})
endif()
