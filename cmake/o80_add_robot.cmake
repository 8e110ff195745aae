# o80_add_robot(name source...)
#
# Builds the robot library <name>.so from sources of which one contains O80_ROBOT(name, Driver).
# The target is called <name>: link to it what the hardware needs. The library uses o80's headers
# only; the program that loads it brings the compiled loop.
function(o80_add_robot name)
  add_library(${name} MODULE ${ARGN})
  target_compile_features(${name} PRIVATE cxx_std_20)
  target_link_libraries(${name} PRIVATE o80::headers)
  # a symbol that nobody defines is an error here, not when the robot is started
  if(NOT O80_SANITIZE) # whose functions are in the program
    target_link_options(${name} PRIVATE -Wl,--no-undefined)
  endif()
  set_target_properties(
    ${name}
    PROPERTIES PREFIX ""
               SUFFIX ".so"
               CXX_VISIBILITY_PRESET hidden
               VISIBILITY_INLINES_HIDDEN ON
  )
  if(DEFINED O80_ROBOT_BUILD_DIR)
    set_target_properties(${name} PROPERTIES LIBRARY_OUTPUT_DIRECTORY ${O80_ROBOT_BUILD_DIR})
  endif()
endfunction()

# o80_install_robot(name)
#
# Installs the robot library: in a Python package, built by scikit-build-core, into the folder lib of
# `wheel.install-dir`; in a plain installation where o80 of the same prefix finds it by its name.
function(o80_install_robot name)
  if(DEFINED SKBUILD)
    install(TARGETS ${name} LIBRARY DESTINATION lib)
  else()
    include(GNUInstallDirs)
    install(TARGETS ${name} LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR}/o80/robots)
  endif()
endfunction()
