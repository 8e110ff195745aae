#pragma once

namespace o80 {

/// Commands that raise a limit of the machine. `o80 run` names them when the machine refuses a
/// setting, `o80 doctor` before.
struct MachineLimit {
  const char* at_once;   // for the shell in which it is typed
  const char* for_good;  // from the next login on
  const char* undo;
};

inline constexpr MachineLimit kPriorityLimit{
    .at_once = "sudo prlimit --pid $$ --rtprio=99",
    .for_good = R"(echo "$USER - rtprio 99" | sudo tee /etc/security/limits.d/o80-rtprio.conf)",
    .undo = "sudo rm /etc/security/limits.d/o80-rtprio.conf"};

inline constexpr MachineLimit kMemoryLimit{
    .at_once = "sudo prlimit --pid $$ --memlock=unlimited",
    .for_good =
        R"(echo "$USER - memlock unlimited" | sudo tee /etc/security/limits.d/o80-memlock.conf)",
    .undo = "sudo rm /etc/security/limits.d/o80-memlock.conf"};

}  // namespace o80
