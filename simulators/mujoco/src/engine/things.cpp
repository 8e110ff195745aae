#include "engine/things.hpp"

#include <array>
#include <filesystem>
#include <mutex>
#include <utility>

#include "o80/base/error.hpp"

namespace o80::mujoco {
namespace {

using std::filesystem::path;

/// Makes file names absolute, because the text of the whole model names them.
void make_absolute(mjString* file, const path& folder) {
  const std::string name = mjs_getString(file);
  if (!name.empty()) mjs_setString(file, (folder / name).lexically_normal().c_str());
}

void make_files_absolute(mjSpec& spec, const path& folder) {
  const path meshes = folder / mjs_getString(spec.compiler.meshdir);
  const path textures = folder / mjs_getString(spec.compiler.texturedir);
  for (const mjtObj kind : {mjOBJ_MESH, mjOBJ_HFIELD, mjOBJ_SKIN, mjOBJ_TEXTURE}) {
    for (mjsElement* each = mjs_firstElement(&spec, kind); each != nullptr;
         each = mjs_nextElement(&spec, each)) {
      if (kind == mjOBJ_MESH) make_absolute(mjs_asMesh(each)->file, meshes);
      if (kind == mjOBJ_HFIELD) make_absolute(mjs_asHField(each)->file, meshes);
      if (kind == mjOBJ_SKIN) make_absolute(mjs_asSkin(each)->file, meshes);
      if (kind == mjOBJ_TEXTURE) make_absolute(mjs_asTexture(each)->file, textures);
    }
  }
}

/// Attaches `things`, without the warning of repeated names: compilation reports them as errors.
bool attached(mjsFrame& frame, const mjSpec& things) {
  static std::mutex swaps;  // copies are constructed by several threads
  const std::scoped_lock lock(swaps);
  const auto handler = std::exchange(mju_user_warning, [](const char*) {});
  const bool done = mjs_attach(frame.element, things.element, "", "") != nullptr;
  mju_user_warning = handler;
  return done;
}

}  // namespace

SpecPointer parsed(const std::string& path, const char* what) {
  std::array<char, 1024> error{};
  SpecPointer spec(mj_parseXML(path.c_str(), nullptr, error.data(), error.size()));
  if (!spec) {
    throw DriverError("the " + std::string(what) + " '" + path +
                      "' cannot be read: " + error.data());
  }
  return spec;
}

void add_things(mjSpec& spec, const std::string& path) {
  const SpecPointer things = parsed(path, "things");
  make_files_absolute(*things, std::filesystem::absolute(path).parent_path());
  things->option = spec.option;
  things->authored = {};
  mjs_setDeepCopy(&spec, 1);
  mjsFrame* frame = mjs_addFrame(mjs_findBody(&spec, "world"), nullptr);
  if (!attached(*frame, *things)) {
    throw DriverError("the things '" + path +
                      "' cannot be put into the model: " + mjs_getError(&spec));
  }
}

}  // namespace o80::mujoco
