#include "avatar/body/makehuman/target.h"

#include <archive.h>

#include <memory>

#include "avatar/body/makehuman/number_words.h"

namespace mvstudio::body {
namespace {

struct FreeReader {
  void operator()(archive* a) const { archive_read_free(a); }
};

}  // namespace

Eigen::Matrix3Xd ParseTarget(const std::string& text, const std::string& path, int num_vertices) {
  Eigen::Matrix3Xd moved = Eigen::Matrix3Xd::Zero(3, num_vertices);
  std::string_view rest = text;
  for (int number = 1; !rest.empty(); ++number) {
    const std::string where = "line " + std::to_string(number);
    const std::vector<std::string_view> words = internal::Words(internal::TakeLine(&rest));
    if (words.empty() || words[0][0] == '#') continue;
    if (words.size() != 4) throw FormatError(path, where, "must be a vertex and its displacement");
    const int vertex = internal::IndexOf(words[0], 0, num_vertices - 1, path, where);
    for (int k = 0; k < 3; ++k) moved(k, vertex) = internal::NumberOf(words[k + 1], path, where);
  }
  return moved;
}

std::string Gunzip(const std::string& bytes, const std::string& path, size_t max_bytes) {
  const std::unique_ptr<archive, FreeReader> reader(archive_read_new());
  archive_read_support_filter_gzip(reader.get());
  archive_read_support_format_raw(reader.get());
  archive_read_support_format_empty(reader.get());
  archive_entry* entry = nullptr;
  if (archive_read_open_memory(reader.get(), bytes.data(), bytes.size()) != ARCHIVE_OK)
    throw FormatError(path, "", "is no gzipped file");
  const int status = archive_read_next_header(reader.get(), &entry);
  const bool gzipped =
      bytes.compare(0, 2, "\x1f\x8b") == 0 &&
      (status == ARCHIVE_EOF || (status == ARCHIVE_OK && archive_filter_code(reader.get(), 0) == ARCHIVE_FILTER_GZIP));
  if (!gzipped) throw FormatError(path, "", "is no gzipped file");
  if (status == ARCHIVE_EOF) return "";  // of nothing
  std::string text;
  std::string piece(1 << 16, '\0');
  for (;;) {
    const la_ssize_t size = archive_read_data(reader.get(), piece.data(), piece.size());
    if (size < 0) throw FormatError(path, "", "is damaged");
    if (size == 0) return text;
    if (static_cast<size_t>(size) > max_bytes - text.size())
      throw FormatError(path, "", "unpacks to more than " + std::to_string(max_bytes) + " bytes");
    text.append(piece, 0, static_cast<size_t>(size));
  }
}

}  // namespace mvstudio::body
