# mujoco::mujoco, from the wheel mujoco-core (or a MuJoCo release) found without importing it.
set(O80_BUILD_MUJOCO "ON" CACHE STRING "Build the MuJoCo simulator: ON, OFF, or AUTO (if MuJoCo is found)")
set_property(CACHE O80_BUILD_MUJOCO PROPERTY STRINGS AUTO ON OFF)
set(O80_MUJOCO_DIR "" CACHE PATH "Folder with MuJoCo's include/ and libmujoco.so.*; empty: ask Python")
if(O80_BUILD_MUJOCO STREQUAL "OFF")
  return()
endif()

set(mujoco_dir "${O80_MUJOCO_DIR}")
if(NOT mujoco_dir)
  find_package(Python COMPONENTS Interpreter QUIET)
  if(Python_Interpreter_FOUND)
    execute_process(
      COMMAND
        ${Python_EXECUTABLE} -c
        "import importlib.util as u; s = u.find_spec('mujoco'); print(s.submodule_search_locations[0] if s else '')"
      OUTPUT_VARIABLE mujoco_dir
      OUTPUT_STRIP_TRAILING_WHITESPACE
      ERROR_QUIET
    )
  endif()
endif()
if(mujoco_dir)
  file(GLOB mujoco_libraries ${mujoco_dir}/libmujoco.so* ${mujoco_dir}/lib/libmujoco.so*)
endif()
if(mujoco_libraries AND EXISTS ${mujoco_dir}/include/mujoco/mujoco.h)
  list(GET mujoco_libraries 0 mujoco_library)
  cmake_path(GET mujoco_library PARENT_PATH O80_MUJOCO_LIBRARY_DIR)
  add_library(mujoco::mujoco SHARED IMPORTED GLOBAL)
  set_target_properties(
    mujoco::mujoco PROPERTIES IMPORTED_LOCATION ${mujoco_library}
                              INTERFACE_INCLUDE_DIRECTORIES ${mujoco_dir}/include
  )
  message(STATUS "MuJoCo: ${mujoco_library}")
elseif(O80_BUILD_MUJOCO STREQUAL "ON")
  message(
    FATAL_ERROR
      "MuJoCo was not found. Install it with `pip install mujoco-core` into the Python that CMake uses "
      "(-DPython_EXECUTABLE=...), give its folder with -DO80_MUJOCO_DIR=..., or turn the simulator off "
      "with -DO80_BUILD_MUJOCO=OFF."
  )
else()
  message(STATUS "MuJoCo: not found, its simulator is left out")
endif()
