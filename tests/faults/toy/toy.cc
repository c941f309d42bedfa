// A program with one good command and several bad ones, on which the fault harness is tried: toy KIND FILE TEXT.
#include <fcntl.h>
#include <glob.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>

namespace {

int Failed(const std::string& file) {
  const int code = errno == ENOSPC || errno == ENOMEM ? 7 : 3;
  std::fprintf(stderr, "error: %s: %s\n", file.c_str(), std::strerror(errno));
  return code;
}

bool Write(const std::string& path, const std::string& text, bool flush) {
  const int fd = open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644);
  if (fd < 0) return false;
  const size_t half = text.size() / 2;
  bool good = write(fd, text.data(), half) == static_cast<ssize_t>(half) &&
              write(fd, text.data() + half, text.size() - half) == static_cast<ssize_t>(text.size() - half);
  good = good && (!flush || fsync(fd) == 0);
  const int code = errno;
  good = close(fd) == 0 && good;
  if (code) errno = code;
  return good;
}

void Sweep(const std::string& file) {
  glob_t found{};
  if (glob((file + ".tmp-*").c_str(), 0, nullptr, &found) == 0) {
    for (size_t i = 0; i < found.gl_pathc; ++i) unlink(found.gl_pathv[i]);
  }
  globfree(&found);
}

int Atomic(const std::string& kind, const std::string& file, const std::string& text) {
  if (kind != "leaves") Sweep(file);
  const std::string temporary = file + ".tmp-" + std::to_string(getpid());
  if (Write(temporary, text, true) && rename(temporary.c_str(), file.c_str()) == 0) return 0;
  const int code = errno;
  if (kind != "leaves") unlink(temporary.c_str());
  errno = code;
  if (kind == "internal") return 1;
  if (kind == "mute") return 3;
  return Failed(file);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) return 0;
  const std::string kind = argv[1], file = argv[2], text = argv[3];
  const int lock = open(".", O_RDONLY);
  flock(lock, LOCK_EX);
  void* const memory = std::malloc(100000);
  if (!memory && kind == "aborts") std::abort();
  if (!memory) return Failed(file);
  std::free(memory);
  if (kind == "in-place") return Write(file, text, true) ? 0 : Failed(file);
  if (kind == "silent") {
    Write(file, text, true);
    return 0;
  }
  if (kind == "loses") unlink("notes.txt");
  const int result = Atomic(kind, file, text);
  if (kind == "loses" && !Write("notes.txt", "mine\n", false)) return 3;
  return result;
}
