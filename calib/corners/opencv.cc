#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>

#include "calib/corners/corner_files_internal.h"
#include "core/disk/files.h"
#include "core/error.h"

namespace mvstudio::calib::internal {
namespace {

/// A piece of the file's text with its name for messages.
struct Element {
  std::string_view text;
  Place place;
};

[[noreturn]] void Fail(const Place& place, const std::string& what) { throw FormatError(place.path, place.where, what); }

/// What stands between <tag …> and </tag>, searched from *at on; *at moves behind it.
std::optional<std::string_view> NextElement(std::string_view text, const std::string& tag, const Place& place, size_t* at) {
  size_t open = text.find("<" + tag, *at);
  while (open != std::string_view::npos && open + tag.size() + 1 < text.size() && text[open + tag.size() + 1] != '>' &&
         text[open + tag.size() + 1] != ' ') {
    open = text.find("<" + tag, open + 1);
  }
  if (open == std::string_view::npos) return std::nullopt;
  const size_t start = text.find('>', open), close = text.find("</" + tag + ">", open);
  if (start == std::string_view::npos || close == std::string_view::npos || close < start) {
    Fail(place, "<" + tag + "> is not closed; is the file truncated?");
  }
  *at = close + tag.size() + 3;
  return text.substr(start + 1, close - start - 1);
}

std::optional<Element> Find(std::string_view text, const std::string& path, const std::string& tag) {
  size_t at = 0;
  const auto found = NextElement(text, tag, {path, tag}, &at);
  return found ? std::optional<Element>({*found, {path, tag}}) : std::nullopt;
}

std::vector<double> Numbers(std::string_view text, const Place& place) {
  std::vector<double> numbers;
  size_t at = 0;
  while ((at = text.find_first_not_of(" \t\r\n", at)) != std::string_view::npos) {
    const size_t end = std::min(text.size(), text.find_first_of(" \t\r\n", at));
    numbers.push_back(ParseNumber(text.substr(at, end - at), place));
    at = end;
  }
  return numbers;
}

std::string_view Part(std::string_view matrix, const std::string& tag, const Place& place) {
  size_t at = 0;
  const auto part = NextElement(matrix, tag, place, &at);
  if (!part) Fail(place, "<" + tag + "> is missing in this matrix");
  return *part;
}

/// The matrices of a list as (channels, N) points each.
std::vector<Eigen::MatrixXd> ReadPointLists(const Element& list, int channels) {
  std::vector<Eigen::MatrixXd> matrices;
  size_t at = 0;
  while (const auto matrix = NextElement(list.text, "_", list.place, &at)) {
    const Place place{list.place.path, list.place.where + "[" + std::to_string(matrices.size()) + "]"};
    const std::vector<double> rows = Numbers(Part(*matrix, "rows", place), place);
    const std::vector<double> cols = Numbers(Part(*matrix, "cols", place), place);
    const std::vector<double> data = Numbers(Part(*matrix, "data", place), place);
    if (rows.size() != 1 || cols.size() != 1 || !(rows[0] >= 0 && rows[0] <= 1e6) || !(cols[0] >= 0 && cols[0] <= 1e6)) {
      Fail(place, "the size of this matrix is out of range");
    }
    const std::string_view type = Part(*matrix, "dt", place);
    const bool vectors = type.find(std::to_string(channels)) != std::string_view::npos;
    const double expected = rows[0] * cols[0] * (vectors ? channels : 1);
    if (static_cast<double>(data.size()) != expected || data.size() % static_cast<size_t>(channels) != 0) {
      Fail(place, std::to_string(data.size()) + " numbers for a list of " + std::to_string(channels) + "-D points");
    }
    matrices.push_back(
        Eigen::Map<const Eigen::MatrixXd>(data.data(), channels, static_cast<Eigen::Index>(data.size()) / channels));
  }
  return matrices;
}

std::pair<int, int> ReadSize(std::string_view text, const std::string& path, const std::string& tag) {
  const auto element = Find(text, path, tag);
  if (!element) return {0, 0};
  const std::vector<double> size = Numbers(element->text, element->place);
  const auto in_range = [](double v) { return v >= 1 && v <= 1 << 20 && v == std::floor(v); };
  if (size.size() != 2 || !in_range(size[0]) || !in_range(size[1])) Fail(element->place, "'width height' in px was expected");
  return {static_cast<int>(size[0]), static_cast<int>(size[1])};
}

/// Board points numbered by their place: views may show different subsets.
class PointNumbers {
 public:
  int operator()(const Eigen::Vector3d& point) {
    const auto [entry, is_new] = ids_.insert({{point.x(), point.y(), point.z()}, static_cast<int>(points_.size())});
    if (is_new) points_.push_back(point);
    return entry->second;
  }
  Eigen::Matrix3Xd Points() const {
    Eigen::Matrix3Xd points(3, static_cast<Eigen::Index>(points_.size()));
    for (size_t i = 0; i < points_.size(); ++i) points.col(static_cast<Eigen::Index>(i)) = points_[i];
    return points;
  }

 private:
  std::map<std::tuple<double, double, double>, int> ids_;
  std::vector<Eigen::Vector3d> points_;
};

struct ImageList {
  std::string camera, tag, size_tag;
};

}  // namespace

CornerFile ReadOpenCvCorners(const std::string& path, const CornerFileOptions& options) {
  const std::string text = ReadFile(path);
  const auto objects = Find(text, path, "objectPoints");
  if (!objects)
    throw FormatError(path, "", "no <objectPoints> in it; OpenCV's XML with objectPoints and imagePoints was expected");
  const std::vector<Eigen::MatrixXd> points = ReadPointLists(*objects, 3);
  std::vector<ImageList> lists{{"left", "imagePoints1", "imageSize1"}, {"right", "imagePoints2", "imageSize2"}};
  if (Find(text, path, "imagePoints")) lists = {{"camera", "imagePoints", "imageSize"}};
  const double scale = MetresPerUnit(options.unit);
  PointNumbers number;
  DetectionBuilder builder(path);
  CornerFile file;
  for (const ImageList& list : lists) {
    const auto element = Find(text, path, list.tag);
    if (!element) throw FormatError(path, "", "no <" + list.tag + "> in it");
    const std::vector<Eigen::MatrixXd> images = ReadPointLists(*element, 2);
    if (images.size() != points.size()) {
      Fail(element->place, std::to_string(images.size()) + " views, objectPoints has " + std::to_string(points.size()));
    }
    const int camera = builder.Camera(list.camera);
    for (size_t view = 0; view < images.size(); ++view) {
      const std::string where = list.tag + "[" + std::to_string(view) + "]";
      if (images[view].cols() != points[view].cols() && images[view].cols() > 0) {
        throw FormatError(
            path, where,
            std::to_string(images[view].cols()) + " points, objectPoints has " + std::to_string(points[view].cols()));
      }
      for (Eigen::Index i = 0; i < images[view].cols(); ++i) {
        const int corner = number(scale * Eigen::Vector3d(points[view].col(i)));
        builder.Add(camera, static_cast<int64_t>(view), 0, corner, images[view].col(i), 1, where);
      }
    }
    const auto [width, height] = ReadSize(text, path, list.size_tag);
    file.cameras.push_back({list.camera, width, height});
  }
  file.boards = {options.board ? *options.board : BoardFromPoints(number.Points())};
  file.detections = builder.Finish();
  return file;
}

}  // namespace mvstudio::calib::internal
