# The compiled module o80._core and its stub.
find_package(Python 3.11 REQUIRED COMPONENTS Interpreter Development.Module)
execute_process(
  COMMAND ${Python_EXECUTABLE} -m nanobind --cmake_dir
  OUTPUT_VARIABLE nanobind_ROOT
  OUTPUT_STRIP_TRAILING_WHITESPACE COMMAND_ERROR_IS_FATAL ANY
)
find_package(nanobind CONFIG REQUIRED)

file(GLOB binding_sources CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/python/bindings/*.cpp)
nanobind_add_module(_core NOMINSIZE NB_SUPPRESS_WARNINGS ${binding_sources})
target_include_directories(_core PRIVATE ${PROJECT_SOURCE_DIR}/python/bindings)
target_link_libraries(_core PRIVATE o80 o80_private_headers o80_warnings)
set_target_properties(
  _core PROPERTIES INSTALL_RPATH "$ORIGIN/lib" LIBRARY_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/python
)
nanobind_add_stub(
  _core_stub
  MODULE _core
  OUTPUT ${PROJECT_BINARY_DIR}/python/_core.pyi
  PYTHON_PATH $<TARGET_FILE_DIR:_core>
  INCLUDE_PRIVATE
  PATTERN_FILE ${PROJECT_SOURCE_DIR}/python/bindings/stub.pat
  DEPENDS _core ${PROJECT_SOURCE_DIR}/python/bindings/stub.pat
)
