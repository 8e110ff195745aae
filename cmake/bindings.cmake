# The compiled module o80._core and its stub.
find_package(Python 3.11 REQUIRED COMPONENTS Interpreter Development.Module)
execute_process(
  COMMAND ${Python_EXECUTABLE} -m nanobind --cmake_dir
  OUTPUT_VARIABLE nanobind_ROOT
  OUTPUT_STRIP_TRAILING_WHITESPACE COMMAND_ERROR_IS_FATAL ANY
)
find_package(nanobind CONFIG REQUIRED)

# signatures and docstrings of compiled verbs stand in the classes of o80.frontend
set(verb_texts ${PROJECT_BINARY_DIR}/python/verbs.hpp)
set(frontend_sources ${PROJECT_SOURCE_DIR}/python/o80/frontend/reader.py ${PROJECT_SOURCE_DIR}/python/o80/frontend/commander.py)
add_custom_command(
  OUTPUT ${verb_texts}
  COMMAND ${Python_EXECUTABLE} ${PROJECT_SOURCE_DIR}/python/bindings/verbs.py ${verb_texts} ${frontend_sources}
  DEPENDS ${PROJECT_SOURCE_DIR}/python/bindings/verbs.py ${frontend_sources}
  COMMENT "Writing the signatures of compiled verbs"
)
# a target of its own: a command of _core would wait until the library is linked, and the compiler for it
add_custom_target(o80_verbs DEPENDS ${verb_texts})

file(GLOB binding_sources CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/python/bindings/*.cpp)
nanobind_add_module(_core NOMINSIZE NB_SUPPRESS_WARNINGS ${binding_sources})
add_dependencies(_core o80_verbs)
target_include_directories(_core PRIVATE ${PROJECT_SOURCE_DIR}/python/bindings ${PROJECT_BINARY_DIR}/python)
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
