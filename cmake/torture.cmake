# The fault campaign, against a core that can be killed at labelled points
if(NOT O80_SANITIZE AND NOT CMAKE_CROSSCOMPILING)
  add_library(o80_crash_points STATIC EXCLUDE_FROM_ALL ${o80_sources})
  target_compile_definitions(o80_crash_points PUBLIC O80_CRASH_POINTS)
  target_compile_options(o80_crash_points PRIVATE -ffp-contract=off -O1) # built for one campaign
  target_link_libraries(
    o80_crash_points PUBLIC o80_headers Threads::Threads ${CMAKE_DL_LIBS} PRIVATE o80_private_headers o80_warnings
  )
  file(GLOB torture_sources CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/tests/processes/torture/*.cpp)
  add_executable(o80-torture EXCLUDE_FROM_ALL ${torture_sources}) # built when it is to run
  target_include_directories(o80-torture PRIVATE ${PROJECT_SOURCE_DIR}/tests/processes)
  target_compile_definitions(
    o80-torture
    PRIVATE O80_TORTURE_ACTOR="${PROJECT_SOURCE_DIR}/tests/processes/torture/actor.py"
  )
  target_link_libraries(o80-torture PRIVATE o80_crash_points o80_private_headers o80_warnings)
endif()
