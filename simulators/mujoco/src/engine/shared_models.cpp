#include "engine/shared_models.hpp"

#include <functional>
#include <mutex>
#include <utility>
#include <vector>

namespace o80::mujoco {
namespace {

struct InUse {
  std::string key;
  std::weak_ptr<const mjModel> model;
  std::string mjcf;
};

/// The newer model keeps the older one alive.
struct InAnotherStep {
  const mjModel* of;
  double step;
  std::weak_ptr<const mjModel> model;
};

std::mutex mutex;
std::vector<InUse> models;
std::vector<InAnotherStep> in_another_step;

template <class Known>
void forget_unused(std::vector<Known>& known) {
  std::erase_if(known, [](const Known& each) { return each.model.expired(); });
}

}  // namespace

MadeModel shared(std::string key, const std::function<MadeModel()>& make) {
  const std::scoped_lock lock(mutex);
  forget_unused(models);
  for (const InUse& each : models) {
    if (each.key != key) continue;
    if (SharedModel found = each.model.lock()) return {std::move(found), each.mjcf};
  }
  MadeModel made = make();
  models.push_back({std::move(key), made.model, made.mjcf});
  return made;
}

SharedModel with_timestep(SharedModel model, double step) {
  if (step == model->opt.timestep) return model;
  const std::scoped_lock lock(mutex);
  forget_unused(in_another_step);
  for (const InAnotherStep& each : in_another_step) {
    if (each.of != model.get() || each.step != step) continue;
    if (SharedModel found = each.model.lock()) return found;
  }
  ModelPointer own(mj_copyModel(nullptr, model.get()));
  own->opt.timestep = step;
  const mjModel* of = model.get();
  SharedModel made(own.release(), [kept = std::move(model)](mjModel* each) mutable {
    mj_deleteModel(each);
    kept.reset();  // this function lives as long as `in_another_step` refers to the model
  });
  in_another_step.push_back({of, step, made});
  return made;
}

}  // namespace o80::mujoco
