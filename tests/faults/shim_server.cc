// The fault library as a server: the program is loaded once and copied for every run.
#include <fcntl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>

#include "tests/faults/shim.h"

namespace shim {
namespace {

bool Receive(int socket, void* data, size_t size) {
  for (char* at = static_cast<char*>(data); size;) {
    const ssize_t got = recv(socket, at, size, 0);
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) return false;
    at += got;
    size -= static_cast<size_t>(got);
  }
  return true;
}

void Send(int socket, int32_t value) {
  if (send(socket, &value, sizeof value, MSG_NOSIGNAL) != sizeof value) _exit(125);
}

void Redirect(const char* path, int fd, int flags) {
  const int opened = open(path, flags, 0644);
  if (opened < 0 || dup2(opened, fd) != fd) _exit(126);
  close(opened);
}

// A request is: folder, stdout, stderr, number of arguments, arguments, environment; each ends with a zero byte. The result is
// the block of pointers that a program finds on its stack: arguments, null, environment, null.
char** BecomeRequested(char* text, const char* end, int& argc) {
  const auto next = [&text] {
    char* const word = text;
    text += std::strlen(text) + 1;
    return word;
  };
  setpgid(0, 0);
  if (chdir(next()) != 0) _exit(126);
  Redirect("/dev/null", 0, O_RDONLY);
  Redirect(next(), 1, O_WRONLY | O_CREAT | O_TRUNC);
  Redirect(next(), 2, O_WRONLY | O_CREAT | O_TRUNC);
  argc = std::atoi(next());
  size_t words = 0;
  for (const char* at = text; at < end; at += std::strlen(at) + 1) ++words;
  auto** const block = static_cast<char**>(std::calloc(words + 2, sizeof(char*)));
  size_t used = 0;
  for (int i = 0; i < argc; ++i) block[used++] = next();
  for (++used; text < end;) block[used++] = next();
  return block;
}

}  // namespace

char** Serve(int socket, int& argc) {
  for (;;) {
    uint32_t size = 0;
    if (!Receive(socket, &size, sizeof size)) _exit(0);
    char* const text = static_cast<char*>(std::calloc(size + 1, 1));
    if (!Receive(socket, text, size)) _exit(0);
    const pid_t child = fork();
    if (child == 0) {
      close(socket);
      return BecomeRequested(text, text + size, argc);
    }
    std::free(text);
    Send(socket, child);
    int status = 0;
    while (waitpid(child, &status, 0) < 0 && errno == EINTR) continue;
    Send(socket, status);
  }
}

}  // namespace shim

extern "C" {

using MainFunction = int (*)(int, char**, char**);
int Shim___libc_start_main(MainFunction main, int argc, char** argv, void (*init)(), void (*fini)(), void (*end)(), void* stack)
    NAMED(__libc_start_main);
int Shim___libc_start_main(MainFunction main, int argc, char** argv, void (*init)(), void (*fini)(), void (*end)(),
                           void* stack) {
  const auto real = REAL(__libc_start_main);
  if (const char* socket = std::getenv("MVS_FAULT_SERVER")) {
    argv = shim::Serve(std::atoi(socket), argc);
    environ = argv + argc + 1;
  }
  shim::Configure();
  return real(main, argc, argv, init, fini, end, stack);
}

}  // extern "C"
