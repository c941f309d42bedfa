#include "calib/corners/detection_builder.h"

#include <utility>

#include "calib/formats/format_text.h"
#include "core/error.h"
#include "core/utf8.h"

namespace mvstudio::calib::internal {

int DetectionBuilder::Camera(const std::string& name) {
  if (name.empty() || !IsUtf8(name)) {
    throw FormatError(path_, "", "the camera name '" + Printable(name) + "' is empty or not UTF-8");
  }
  const auto [entry, is_new] = camera_idx_.insert({name, static_cast<int>(cameras_.size())});
  if (is_new) cameras_.push_back(name);
  return entry->second;
}

void DetectionBuilder::Add(int camera_idx, int64_t frame_idx, int board_idx, int corner, const Eigen::Vector2d& px,
                           double sigma_px, const std::string& where) {
  if (!(px.cwiseAbs().maxCoeff() <= 1e7)) throw FormatError(path_, where, "the pixel is out of range");
  if (!(sigma_px > 0) || !(sigma_px <= 1e6)) throw FormatError(path_, where, "the corner's sigma or weight is out of range");
  if (corner < 0) throw FormatError(path_, where, "the corner's number is negative");
  const bool is_new = views_[{camera_idx, frame_idx, board_idx}].insert({corner, {px, sigma_px}}).second;
  if (!is_new) {
    throw FormatError(path_, where,
                      "corner " + std::to_string(corner) + " of camera " +
                          Printable(cameras_[static_cast<size_t>(camera_idx)]) + " in frame " + std::to_string(frame_idx) +
                          " is given twice");
  }
}

std::vector<Detection> DetectionBuilder::Finish() const {
  std::vector<Detection> detections;
  for (const auto& [key, corners] : views_) {
    Detection detection;
    std::tie(detection.camera_idx, detection.frame_idx, detection.board_idx) = key;
    const auto n = static_cast<Eigen::Index>(corners.size());
    detection.points_px.resize(2, n);
    detection.sigmas_px.resize(n);
    Eigen::Index i = 0;
    for (const auto& [id, corner] : corners) {
      detection.corner_ids.push_back(id);
      detection.points_px.col(i) = corner.px;
      detection.sigmas_px[i++] = corner.sigma_px;
    }
    if ((detection.sigmas_px.array() == detection.sigmas_px[0]).all()) {
      detection.sigma_px = detection.sigmas_px[0];
      detection.sigmas_px.resize(0);
    }
    detections.push_back(std::move(detection));
  }
  return detections;
}

}  // namespace mvstudio::calib::internal
