#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <string>

namespace udp_arm {

/// The clock that `due` is on: CLOCK_MONOTONIC, which is std::chrono::steady_clock [ns].
inline std::int64_t now() noexcept {
  return std::chrono::nanoseconds(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/// A UDP socket. Move-only by its descriptor; nothing here blocks but `wait_until`.
class UdpSocket {
 public:
  UdpSocket() = default;
  UdpSocket(const UdpSocket&) = delete;
  UdpSocket& operator=(const UdpSocket&) = delete;
  ~UdpSocket() { close(); }

  /// Sends to this peer and hears nobody else. Throws std::runtime_error.
  void connect(const std::string& address, int port) {
    open();
    const sockaddr_in peer = place(address, port);
    check(::connect(descriptor_, reinterpret_cast<const sockaddr*>(&peer), sizeof peer),
          "cannot reach " + address);
  }
  /// Hears everybody at a port, 0 for any that is free. Throws std::runtime_error.
  void bind(const std::string& address, int port) {
    open();
    const sockaddr_in own = place(address, port);
    check(::bind(descriptor_, reinterpret_cast<const sockaddr*>(&own), sizeof own),
          "cannot listen on port " + std::to_string(port));
  }
  void close() noexcept {
    if (descriptor_ >= 0) ::close(descriptor_);
    descriptor_ = -1;
  }
  int port() const {
    sockaddr_in own{};
    socklen_t size = sizeof own;
    check(getsockname(descriptor_, reinterpret_cast<sockaddr*>(&own), &size), "no port");
    return ntohs(own.sin_port);
  }

  /// One datagram to the peer; false if it certainly did not leave.
  template <class Packet>
  bool send(const Packet& packet) const noexcept {
    return ::send(descriptor_, &packet, sizeof packet, MSG_DONTWAIT | MSG_NOSIGNAL) ==
           sizeof packet;
  }
  template <class Packet>
  bool send_to(const Packet& packet, const sockaddr_in& peer) const noexcept {
    return ::sendto(descriptor_, &packet, sizeof packet, MSG_DONTWAIT | MSG_NOSIGNAL,
                    reinterpret_cast<const sockaddr*>(&peer), sizeof peer) == sizeof packet;
  }
  enum class Received { packet, garbage, nothing };
  /// The next datagram that has arrived. One of another size or version is garbage.
  template <class Packet>
  Received receive(Packet& packet, sockaddr_in* sender = nullptr) const noexcept {
    Packet arrived;
    sockaddr_in from{};
    socklen_t size = sizeof from;
    // MSG_TRUNC: the true size, also of a datagram that is too long
    const ssize_t got = recvfrom(descriptor_, &arrived, sizeof arrived, MSG_DONTWAIT | MSG_TRUNC,
                                 reinterpret_cast<sockaddr*>(&from), &size);
    if (got < 0) return errno == ECONNREFUSED ? Received::garbage : Received::nothing;
    if (got != sizeof arrived || arrived.magic != packet.magic) return Received::garbage;
    packet = arrived;
    if (sender != nullptr) *sender = from;
    return Received::packet;
  }
  /// Sleeps until something may have arrived; false at a moment of the monotonic clock [ns].
  bool wait_until(std::int64_t deadline) const noexcept {
    pollfd wanted{descriptor_, POLLIN, 0};
    while (true) {
      const std::int64_t left = deadline - now();
      const std::int64_t sleep = left > 0 ? left : 0;
      const timespec timeout{sleep / 1'000'000'000, sleep % 1'000'000'000};
      const int ready = ppoll(&wanted, 1, &timeout, nullptr);
      if (ready > 0) return true;
      if (left <= 0 || (ready < 0 && errno != EINTR)) return false;
    }
  }

 private:
  void open() {
    close();
    descriptor_ = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    check(descriptor_, "no socket");
  }
  static sockaddr_in place(const std::string& address, int port) {
    sockaddr_in place{};
    place.sin_family = AF_INET;
    place.sin_port = htons(static_cast<std::uint16_t>(port));
    if (port < 0 || port > 65535 || inet_pton(AF_INET, address.c_str(), &place.sin_addr) != 1) {
      throw std::runtime_error("'" + address + "' port " + std::to_string(port) +
                               " is not an address: give four numbers such as 192.168.0.7");
    }
    return place;
  }
  static void check(int result, const std::string& what) {
    if (result < 0) throw std::runtime_error(what + " (" + std::strerror(errno) + ")");
  }

  int descriptor_ = -1;
};

}  // namespace udp_arm
