#pragma once

#include <string>

namespace o80 {

/// Tells the service manager that started this process how it is ("READY=1\nSTATUS=..."): the
/// protocol of sd_notify, as systemd documents it. Nothing happens without NOTIFY_SOCKET.
///
/// Realtime: no.
void tell_service_manager(const std::string& state) noexcept;

}  // namespace o80
