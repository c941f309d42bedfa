#pragma once

#include <string>

namespace mvstudio {

/// The content of a file in pieces, for files larger than what is kept of them. Accepts and refuses what ReadFile does; of a
/// pipe the first piece is all.
class FilePieces {
 public:
  explicit FilePieces(const std::string& path);
  ~FilePieces();
  FilePieces(const FilePieces&) = delete;
  FilePieces& operator=(const FilePieces&) = delete;

  /// Appends what comes next, at least 1 MiB and as much as `text` holds unless the file ends before. False: nothing came, the
  /// file has ended. Throws IoError.
  bool Append(std::string* text);

 private:
  std::string path_, whole_;
  int fd_ = -1;
};

}  // namespace mvstudio
