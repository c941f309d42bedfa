#include "calib/board/aruco.h"

#include <opencv2/aruco.hpp>
#include <opencv2/imgproc.hpp>

#include "calib/board/charuco_layout.h"

namespace mvstudio::calib {
namespace {

constexpr int kBorders = 2;  // black cells on both sides of the bits

cv::Ptr<cv::aruco::Dictionary> Dictionary(const std::string& name) {
  return cv::aruco::getPredefinedDictionary(DictionaryIndex(name));
}

void AddTags(const TagFamily& family, const cv::Mat& grey, double scale, std::vector<Tag>* tags) {
  auto parameters = cv::aruco::DetectorParameters::create();
  parameters->minMarkerPerimeterRate = 0.01;
  parameters->perspectiveRemovePixelPerCell = 6;
  cv::Mat resized = grey;
  if (scale != 1) cv::resize(grey, resized, {}, scale, scale, cv::INTER_CUBIC);
  std::vector<std::vector<cv::Point2f>> corners;
  std::vector<int> ids;
  cv::aruco::detectMarkers(resized, Dictionary(family.name), corners, ids, parameters);
  for (size_t i = 0; i < ids.size(); ++i) {
    Tag tag;
    tag.id = ids[i];
    for (int k = 0; k < 4; ++k) {  // OpenCV's run clockwise from the top left
      const cv::Point2f& corner = corners[i][static_cast<size_t>(3 - k)];
      tag.px.col(k) = ((Eigen::Array2d(corner.x, corner.y) + 0.5) / scale - 0.5).matrix();
    }
    tags->push_back(tag);
  }
}

}  // namespace

std::optional<TagFamily> FindArucoFamily(const std::string& name) {
  if (DictionaryIndex(name) < 0 || name.rfind("apriltag", 0) == 0) return std::nullopt;
  const auto dictionary = Dictionary(name);
  TagFamily family;
  family.name = name;
  family.num_tags = dictionary->bytesList.rows;
  family.border_cells = dictionary->markerSize + kBorders;
  family.total_cells = family.border_cells + kBorders;  // and white around it
  family.aruco = true;
  return family;
}

TagPattern ArucoPattern(const TagFamily& family, int id) {
  cv::Mat drawn;  // one pixel a cell
  cv::aruco::drawMarker(Dictionary(family.name), id, family.border_cells, drawn, 1);
  TagPattern pattern;
  pattern.border_cells = family.border_cells, pattern.total_cells = family.total_cells;
  for (int v = -1; v <= drawn.rows; ++v) {
    for (int u = -1; u <= drawn.cols; ++u) {
      const bool inside = u >= 0 && v >= 0 && u < drawn.cols && v < drawn.rows;
      pattern.black.push_back(inside && drawn.at<uint8_t>(v, u) == 0);
    }
  }
  return pattern;
}

std::vector<Tag> FindArucoTags(const TagFamily& family, const Image& grey) {
  const cv::Mat image(grey.height, grey.width, CV_8UC1, const_cast<uint8_t*>(grey.pixels.data()));
  std::vector<Tag> tags;
  AddTags(family, image, 1, &tags);
  if (tags.empty()) AddTags(family, image, 2, &tags);
  return tags;
}

}  // namespace mvstudio::calib
