#pragma once

// Small models from text.

#include <mujoco/mujoco.h>

#include <array>
#include <stdexcept>
#include <string>

#include "engine/pointers.hpp"

namespace o80::mujoco {

inline SpecPointer spec_of(const std::string& mjcf) {
  std::array<char, 1000> error{};
  SpecPointer spec(mj_parseXMLString(mjcf.c_str(), nullptr, error.data(), error.size()));
  if (!spec) throw std::runtime_error(error.data());
  return spec;
}

inline ModelPointer model_of(mjSpec& spec) {
  ModelPointer model(mj_compile(&spec, nullptr));
  if (!model) throw std::runtime_error(mjs_getError(&spec));
  return model;
}

}  // namespace o80::mujoco
