// Stands in front of the library calls that an iteration must not make, and of system calls, and
// counts those of a watched thread.

#include "iteration/interception.hpp"

#include <dlfcn.h>
#include <linux/futex.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <cstdarg>
#include <cstdio>
#include <sstream>
#include <utility>

namespace o80::test {
namespace {

thread_local bool watched = false;
thread_local Calls calls;
thread_local volatile char door = 0;  // what the kernel reads: whether calls are stopped

}  // namespace
}  // namespace o80::test

// ------------------------------------------------------------------------------ library calls

#ifndef O80_SANITIZED

namespace {

using o80::test::Kind;

inline void note(Kind kind, const char* name) noexcept {
  if (!o80::test::watched) return;
  const auto i = static_cast<std::size_t>(kind);
  ++o80::test::calls.of[i];
  o80::test::calls.last[i] = name;
}

/// The function of this name behind ours.
template <class Function>
Function* behind(std::atomic<Function*>& known, const char* name) noexcept {
  Function* function = known.load(std::memory_order_relaxed);
  if (function != nullptr) return function;
  const char was = std::exchange(o80::test::door, 0);
  function = reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
  o80::test::door = was;
  known.store(function, std::memory_order_relaxed);
  return function;
}

}  // namespace

// every argument of these fits a register: six words are handed on, whatever they mean
using Word = std::uintptr_t;
using Words = Word(Word, Word, Word, Word, Word, Word);

#define O80_STAND_BEFORE(id, symbol, kind)                                                        \
  extern "C" Word stands_before_##id(Word a, Word b, Word c, Word d, Word e, Word f) asm(symbol); \
  extern "C" __attribute__((used, visibility("default"))) Word stands_before_##id(                \
      Word a, Word b, Word c, Word d, Word e, Word f) {                                           \
    static constinit std::atomic<Words*> known{nullptr};                                          \
    note(Kind::kind, symbol);                                                                     \
    return behind(known, symbol)(a, b, c, d, e, f);                                               \
  }

// the linker itself calls these before it could look anything up
#define O80_STAND_BEFORE_LIBC(id, symbol)                                                         \
  extern "C" Word libc_##id(Word a, Word b, Word c) asm("__libc_" symbol);                        \
  extern "C" Word stands_before_##id(Word a, Word b, Word c) asm(symbol);                         \
  extern "C" __attribute__((used, visibility("default"))) Word stands_before_##id(Word a, Word b, \
                                                                                  Word c) {       \
    note(Kind::heap, symbol);                                                                     \
    return libc_##id(a, b, c);                                                                    \
  }

// `new` and `delete` come here; so does mapped memory, as a system call
O80_STAND_BEFORE_LIBC(malloc, "malloc")
O80_STAND_BEFORE_LIBC(calloc, "calloc")
O80_STAND_BEFORE_LIBC(realloc, "realloc")
O80_STAND_BEFORE_LIBC(free, "free")
O80_STAND_BEFORE_LIBC(memalign, "memalign")
O80_STAND_BEFORE(aligned_alloc, "aligned_alloc", heap)
O80_STAND_BEFORE(posix_memalign, "posix_memalign", heap)

O80_STAND_BEFORE(mutex_lock, "pthread_mutex_lock", lock)
O80_STAND_BEFORE(mutex_trylock, "pthread_mutex_trylock", lock)
O80_STAND_BEFORE(mutex_timedlock, "pthread_mutex_timedlock", lock)
O80_STAND_BEFORE(mutex_clocklock, "pthread_mutex_clocklock", lock)
O80_STAND_BEFORE(spin_lock, "pthread_spin_lock", lock)
O80_STAND_BEFORE(spin_trylock, "pthread_spin_trylock", lock)
O80_STAND_BEFORE(cond_wait, "pthread_cond_wait", lock)
O80_STAND_BEFORE(cond_timedwait, "pthread_cond_timedwait", lock)
O80_STAND_BEFORE(cond_clockwait, "pthread_cond_clockwait", lock)
O80_STAND_BEFORE(cond_signal, "pthread_cond_signal", lock)
O80_STAND_BEFORE(cond_broadcast, "pthread_cond_broadcast", lock)
O80_STAND_BEFORE(rwlock_rdlock, "pthread_rwlock_rdlock", lock)
O80_STAND_BEFORE(rwlock_wrlock, "pthread_rwlock_wrlock", lock)
O80_STAND_BEFORE(rwlock_tryrdlock, "pthread_rwlock_tryrdlock", lock)
O80_STAND_BEFORE(rwlock_trywrlock, "pthread_rwlock_trywrlock", lock)
O80_STAND_BEFORE(rwlock_timedrdlock, "pthread_rwlock_timedrdlock", lock)
O80_STAND_BEFORE(rwlock_timedwrlock, "pthread_rwlock_timedwrlock", lock)
O80_STAND_BEFORE(barrier_wait, "pthread_barrier_wait", lock)
O80_STAND_BEFORE(once, "pthread_once", lock)
O80_STAND_BEFORE(static_guard, "__cxa_guard_acquire", lock)
O80_STAND_BEFORE(sem_wait, "sem_wait", lock)
O80_STAND_BEFORE(sem_trywait, "sem_trywait", lock)
O80_STAND_BEFORE(sem_timedwait, "sem_timedwait", lock)
O80_STAND_BEFORE(sem_post, "sem_post", lock)

O80_STAND_BEFORE(throw_, "__cxa_throw", exception)
O80_STAND_BEFORE(rethrow, "__cxa_rethrow", exception)
O80_STAND_BEFORE(allocate_exception, "__cxa_allocate_exception", exception)

O80_STAND_BEFORE(puts, "puts", text)
O80_STAND_BEFORE(fputs, "fputs", text)
O80_STAND_BEFORE(fwrite, "fwrite", text)
O80_STAND_BEFORE(strerror, "strerror", text)
O80_STAND_BEFORE(strtod, "strtod", text)
O80_STAND_BEFORE(strtol, "strtol", text)
O80_STAND_BEFORE(vsnprintf, "vsnprintf", text)
O80_STAND_BEFORE(vfprintf, "vfprintf", text)

// those that take any number of arguments
#define O80_STAND_BEFORE_PRINTING(id, symbol, with, last, call)                         \
  extern "C" int stands_before_##id with asm(symbol);                                   \
  extern "C" __attribute__((used, visibility("default"))) int stands_before_##id with { \
    note(Kind::text, symbol);                                                           \
    va_list arguments;                                                                  \
    va_start(arguments, last);                                                          \
    const int length = call;                                                            \
    va_end(arguments);                                                                  \
    return length;                                                                      \
  }
O80_STAND_BEFORE_PRINTING(snprintf, "snprintf",
                          (char* out, std::size_t size, const char* format, ...), format,
                          std::vsnprintf(out, size, format, arguments))
O80_STAND_BEFORE_PRINTING(fprintf, "fprintf", (FILE * file, const char* format, ...), format,
                          std::vfprintf(file, format, arguments))
O80_STAND_BEFORE_PRINTING(printf, "printf", (const char* format, ...), format,
                          std::vfprintf(stdout, format, arguments))

#endif

// ------------------------------------------------------------------------------ system calls

#if defined(__x86_64__) && !defined(O80_SANITIZED)

// The only code from which system calls pass the door: it makes a call for the handler, and leads
// back from it.
extern "C" {
extern const char o80_door_begin[];
extern const char o80_door_end[];
long o80_pass_the_door(long number, long a, long b, long c, long d, long e, long f);
void o80_leave_the_handler();
}
asm(R"(
  .text
  .globl o80_door_begin
o80_door_begin:
  .globl o80_pass_the_door
  .type o80_pass_the_door, @function
o80_pass_the_door:
  movq %rdi, %rax
  movq %rsi, %rdi
  movq %rdx, %rsi
  movq %rcx, %rdx
  movq %r8, %r10
  movq %r9, %r8
  movq 8(%rsp), %r9
  syscall
  ret
  .globl o80_leave_the_handler
  .type o80_leave_the_handler, @function
o80_leave_the_handler:
  movq $15, %rax
  syscall
  ud2
  .globl o80_door_end
o80_door_end:
)");

namespace o80::test {
namespace {

constexpr long kDispatchOn = 1;
constexpr char kStopped = 1;
constexpr std::uint64_t kOwnRestorer = 0x04000000;  // SA_RESTORER

/// sigaction as the kernel knows it.
struct KernelAction {
  void (*handler)(int, siginfo_t*, void*);
  std::uint64_t flags;
  void (*restorer)();
  std::uint64_t mask;
};

void at_the_door(int, siginfo_t*, void* context) {
  greg_t* registers = static_cast<ucontext_t*>(context)->uc_mcontext.gregs;
  const long number = registers[REG_RAX];
  const long operation = registers[REG_RSI] & FUTEX_CMD_MASK;
  ++calls.system[static_cast<std::size_t>(number) % kSystemCalls];
  if (number == SYS_futex) {
    const bool waits = operation == FUTEX_WAIT || operation == FUTEX_WAIT_BITSET;
    ++(waits ? calls.waits : calls.wakes);
  }
  registers[REG_RAX] =
      o80_pass_the_door(number, registers[REG_RDI], registers[REG_RSI], registers[REG_RDX],
                        registers[REG_R10], registers[REG_R8], registers[REG_R9]);
}

bool place_a_doorkeeper() {
  const KernelAction action{at_the_door, SA_SIGINFO | kOwnRestorer | SA_NODEFER,
                            o80_leave_the_handler, 0};
  return syscall(SYS_rt_sigaction, SIGSYS, &action, nullptr, 8) == 0;
}

bool close_the_door() noexcept {
  static const bool kept = place_a_doorkeeper();
  const auto begin = reinterpret_cast<unsigned long>(o80_door_begin);
  const auto end = reinterpret_cast<unsigned long>(o80_door_end);
  if (!kept || prctl(PR_SET_SYSCALL_USER_DISPATCH, kDispatchOn, begin, end - begin, &door) != 0) {
    return false;
  }
  door = kStopped;
  return true;
}

void open_the_door() noexcept {
  door = 0;
  prctl(PR_SET_SYSCALL_USER_DISPATCH, 0, 0, 0, 0);
}

}  // namespace
}  // namespace o80::test

#else

namespace o80::test {
namespace {
bool close_the_door() noexcept { return false; }
void open_the_door() noexcept {}
}  // namespace
}  // namespace o80::test

#endif

// ------------------------------------------------------------------------------ the account

namespace o80::test {

std::uint32_t Calls::system_calls() const {
  std::uint32_t sum = 0;
  for (const std::uint32_t count : system) sum += count;
  return sum;
}

std::string Calls::text() const {
  std::ostringstream out;
  for (std::size_t i = 0; i < kKinds; ++i) {
    if (of[i] > 0) out << of[i] << " like " << last[i] << "; ";
  }
  for (std::size_t i = 0; i < kSystemCalls; ++i) {
    if (system[i] > 0) out << system[i] << " times system call " << i << "; ";
  }
  if (wakes + waits > 0) out << "futex: " << wakes << " wakes, " << waits << " waits";
  return out.str();
}

Calls operator-(const Calls& later, const Calls& earlier) {
  Calls between = later;
  for (std::size_t i = 0; i < kKinds; ++i) between.of[i] -= earlier.of[i];
  for (std::size_t i = 0; i < kSystemCalls; ++i) between.system[i] -= earlier.system[i];
  between.wakes -= earlier.wakes;
  between.waits -= earlier.waits;
  return between;
}

const Calls& calls_so_far() noexcept { return calls; }

Watched::Watched() noexcept {
  close_the_door();
  watched = true;
}

Watched::~Watched() {
  watched = false;
  open_the_door();
}

bool system_calls_are_counted() {
  const bool closed = close_the_door();
  open_the_door();
  return closed;
}

}  // namespace o80::test
