#pragma once

#include <string>

namespace o80 {

/// Sends a state ("READY=1\nSTATUS=...") to the service manager that started this process, by the
/// protocol of sd_notify (systemd). No effect without NOTIFY_SOCKET.
///
/// Realtime: no.
void notify_service_manager(const std::string& state) noexcept;

}  // namespace o80
