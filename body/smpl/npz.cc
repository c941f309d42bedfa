#include <archive.h>
#include <archive_entry.h>

#include <algorithm>
#include <memory>

#include "body/smpl/npz_internal.h"
#include "core/error.h"

namespace mvstudio::body::internal {
namespace {

struct FreeZip {
  void operator()(archive* a) const { archive_read_free(a); }
};

std::string ReadMember(archive* zip, const std::string& path, const std::string& name) {
  constexpr size_t kMostBytes = size_t{1} << 30;
  std::string content, piece(1 << 16, '\0');
  for (;;) {
    const la_ssize_t size = archive_read_data(zip, piece.data(), piece.size());
    if (size < 0) throw FormatError(path, name, "is damaged");
    if (size == 0) return content;
    if (static_cast<size_t>(size) > kMostBytes - content.size()) throw FormatError(path, name, "is larger than 1 GiB");
    content.append(piece, 0, static_cast<size_t>(size));
  }
}

}  // namespace

std::map<std::string, NpyArray> ArraysFromNpz(const std::string& bytes, const std::string& path,
                                              const std::vector<std::string>& names) {
  constexpr int kMostMembers = 10000;
  const std::unique_ptr<archive, FreeZip> zip(archive_read_new());
  archive_read_support_format_zip(zip.get());
  if (archive_read_open_memory(zip.get(), bytes.data(), bytes.size()) != ARCHIVE_OK)
    throw FormatError(path, "", "is no .npz file");
  std::map<std::string, NpyArray> arrays;
  archive_entry* entry = nullptr;
  for (int count = 0;; ++count) {
    const int status = archive_read_next_header(zip.get(), &entry);
    if (status == ARCHIVE_EOF) return arrays;
    if (status != ARCHIVE_OK) throw FormatError(path, "", "is damaged or no .npz file");
    if (count >= kMostMembers) throw FormatError(path, "", "has too many members");
    const char* const text = archive_entry_pathname(entry);
    const std::string member = text ? text : "";
    const auto wanted = [&member](const std::string& name) { return member == name + ".npy"; };
    const auto found = std::find_if(names.begin(), names.end(), wanted);
    if (found == names.end()) continue;
    if (arrays.count(*found)) throw FormatError(path, member, "is there twice");
    arrays[*found] = ParseNpy(ReadMember(zip.get(), path, member), path + ": " + member);
  }
}

}  // namespace mvstudio::body::internal
