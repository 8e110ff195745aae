#pragma once

#include <mujoco/mujoco.h>

#include <memory>

namespace o80::mujoco {

struct DeleteSpec {
  void operator()(mjSpec* spec) const noexcept { mj_deleteSpec(spec); }
};
struct DeleteModel {
  void operator()(mjModel* model) const noexcept { mj_deleteModel(model); }
};
struct DeleteData {
  void operator()(mjData* data) const noexcept { mj_deleteData(data); }
};
using SpecPointer = std::unique_ptr<mjSpec, DeleteSpec>;
using ModelPointer = std::unique_ptr<mjModel, DeleteModel>;
using DataPointer = std::unique_ptr<mjData, DeleteData>;

}  // namespace o80::mujoco
