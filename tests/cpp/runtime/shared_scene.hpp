#pragma once

#include <sys/mman.h>

#include <atomic>
#include <cstdint>
#include <new>

namespace o80::test {

/// Shared by the processes of a test.
struct Scene {
  std::atomic<std::uint64_t> scribbles{0};
  std::atomic<bool> over{false};
};

class SharedScene {
 public:
  SharedScene()
      : memory_(mmap(nullptr, sizeof(Scene), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1,
                     0)),
        scene_(new (memory_) Scene) {}
  SharedScene& operator=(SharedScene&&) = delete;
  ~SharedScene() { munmap(memory_, sizeof(Scene)); }
  Scene* operator->() const { return scene_; }

 private:
  void* memory_;
  Scene* scene_;
};

}  // namespace o80::test
