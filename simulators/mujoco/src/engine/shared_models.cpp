#include "engine/shared_models.hpp"

#include <cstddef>
#include <functional>
#include <mutex>
#include <string>
#include <vector>

namespace o80::mujoco {
namespace {

struct InUse {
  std::size_t hash;
  std::weak_ptr<const mjModel> model;
};

std::string bytes_of(const mjModel& model) {
  std::string bytes(static_cast<std::size_t>(mj_sizeModel(&model)), '\0');
  mj_saveModel(&model, nullptr, bytes.data(), static_cast<mjtSize>(bytes.size()));
  return bytes;
}

}  // namespace

SharedModel shared(ModelPointer model) {
  static std::mutex mutex;
  static std::vector<InUse> all;
  const std::string bytes = bytes_of(*model);
  const std::size_t hash = std::hash<std::string>{}(bytes);
  const std::scoped_lock lock(mutex);
  std::erase_if(all, [](const InUse& each) { return each.model.expired(); });
  for (const InUse& each : all) {
    if (each.hash != hash) continue;
    SharedModel found = each.model.lock();
    if (found && bytes_of(*found) == bytes) return found;
  }
  SharedModel own(std::move(model));
  all.push_back({hash, own});
  return own;
}

}  // namespace o80::mujoco
