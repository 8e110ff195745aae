#pragma once

#include <pthread.h>

namespace o80 {

/// Neither movable nor copyable: a mutex with priority inheritance. Its holder gets the highest
/// priority of the threads that wait for it, so that ordinary threads cannot delay a real-time
/// thread that waits.
class InheritingMutex {
 public:
  InheritingMutex() noexcept { initialise(); }
  InheritingMutex& operator=(InheritingMutex&&) = delete;
  ~InheritingMutex() { pthread_mutex_destroy(&mutex_); }

  void lock() noexcept { pthread_mutex_lock(&mutex_); }
  void unlock() noexcept { pthread_mutex_unlock(&mutex_); }
  /// Unlocks it in a forked child. Its only thread does not hold the mutex, so unlock() is refused
  /// without a system call (error-checking mutex); then the mutex is initialised anew. The call of
  /// unlock() informs tools such as the thread sanitizer.
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
