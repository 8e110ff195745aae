#pragma once

#include <pthread.h>

namespace o80 {

/// Neither movable nor copyable: a mutex whose holder runs at the priority of the highest thread
/// that waits for it, so that a real-time thread never waits for ordinary work on its processor.
class InheritingMutex {
 public:
  InheritingMutex() noexcept { initialise(); }
  InheritingMutex(const InheritingMutex&) = delete;
  InheritingMutex& operator=(const InheritingMutex&) = delete;
  ~InheritingMutex() { pthread_mutex_destroy(&mutex_); }

  void lock() noexcept { pthread_mutex_lock(&mutex_); }
  void unlock() noexcept { pthread_mutex_unlock(&mutex_); }
  /// In a forked child, whose only thread is not the holder: a mutex that checks errors refuses the
  /// unlocking before it asks the kernel, and tools that watch mutexes see it.
  void unlock_in_child() noexcept {
    unlock();
    initialise();
  }

 private:
  void initialise() noexcept {
    pthread_mutexattr_t attributes;
    pthread_mutexattr_init(&attributes);
    pthread_mutexattr_settype(&attributes, PTHREAD_MUTEX_ERRORCHECK);
#ifndef O80_WITHOUT_PRIORITY_INHERITANCE
    pthread_mutexattr_setprotocol(&attributes, PTHREAD_PRIO_INHERIT);
#endif
    pthread_mutex_init(&mutex_, &attributes);
    pthread_mutexattr_destroy(&attributes);
  }

  pthread_mutex_t mutex_;
};

}  // namespace o80
