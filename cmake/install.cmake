# include/, lib/, bin/ and lib/cmake/o80, the same in a plain install and in the wheel.
include(CMakePackageConfigHelpers)

install(DIRECTORY ${PROJECT_SOURCE_DIR}/include/o80 DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} FILES_MATCHING PATTERN "*.hpp")
install(
  TARGETS o80 o80_headers
  EXPORT o80Targets
  LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR}
)
if(o80_programs)
  install(TARGETS ${o80_programs} RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
endif()
if(o80_bundled_robots)
  install(TARGETS ${o80_bundled_robots} LIBRARY DESTINATION ${O80_ROBOT_INSTALL_DIR})
endif()
if(O80_BUILD_PYTHON)
  install(TARGETS _core LIBRARY DESTINATION .)
  install(FILES ${PROJECT_BINARY_DIR}/python/_core.pyi DESTINATION .)
endif()

set(config_dir ${CMAKE_INSTALL_LIBDIR}/cmake/o80)
install(EXPORT o80Targets NAMESPACE o80:: DESTINATION ${config_dir})
configure_package_config_file(
  ${CMAKE_CURRENT_LIST_DIR}/o80Config.cmake.in ${PROJECT_BINARY_DIR}/cmake/o80Config.cmake
  INSTALL_DESTINATION ${config_dir}
)
write_basic_package_version_file(
  ${PROJECT_BINARY_DIR}/cmake/o80ConfigVersion.cmake COMPATIBILITY SameMinorVersion
)
install(
  FILES ${PROJECT_BINARY_DIR}/cmake/o80Config.cmake ${PROJECT_BINARY_DIR}/cmake/o80ConfigVersion.cmake
        ${CMAKE_CURRENT_LIST_DIR}/o80_add_robot.cmake
  DESTINATION ${config_dir}
)

# with an activated virtual environment find_package(o80) looks below its root and needs no hint
if(DEFINED SKBUILD)
  set(forwarding_dir ${SKBUILD_DATA_DIR}/lib/cmake/o80)
  set(
    forwarding_path
    "/../../python${Python_VERSION_MAJOR}.${Python_VERSION_MINOR}/site-packages/o80/${config_dir}"
  )
  foreach(file o80Config.cmake o80ConfigVersion.cmake)
    file(WRITE ${PROJECT_BINARY_DIR}/forwarding/${file}
         "include(\${CMAKE_CURRENT_LIST_DIR}${forwarding_path}/${file})\n"
    )
    install(FILES ${PROJECT_BINARY_DIR}/forwarding/${file} DESTINATION ${forwarding_dir})
  endforeach()
endif()
