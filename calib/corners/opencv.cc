#include <algorithm>
#include <cmath>

#include "calib/corners/corner_readers.h"
#include "calib/corners/detection_builder.h"
#include "calib/formats/format_text.h"
#include "calib/formats/xml.h"
#include "core/disk/files.h"
#include "core/error.h"

namespace mvstudio::calib::internal {
namespace {

[[noreturn]] void Fail(const Place& place, const std::string& what) { throw FormatError(place.path, place.where, what); }

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

std::string_view Part(const pugi::xml_node& matrix, const char* tag, const Place& place) {
  const pugi::xml_node part = matrix.child(tag);
  if (!part) Fail(place, "<" + std::string(tag) + "> is missing in this matrix");
  return part.child_value();
}

/// The matrices of a list as (channels, N) points each.
std::vector<Eigen::MatrixXd> ReadPointLists(const std::string& path, const pugi::xml_node& list, int channels) {
  std::vector<Eigen::MatrixXd> matrices;
  for (const pugi::xml_node& matrix : list.children("_")) {
    const Place place{path, std::string(list.name()) + "[" + std::to_string(matrices.size()) + "]"};
    const std::vector<double> rows = Numbers(Part(matrix, "rows", place), place);
    const std::vector<double> cols = Numbers(Part(matrix, "cols", place), place);
    const std::vector<double> data = Numbers(Part(matrix, "data", place), place);
    if (rows.size() != 1 || cols.size() != 1 || !(rows[0] >= 0 && rows[0] <= 1e6) || !(cols[0] >= 0 && cols[0] <= 1e6)) {
      Fail(place, "the size of this matrix is out of range");
    }
    const std::string_view type = Part(matrix, "dt", place);
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

std::pair<int, int> ReadSize(const std::string& path, const pugi::xml_node& element) {
  if (!element) return {0, 0};
  const Place place{path, element.name()};
  const std::vector<double> size = Numbers(element.child_value(), place);
  const auto in_range = [](double v) { return v >= 1 && v <= 1 << 20 && v == std::floor(v); };
  if (size.size() != 2 || !in_range(size[0]) || !in_range(size[1])) Fail(place, "'width height' in px was expected");
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
  std::map<int, Eigen::Vector3d> Places() const {
    std::map<int, Eigen::Vector3d> places;
    for (const Eigen::Vector3d& point : points_) places.emplace(static_cast<int>(places.size()), point);
    return places;
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
  const char *camera, *tag, *size_tag;
};

}  // namespace

CornerFile ReadOpenCvCorners(const std::string& path, const CornerFileOptions& options) {
  const std::string text = ReadFile(path);
  if (text.find("<objectPoints") == std::string::npos && text.find("mage_points") != std::string::npos)
    return ReadOpenCvSample(path, options);
  pugi::xml_document document;
  ParseXml(path, text, &document);
  const pugi::xml_node root = document.document_element(), objects = root.child("objectPoints");
  if (!objects)
    throw FormatError(path, "", "no <objectPoints> in it; OpenCV's XML with objectPoints and imagePoints was expected");
  const std::vector<Eigen::MatrixXd> points = ReadPointLists(path, objects, 3);
  std::vector<ImageList> lists{{"left", "imagePoints1", "imageSize1"}, {"right", "imagePoints2", "imageSize2"}};
  if (root.child("imagePoints")) lists = {{"camera", "imagePoints", "imageSize"}};
  const double scale = MetresPer(options.unit);
  PointNumbers number;
  DetectionBuilder builder(path);
  CornerFile file;
  for (const ImageList& list : lists) {
    const pugi::xml_node element = root.child(list.tag);
    if (!element) throw FormatError(path, "", "no <" + std::string(list.tag) + "> in it");
    const std::vector<Eigen::MatrixXd> images = ReadPointLists(path, element, 2);
    if (images.size() != points.size()) {
      Fail({path, list.tag}, std::to_string(images.size()) + " views, objectPoints has " + std::to_string(points.size()));
    }
    const int camera = builder.Camera(list.camera);
    for (size_t view = 0; view < images.size(); ++view) {
      const std::string where = std::string(list.tag) + "[" + std::to_string(view) + "]";
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
    const auto [width, height] = ReadSize(path, root.child(list.size_tag));
    file.cameras.push_back({list.camera, width, height});
  }
  file.boards = {options.board ? *options.board : BoardFromPoints(number.Points())};
  if (options.board) CompareBoard(number.Places(), *options.board, path, &file.notes);
  file.detections = builder.Finish();
  return file;
}

}  // namespace mvstudio::calib::internal
