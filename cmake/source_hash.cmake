# Writes a source file that defines o80::source_hash(): the SHA-256 of the library's sources.
#   cmake -DROOT=<o80> -DOUTPUT=<file.cpp> -P source_hash.cmake
# Two trees with the same sources get the same hash, wherever they lie and however they came there.
file(GLOB_RECURSE sources LIST_DIRECTORIES false RELATIVE ${ROOT} ${ROOT}/include/o80/*.hpp ${ROOT}/src/*.hpp
     ${ROOT}/src/*.cpp
)
list(SORT sources COMPARE STRING)
set(listing "")
foreach(source IN LISTS sources)
  file(SHA256 ${ROOT}/${source} hash)
  string(APPEND listing "${hash}  ${source}\n")
endforeach()
string(SHA256 hash "${listing}")
file(
  WRITE ${OUTPUT}
  "#include <string_view>\n\n#include \"o80/base/version.hpp\"\n\nstd::string_view o80::source_hash() noexcept {\n  return \"${hash}\";\n}\n"
)
