# Every folder of robots/ and simulators/ that has a CMakeLists.txt; what it adds with
# o80_add_robot is installed among the bundled robots.
file(GLOB robot_lists CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/robots/*/CMakeLists.txt
     ${PROJECT_SOURCE_DIR}/simulators/*/CMakeLists.txt
)
set(o80_robots)
foreach(list_file IN LISTS robot_lists)
  cmake_path(GET list_file PARENT_PATH folder)
  cmake_path(GET folder FILENAME name)
  if(name STREQUAL "mujoco" AND NOT TARGET mujoco::mujoco)
    continue()
  endif()
  add_subdirectory(${folder})
  get_property(targets DIRECTORY ${folder} PROPERTY BUILDSYSTEM_TARGETS)
  foreach(target IN LISTS targets)
    get_target_property(type ${target} TYPE)
    if(NOT type STREQUAL "INTERFACE_LIBRARY" AND NOT type STREQUAL "UTILITY")
      target_link_libraries(${target} PRIVATE o80_warnings)
    endif()
    if(type STREQUAL "MODULE_LIBRARY")
      list(APPEND o80_robots ${target})
    endif()
  endforeach()
endforeach()
