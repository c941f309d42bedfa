#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <optional>
#include <set>
#include <sstream>
#include <tuple>

#include "calib/corners/corner_readers.h"
#include "calib/corners/detection_builder.h"
#include "calib/formats/format_text.h"
#include "core/disk/files.h"
#include "core/error.h"

namespace mvstudio::calib::internal {
namespace {

/// A run of digits [begin, end) of a text.
struct Digits {
  size_t begin = 0, end = 0;
};

bool IsDigit(char c) { return c >= '0' && c <= '9'; }

/// The last run of digits that does not touch [skip.begin, skip.end).
std::optional<Digits> LastDigits(const std::string& text, Digits skip = {}) {
  for (size_t end = text.size(); end > 0; --end) {
    if (!IsDigit(text[end - 1])) continue;
    size_t begin = end;
    while (begin > 0 && IsDigit(text[begin - 1])) --begin;
    if (end <= skip.begin || begin >= skip.end) return Digits{begin, end};
    end = begin + 1;
  }
  return std::nullopt;
}

/// "cam0", "camera-3", "Cam_12" within a file name.
std::optional<Digits> CameraWord(const std::string& stem) {
  std::string lower = stem;
  for (char& c : lower) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  for (size_t at = lower.find("cam"); at != std::string::npos; at = lower.find("cam", at + 1)) {
    size_t end = at + (lower.compare(at, 6, "camera") == 0 ? 6 : 3);
    if (end < lower.size() && (lower[end] == '-' || lower[end] == '_')) ++end;
    const size_t digits = end;
    while (end < lower.size() && IsDigit(lower[end])) ++end;
    if (end > digits) return Digits{at, end};
  }
  return std::nullopt;
}

struct ImageName {
  std::string camera;
  int64_t frame = 0;
};

std::optional<int64_t> ToFrame(const std::string& text, const std::optional<Digits>& digits) {
  if (!digits || digits->end - digits->begin > 15) return std::nullopt;
  return std::stoll(text.substr(digits->begin, digits->end - digits->begin));
}

/// cam0-0000.jpg, frame12-cam3.png, left/0001.png, 0012/cam3.png.
std::optional<ImageName> ParseImageName(const std::string& name) {
  const std::filesystem::path path(name);
  const std::string stem = path.stem().string(), folder = path.parent_path().filename().string();
  if (const auto word = CameraWord(stem)) {
    const std::string camera = stem.substr(word->begin, word->end - word->begin);
    if (const auto frame = ToFrame(stem, LastDigits(stem, *word))) return ImageName{camera, *frame};
    if (const auto frame = ToFrame(folder, LastDigits(folder))) return ImageName{camera, *frame};
    return std::nullopt;
  }
  const auto digits = LastDigits(stem);
  const auto frame = ToFrame(stem, digits);
  if (!frame) return std::nullopt;
  std::string camera = stem.substr(0, digits->begin);
  while (!camera.empty() && (camera.back() == '-' || camera.back() == '_' || camera.back() == '.')) camera.pop_back();
  if (camera.empty()) camera = folder;
  return ImageName{camera.empty() ? "camera" : camera, *frame};
}

std::optional<ImageName> MatchPattern(const ImagePattern& pattern, const std::string& name) {
  const size_t fixed = pattern.prefix.size() + pattern.suffix.size();
  if (name.size() <= fixed || name.compare(0, pattern.prefix.size(), pattern.prefix) != 0 ||
      name.compare(name.size() - pattern.suffix.size(), pattern.suffix.size(), pattern.suffix) != 0) {
    return std::nullopt;
  }
  const std::string middle = name.substr(pattern.prefix.size(), name.size() - fixed);
  const auto frame = ToFrame(middle, LastDigits(middle));
  return frame ? std::optional<ImageName>(ImageName{pattern.camera, *frame}) : std::nullopt;
}

/// Empty when the image belongs to no requested camera.
std::optional<ImageName> Resolve(const std::vector<ImagePattern>& patterns, const std::string& name, const Place& place) {
  if (patterns.empty()) {
    if (auto parsed = ParseImageName(name)) return parsed;
    throw FormatError(place.path, place.where,
                      "no frame number in the image name '" + Printable(name) +
                          "'; say which part it is with option 'corners-camera' NAME=PATTERN, e.g. left=left*.jpg");
  }
  const std::string file = std::filesystem::path(name).filename().string();
  for (const ImagePattern& pattern : patterns) {
    if (auto matched = MatchPattern(pattern, name)) return matched;
    if (auto matched = MatchPattern(pattern, file)) return matched;
  }
  return std::nullopt;
}

struct Row {
  int line = 0;
  std::vector<std::string> cells;
};

struct VnlImage {
  std::string name;
  std::vector<Row> rows;
};

struct VnlTable {
  int x = 1, y = 2, extra = -1;  ///< columns; `extra` is the level or the weight
  bool is_weight = false;
  size_t num_columns = 0;
  std::vector<VnlImage> images;

  auto Columns() const { return std::tie(x, y, extra, is_weight, num_columns); }
};

std::vector<std::string> Words(const std::string& line) {
  std::istringstream in(line);
  std::vector<std::string> words;
  for (std::string word; in >> word;) words.push_back(word);
  return words;
}

/// Columns from the legend `# filename x y level`. Files put together have several: they must agree.
void ReadLegend(const std::vector<std::string>& words, const Place& place, VnlTable* table) {
  const auto position = [&](const char* name) {
    const auto found = std::find(words.begin(), words.end(), name);
    return found == words.end() ? -1 : static_cast<int>(found - words.begin());
  };
  if (position("filename") != 0 || position("x") < 0 || position("y") < 0) return;
  VnlTable legend;
  legend.x = position("x"), legend.y = position("y");
  legend.is_weight = position("weight") > 0;
  legend.extra = legend.is_weight ? position("weight") : position("level");
  legend.num_columns = words.size();
  if (!table->images.empty() && legend.Columns() != table->Columns()) {
    throw FormatError(place.path, place.where, "this legend contradicts the rows above it");
  }
  std::swap(legend.images, table->images);
  *table = std::move(legend);
}

VnlTable ReadTable(const std::string& path) {
  std::istringstream lines(ReadFile(path));
  VnlTable table;
  std::string line;
  std::set<std::string> names;
  for (int number = 1; std::getline(lines, line); ++number) {
    const size_t comment = line.find('#');
    if (comment != std::string::npos && line.find_first_not_of(" \t") == comment) {
      ReadLegend(Words(line.substr(comment + 1)), {path, "line " + std::to_string(number)}, &table);
      continue;
    }
    std::vector<std::string> cells = Words(line);
    if (cells.empty()) continue;
    if (table.num_columns == 0) {
      table.num_columns = cells.size();
      if (cells.size() >= 4) table.extra = 3;
    }
    const std::string where = "line " + std::to_string(number);
    if (cells.size() != table.num_columns || cells.size() < 3) {
      throw FormatError(path, where, std::to_string(cells.size()) + " columns; 'filename x y [level or weight]' was expected");
    }
    if (table.images.empty() || table.images.back().name != cells[0]) {
      if (!names.insert(cells[0]).second)
        throw FormatError(path, where, "the rows of image '" + Printable(cells[0]) + "' are not together");
      table.images.push_back({cells[0], {}});
    }
    table.images.back().rows.push_back({number, std::move(cells)});
  }
  return table;
}

/// Standard deviation of a corner; nothing when the row stands for a corner that was not found.
std::optional<double> SigmaOf(const VnlTable& table, const Row& row, const std::string& path) {
  const auto cell = [&](int column) -> const std::string& { return row.cells[static_cast<size_t>(column)]; };
  if (cell(table.x) == "-" || cell(table.y) == "-") return std::nullopt;
  if (table.extra < 0) return 1.0;
  if (cell(table.extra) == "-") return std::nullopt;
  const double value = ParseNumber(cell(table.extra), {path, "line " + std::to_string(row.line)});
  if (table.is_weight) return value > 0 ? std::optional<double>(1 / value) : std::nullopt;
  return value >= 0 ? std::optional<double>(std::exp2(value)) : std::nullopt;
}

bool IsEmpty(const VnlTable& table, const VnlImage& image) {
  return image.rows.size() == 1 && image.rows[0].cells[static_cast<size_t>(table.x)] == "-";
}

}  // namespace

CornerFile ReadVnl(const std::string& path, const CornerFileOptions& options) {
  if (!options.board) {
    throw UsageError(path + ": this corner file does not say what the board is; give option 'board', e.g. grid:10x10:77mm");
  }
  const auto num_corners = static_cast<size_t>(options.board->num_side_corners());
  const std::vector<ImagePattern>& patterns = options.cameras;
  const VnlTable table = ReadTable(path);
  DetectionBuilder builder(path);
  for (const ImagePattern& pattern : patterns) builder.Camera(pattern.camera);
  size_t num_foreign = 0;
  for (const VnlImage& image : table.images) {
    if (IsEmpty(table, image)) continue;
    const std::string where = "line " + std::to_string(image.rows[0].line);
    const auto name = Resolve(patterns, image.name, {path, where});
    num_foreign += !name;
    if (!name) continue;
    if (image.rows.size() != num_corners) {
      throw FormatError(path, where,
                        "image '" + Printable(image.name) + "' has " + std::to_string(image.rows.size()) +
                            " corners, the board " + std::to_string(num_corners));
    }
    const int camera = builder.Camera(name->camera);
    for (size_t i = 0; i < num_corners; ++i) {
      const Row& row = image.rows[i];
      const auto sigma = SigmaOf(table, row, path);
      if (!sigma) continue;
      const Place place{path, "line " + std::to_string(row.line)};
      const Eigen::Vector2d px(ParseNumber(row.cells[static_cast<size_t>(table.x)], place),
                               ParseNumber(row.cells[static_cast<size_t>(table.y)], place));
      builder.Add(camera, name->frame, 0, static_cast<int>(i), px, *sigma, place.where);
    }
  }
  CornerFile file;
  file.boards = {*options.board};
  file.detections = builder.Finish();
  for (const std::string& camera : builder.cameras()) file.cameras.push_back({camera, 0, 0});
  if (num_foreign > 0) {
    file.notes.push_back({"CAL-IGNORED",
                          std::to_string(num_foreign) + " images fit no option 'corners-camera' pattern and are left out",
                          "add a pattern for their camera"});
  }
  return file;
}

}  // namespace mvstudio::calib::internal
