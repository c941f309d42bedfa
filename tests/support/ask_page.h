#pragma once

#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

#include <string>

/// Bare sockets to a page of this machine.
namespace mvstudio::testing {

/// A connection to 127.0.0.1:`port` that has sent `request`; -1 when nobody listens.
inline int Connected(int port, const std::string& request) {
  const int fd = socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in place{};
  place.sin_family = AF_INET, place.sin_port = htons(static_cast<uint16_t>(port)),
  place.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  if (connect(fd, reinterpret_cast<sockaddr*>(&place), sizeof place) == 0 &&
      send(fd, request.data(), request.size(), MSG_NOSIGNAL) == static_cast<ssize_t>(request.size()))
    return fd;
  close(fd);
  return -1;
}

/// The whole answer; empty when nobody listens.
inline std::string Ask(int port, const std::string& request) {
  const int fd = Connected(port, request);
  std::string answer;
  char bytes[4096];
  for (ssize_t got; fd >= 0 && (got = recv(fd, bytes, sizeof bytes, 0)) > 0;) answer.append(bytes, static_cast<size_t>(got));
  if (fd >= 0) close(fd);
  return answer;
}

}  // namespace mvstudio::testing
