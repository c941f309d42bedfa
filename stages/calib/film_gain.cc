#include "stages/calib/film_gain.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <utility>

#include "calib/covariance/projection_uncertainty.h"
#include "calib/verdict/capture_advice.h"
#include "stages/calib/solved_state.h"

namespace mvstudio::stages {
namespace {

using Eigen::Index;
using geometry::Rigid3;

/// One of 3 x 3 parts of an image.
struct Third {
  int col = 0, row = 0;
};

/// A board around the middle of a part of the image, as near to it as the whole board is in view; none: it is nowhere.
std::optional<Rigid3> BoardAt(const geometry::Projector& projector, const geometry::Camera& camera,
                              const Eigen::Matrix3Xd& corners, const Third& part, const Eigen::Vector3d& turn, double range_m) {
  const Eigen::Vector2d middle(0.5 * (camera.width_px - 1), 0.5 * (camera.height_px - 1));
  const Eigen::Vector2d wanted((part.col + 0.5) * camera.width_px / 3 - 0.5, (part.row + 0.5) * camera.height_px / 3 - 0.5);
  const Eigen::Vector3d of_board = 0.5 * (corners.rowwise().minCoeff() + corners.rowwise().maxCoeff());
  for (double share = 1; share > 0; share -= 0.05) {
    const auto ray = projector.Unproject(middle + share * (wanted - middle));
    if (ray.status != Status::kOk) continue;
    Rigid3 cam_from_board{geometry::RotationExp(turn), Eigen::Vector3d::Zero()};
    cam_from_board.translation = range_m * ray.ray_in_cam.normalized() - cam_from_board.rotation * of_board;
    bool inside = true;
    for (Index i = 0; i < corners.cols() && inside; ++i) {
      const auto seen = projector.Project(cam_from_board * Eigen::Vector3d(corners.col(i)));
      inside = seen.status == Status::kOk && geometry::InImage(camera, seen.px);
    }
    if (inside) return cam_from_board;
  }
  return std::nullopt;
}

/// The parts of a camera's image beside the middle, those with the fewest corners first.
std::vector<Third> PartsToFilm(const geometry::Camera& camera, int camera_idx,
                               const std::vector<calib::Detection>& detections) {
  std::array<int, 9> count{};
  const auto third = [](double at, int size_px) { return std::clamp(static_cast<int>((at + 0.5) * 3 / size_px), 0, 2); };
  for (const calib::Detection& seen : detections) {
    for (Index i = 0; i < seen.points_px.cols() && seen.camera_idx == camera_idx; ++i)
      ++count[static_cast<size_t>(third(seen.points_px(1, i), camera.height_px) * 3 +
                                  third(seen.points_px(0, i), camera.width_px))];
  }
  std::vector<Third> parts;
  for (const int at : {0, 2, 6, 8, 1, 3, 5, 7}) parts.push_back({at % 3, at / 3});
  std::stable_sort(parts.begin(), parts.end(), [&](const Third& a, const Third& b) {
    return count[static_cast<size_t>(3 * a.row + a.col)] < count[static_cast<size_t>(3 * b.row + b.col)];
  });
  return parts;
}

std::vector<FilmGain> Proposals(const calib::CalibrateReport& report, const std::vector<calib::Board>& boards,
                                const std::vector<calib::Detection>& detections) {
  constexpr size_t kBoards = 6;
  constexpr double kTilt = 0.6;
  const Eigen::Matrix3Xd corners = calib::CornersInBoard(boards[0]);
  std::vector<FilmGain> gains;
  for (const calib::FilmHint& hint : calib::CaptureAdvice(report)) {
    const bool known = std::any_of(gains.begin(), gains.end(), [&](const auto& g) { return g.camera_idx == hint.camera_idx; });
    if (known || (hint.code != "FILM-COVERAGE" && hint.code != "FILM-FEW")) continue;
    const auto c = static_cast<size_t>(hint.camera_idx);
    const geometry::Camera& camera = report.rig.cameras[c].camera;
    const std::vector<Third> parts = PartsToFilm(camera, hint.camera_idx, detections);
    const geometry::Projector projector(camera);
    FilmGain gain;
    gain.camera_idx = hint.camera_idx;
    for (size_t i = 0; i < kBoards; ++i) {
      const double tilt = i / 2 % 2 ? -kTilt : kTilt;
      const Eigen::Vector3d turn = i % 2 ? Eigen::Vector3d(tilt, 0, 0) : Eigen::Vector3d(0, tilt, 0);
      const double range_m = report.uncertainty.cameras[c].range_m;
      const auto pose = BoardAt(projector, camera, corners, parts[i % parts.size()], turn, range_m);
      if (pose) gain.cam_from_board.push_back(*pose);
    }
    if (!gain.cam_from_board.empty()) gains.push_back(std::move(gain));
  }
  return gains;
}

calib::Detection SeenAt(const geometry::Camera& camera, int camera_idx, int64_t frame, const calib::Board& board,
                        const Rigid3& pose) {
  const geometry::Projector projector(camera);
  const Eigen::Matrix3Xd corners = calib::CornersInBoard(board);
  calib::Detection detection;
  detection.camera_idx = camera_idx, detection.frame_idx = frame;
  detection.points_px.resize(2, corners.cols());
  for (Index i = 0; i < corners.cols(); ++i) {
    detection.points_px.col(i) = projector.Project(pose * Eigen::Vector3d(corners.col(i))).px;
    detection.corner_ids.push_back(static_cast<int>(i));
  }
  return detection;
}

/// Uncertainty at the corners of each camera's image by these detections, at the report's solution.
std::vector<double> CornerPx(const calib::CalibrateReport& report, const std::vector<calib::Board>& boards,
                             const std::vector<calib::Detection>& detections, std::map<int64_t, Rigid3> world_from_board) {
  const SolvedState solved = StateOf(report, boards, detections, std::move(world_from_board));
  std::vector<double> px;
  for (const calib::CameraUncertainty& c :
       calib::ProjectionUncertainty(solved.views, solved.state, solved.options, report.sigma_px).Summarize().cameras)
    px.push_back(c.corner_px);
  return px;
}

}  // namespace

std::vector<FilmGain> PredictGain(const calib::CalibrateReport& report, const std::vector<calib::Board>& boards) {
  const size_t count = report.rig.cameras.size();
  if (!IsWholeState(report) || report.components.empty() || report.uncertainty.cameras.size() != count) return {};
  std::vector<calib::Detection> detections = KeptCorners(report);
  std::vector<FilmGain> gains = Proposals(report, boards, detections);
  if (gains.empty()) return gains;
  std::map<int64_t, Rigid3> poses = BoardPoses(report);
  const std::vector<double> before = CornerPx(report, boards, detections, poses);
  int64_t frame = poses.empty() ? 0 : poses.rbegin()->first + 1;
  for (const FilmGain& gain : gains) {
    const geometry::RigCamera& camera = report.rig.cameras[static_cast<size_t>(gain.camera_idx)];
    for (const Rigid3& pose : gain.cam_from_board) {
      poses[frame] = geometry::Inverse(camera.cam_from_world) * pose;
      detections.push_back(SeenAt(camera.camera, gain.camera_idx, frame++, boards[0], pose));
    }
  }
  const std::vector<double> after = CornerPx(report, boards, detections, poses);
  std::vector<FilmGain> known;
  for (FilmGain& gain : gains) {
    const auto c = static_cast<size_t>(gain.camera_idx);
    gain.before_px = before[c], gain.after_px = after[c];
    const bool lower = !std::isfinite(gain.before_px) || gain.after_px < gain.before_px;
    if (std::isfinite(gain.after_px) && lower) known.push_back(std::move(gain));
  }
  return known;
}

}  // namespace mvstudio::stages
