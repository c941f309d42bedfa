#include "dataset/arrays/npz.h"

#include <archive.h>
#include <archive_entry.h>

#include <memory>
#include <optional>

#include "core/disk/files.h"
#include "core/disk/npy.h"
#include "core/error.h"

namespace mvstudio::dataset {
namespace {

constexpr size_t kMaxMembers = 10000, kMaxNameBytes = 1000;

struct FreeReader {
  void operator()(archive* a) const { archive_read_free(a); }
};
using ZipReader = std::unique_ptr<archive, FreeReader>;

[[noreturn]] void Refuse(const std::string& path, const std::string& where, archive* reader, const std::string& what) {
  const char* why = archive_error_string(reader);
  throw FormatError(path, where, what + (why ? std::string(": ") + why : ""));
}

/// The reader that begins with the directory at the end: what is cut short has none.
ZipReader OpenZip(const std::string& bytes, const std::string& path) {
  ZipReader reader(archive_read_new());
  if (!reader) throw ResourceError(path + ": no memory to read it");
  archive_read_support_format_zip_seekable(reader.get());
  if (archive_read_open_memory(reader.get(), bytes.data(), bytes.size()) != ARCHIVE_OK)
    Refuse(path, "", reader.get(), "is no .npz archive");
  return reader;
}

/// `told` bytes by the archive's directory, or unknown; what is not that long is damaged. The header is looked at before the
/// rest is unpacked.
std::string ReadMember(archive* reader, const std::string& path, const std::string& name, std::optional<uint64_t> told,
                       size_t max_bytes) {
  std::string content;
  const void* piece = nullptr;
  size_t size = 0;
  la_int64_t offset = 0;
  int status = ARCHIVE_OK;
  while ((status = archive_read_data_block(reader, &piece, &size, &offset)) == ARCHIVE_OK) {
    if (offset < 0 || static_cast<size_t>(offset) != content.size()) throw FormatError(path, name, "has holes");
    if (size > max_bytes - content.size()) throw FormatError(path, name, "is too large");
    const bool first = content.empty();
    content.append(static_cast<const char*>(piece), size);
    if (first && told && NpyFileBytes(content).value_or(0) > *told)
      throw FormatError(path, name + ": shape", "promises more than the " + std::to_string(*told) + " bytes that it has");
  }
  if (status != ARCHIVE_EOF) Refuse(path, name, reader, "is damaged");
  return content;
}

/// Name of the array; throws FormatError where the member is no plain `.npy` file.
std::string ArrayName(archive_entry* entry, const std::string& path) {
  const char* text = archive_entry_pathname(entry);
  const std::string name = text ? text : "";
  if (name.empty() || name.size() > kMaxNameBytes) throw FormatError(path, "", "a member has no name or a very long one");
  if (archive_entry_filetype(entry) != AE_IFREG) throw FormatError(path, name, "is no plain file");
  if (name.size() < 5 || name.compare(name.size() - 4, 4, ".npy") != 0) throw FormatError(path, name, "is no .npy file");
  return name.substr(0, name.size() - 4);
}

/// "body.npz: vertices", as the path of a member in errors.
std::string PlaceOf(const std::string& path, const std::string& name) { return path + ": " + name; }

}  // namespace

std::map<std::string, std::string> ParseNpzMembers(const std::string& bytes, const std::string& path, size_t max_bytes) {
  const ZipReader reader = OpenZip(bytes, path);
  std::map<std::string, std::string> members;
  size_t total = 0;
  archive_entry* entry = nullptr;
  for (;;) {
    const int status = archive_read_next_header(reader.get(), &entry);
    if (status == ARCHIVE_EOF) break;
    if (status != ARCHIVE_OK) Refuse(path, "", reader.get(), "is a damaged .npz archive");
    const std::string name = ArrayName(entry, path);
    if (members.size() >= kMaxMembers) throw FormatError(path, name, "is one array too many");
    if (members.count(name)) throw FormatError(path, name, "is there twice");
    const bool knows = archive_entry_size_is_set(entry) && archive_entry_size(entry) >= 0;
    const auto told = knows ? std::optional<uint64_t>(archive_entry_size(entry)) : std::nullopt;
    if (told && OutOfProportion(total + *told, bytes.size()))
      throw FormatError(path, name,
                        "unpacks to " + std::to_string(*told) + " bytes, out of all proportion to the file's " +
                            std::to_string(bytes.size()) + "; refused");
    std::string content = ReadMember(reader.get(), path, name, told, max_bytes - total);
    total += content.size();
    members.emplace(name, std::move(content));
  }
  return members;
}

std::map<std::string, std::string> ReadNpzMembers(const std::string& path, size_t max_bytes) {
  return ParseNpzMembers(ReadFile(path), path, max_bytes);
}

std::map<std::string, NpyArray> ParseNpz(const std::string& bytes, const std::string& path) {
  std::map<std::string, NpyArray> arrays;
  for (const auto& [name, content] : ParseNpzMembers(bytes, path)) arrays.emplace(name, ParseNpy(content, PlaceOf(path, name)));
  return arrays;
}

std::map<std::string, NpyArray> ReadNpz(const std::string& path) { return ParseNpz(ReadFile(path), path); }

}  // namespace mvstudio::dataset
