#include "core/disk/pieces.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>

#include "core/disk/files.h"
#include "core/disk/system_calls.h"

namespace mvstudio {

FilePieces::FilePieces(const std::string& path) : path_(path) {
  struct stat info {};
  if (stat(path.c_str(), &info) != 0 || !S_ISREG(info.st_mode)) {
    whole_ = ReadFile(path);
    return;
  }
  fd_ = open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY);
  if (fd_ < 0) internal::ThrowErrno(path, "cannot open", errno);
}

FilePieces::~FilePieces() {
  if (fd_ >= 0) close(fd_);
}

bool FilePieces::Append(std::string* text) {
  constexpr size_t kLeastBytes = 1 << 20;
  const size_t before = text->size();
  if (fd_ < 0) {
    text->append(whole_);
    whole_ = std::string();
    return text->size() > before;
  }
  size_t have = before;
  text->resize(before + std::max(kLeastBytes, before));
  while (have < text->size()) {
    const ssize_t got = read(fd_, text->data() + have, text->size() - have);
    if (got < 0 && errno != EINTR) internal::ThrowErrno(path_, "cannot read", errno);
    if (got == 0) break;
    have += static_cast<size_t>(std::max<ssize_t>(got, 0));
  }
  text->resize(have);
  return have > before;
}

}  // namespace mvstudio
