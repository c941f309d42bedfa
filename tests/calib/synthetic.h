#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "calib/board/board.h"
#include "calib/board/print.h"
#include "calib/bundle/view.h"
#include "calib/calibrate.h"
#include "core/random.h"
#include "core/units.h"
#include "geometry/lens/camera.h"
#include "geometry/rig/rig.h"

/// Synthetic rigs, boards and images with known truth, for the tests of calib/.
namespace mvstudio::calib::testing {

/// Distortion of a lens that exists, per model.
inline std::vector<double> SampleDistortion(geometry::LensModel model) {
  using geometry::LensModel;
  switch (model) {
    case LensModel::kKannalaBrandt4:
      return {-0.025, 0.009, 8e-5, -6e-5};
    case LensModel::kKannalaBrandt4P:
      return {-0.025, 0.009, 8e-5, -6e-5, 8e-4, -6e-4};
    case LensModel::kUcm:
      return {0.8};
    case LensModel::kUcmP:
      return {0.8, 8e-4, -6e-4};
    case LensModel::kEucm:
      return {0.6, 1.1};
    case LensModel::kEucmP:
      return {0.6, 1.1, 8e-4, -6e-4};
    case LensModel::kDoubleSphere:
      return {-0.2, 0.55};
    case LensModel::kDoubleSphereP:
      return {-0.2, 0.55, 8e-4, -6e-4};
    case LensModel::kPinholeP:
      return {8e-4, -6e-4};
    case LensModel::kBrown1P:
      return {-0.25, 8e-4, -6e-4};
    default:
      break;
  }
  std::vector<double> all = {-0.25, 0.09, 8e-4, -6e-4, -0.012, 0.01, -0.004, 0.002, 6e-4, -4e-4, -5e-4, 3e-4};
  all.resize(geometry::NumDistortionParams(model));
  return all;
}

/// `focal_px` is that of the pinhole which agrees at the axis.
inline geometry::Camera MakeCamera(const std::string& name, geometry::LensModel model, double focal_px = 560) {
  geometry::Camera camera{name, model, 640, 480, Eigen::VectorXd::Zero(geometry::NumParams(model)), {}};
  camera.params.head<4>() << focal_px, focal_px * 1.002, 322.5, 236.25;
  const std::vector<double> distortion = SampleDistortion(model);
  for (size_t i = 0; i < distortion.size(); ++i) camera.params[4 + i] = distortion[i];
  const bool shifted = model == geometry::LensModel::kUcm || model == geometry::LensModel::kUcmP ||
                       model == geometry::LensModel::kDoubleSphere || model == geometry::LensModel::kDoubleSphereP;
  if (shifted) camera.params.head<2>() *= 1 + distortion[0];
  return camera;
}

/// Looks from `eye` at `target`, image x level.
inline geometry::Rigid3 LookAt(const Eigen::Vector3d& eye, const Eigen::Vector3d& target) {
  const Eigen::Vector3d z = (target - eye).normalized(), x = z.cross(Eigen::Vector3d::UnitZ()).normalized();
  Eigen::Matrix3d r;
  r << x.transpose(), z.cross(x).transpose(), z.transpose();
  geometry::Rigid3 cam_from_world;
  cam_from_world.rotation = Eigen::Quaterniond(r);
  cam_from_world.translation = -(cam_from_world.rotation * eye);
  return cam_from_world;
}

/// Truth: cameras on an arc and boards waved in front of them.
struct Scene {
  Board board;
  RigState truth;
  std::vector<Detection> detections;
};

struct SceneOptions {
  int num_cameras = 2, num_frames = 20;
  geometry::LensModel model = geometry::LensModel::kBrown4;
  double noise_px = 0;
  double focal_step_px = 15;         ///< from camera to camera
  double arc_rad = 0.6;              ///< of the cameras around the volume
  double max_tilt_rad = 0.6;         ///< of the boards; 0: parallel to the image of camera 0
  double focal_px = 540;             ///< of camera 0; the others 15 more each
  double near_m = 0.9, far_m = 1.4;  ///< of the boards' centres from camera 0
  uint64_t seed = 1;
  const char* board = "chessboard:9x6:60mm";
};

/// Corners that project into the image; views with fewer than 12 corners are dropped.
inline Detection Observe(const Scene& scene, int camera, int frame, double noise_px, Rng* rng) {
  const geometry::Projector projector(scene.truth.cameras[camera]);
  const Eigen::Matrix3Xd corners = CornersInBoard(scene.board);
  Detection detection;
  detection.camera_idx = camera;
  detection.frame_idx = scene.truth.frames[frame];
  std::vector<Eigen::Vector2d> points;
  for (int i = 0; i < corners.cols(); ++i) {
    const Eigen::Vector3d x_in_world = scene.truth.world_from_board[frame] * Eigen::Vector3d(corners.col(i));
    const geometry::Projection projection = projector.Project(scene.truth.cam_from_world[camera] * x_in_world);
    const Eigen::Vector2d noise(rng->Normal(), rng->Normal());
    if (projection.status != Status::kOk || !geometry::InImage(scene.truth.cameras[camera], projection.px)) continue;
    detection.corner_ids.push_back(i);
    points.push_back(projection.px + noise_px * noise);
  }
  if (points.size() < 12) points.clear(), detection.corner_ids.clear();
  detection.points_px.resize(2, points.size());
  for (size_t i = 0; i < points.size(); ++i) detection.points_px.col(i) = points[i];
  return detection;
}

/// Detections of all boards by all cameras, frame after frame.
inline void ObserveAll(Scene* scene, double noise_px, uint64_t seed) {
  Rng noise(seed);
  scene->detections.clear();
  for (size_t f = 0; f < scene->truth.frames.size(); ++f) {
    for (size_t c = 0; c < scene->truth.cameras.size(); ++c) {
      Detection detection = Observe(*scene, static_cast<int>(c), static_cast<int>(f), noise_px, &noise);
      if (detection.num_corners() > 0) scene->detections.push_back(detection);
    }
  }
}

inline Scene MakeScene(const SceneOptions& options) {
  Scene scene;
  scene.board = ParseBoard(options.board);
  Rng rng(options.seed);
  for (int c = 0; c < options.num_cameras; ++c) {
    scene.truth.cameras.push_back(
        MakeCamera("cam" + std::to_string(c), options.model, options.focal_px + options.focal_step_px * c));
    const double angle = options.num_cameras > 1 ? options.arc_rad * (c / (options.num_cameras - 1.0) - 0.5) : 0;
    const Eigen::Vector3d eye(1.2 * std::sin(angle), -1.2 * std::cos(angle), 0.1 * c);
    scene.truth.cam_from_world.push_back(LookAt(eye, Eigen::Vector3d::Zero()));
  }
  const geometry::Rigid3 world_from_cam0 = geometry::Inverse(scene.truth.cam_from_world[0]);
  for (int f = 0; f < options.num_frames; ++f) {
    const double t = options.max_tilt_rad;
    geometry::Rigid3 cam0_from_board;
    cam0_from_board.rotation =
        geometry::RotationExp(Eigen::Vector3d(rng.Uniform(-t, t), rng.Uniform(-t, t), t > 0 ? rng.Uniform(-0.5, 0.5) : 0));
    const Eigen::Vector3d center(rng.Uniform(-0.25, 0.25), rng.Uniform(-0.2, 0.2), rng.Uniform(options.near_m, options.far_m));
    cam0_from_board.translation = center - cam0_from_board.rotation * Eigen::Vector3d(0.24, 0.15, 0);
    scene.truth.frames.push_back(3 * f + 1);
    scene.truth.world_from_board.push_back(world_from_cam0 * cam0_from_board);
  }
  ObserveAll(&scene, options.noise_px, options.seed + 1000);
  return scene;
}

inline CalibrateInput ToInput(const Scene& scene) {
  CalibrateInput input;
  input.boards = {scene.board};
  for (const auto& camera : scene.truth.cameras) input.cameras.push_back({camera.name, camera.width_px, camera.height_px});
  input.detections = scene.detections;
  return input;
}

/// The truth in the gauge of camera 0.
inline geometry::Rig TruthRig(const Scene& scene) {
  geometry::Rig rig;
  const geometry::Rigid3 world_from_cam0 = geometry::Inverse(scene.truth.cam_from_world[0]);
  for (size_t c = 0; c < scene.truth.cameras.size(); ++c) {
    rig.cameras.push_back(
        {scene.truth.cameras[c], scene.truth.cam_from_world[c] * world_from_cam0, std::nullopt, std::nullopt});
  }
  return rig;
}

/// Position on the board's plane of the point seen at a pixel, metres.
inline Eigen::Vector2d OnBoardPlane(const geometry::Projector& projector, const geometry::Rigid3& board_from_cam, double u,
                                    double v) {
  const Eigen::Vector3d ray = board_from_cam.rotation * projector.Unproject({u, v}).ray_in_cam;
  return (board_from_cam.translation - ray * (board_from_cam.translation.z() / ray.z())).head<2>();
}

/// An image of the board through the exact lens on a grey ground, `samples`^2 samples a pixel: exact rays at the pixel's
/// corners, bilinear in between.
inline Image RenderBoard(const Board& board, const geometry::Camera& camera, const geometry::Rigid3& cam_from_board,
                         int samples) {
  const int kPxPerSquare = board.has_tags() ? 480 : 96;
  constexpr double kMargin = 0.5;
  const Image print = DrawBoard(board, kPxPerSquare, kMargin);
  const BoardPrint sheet = PrintOf(board);
  const double margin_m = kMargin * board.square_m;
  const geometry::Projector projector(camera);
  const geometry::Rigid3 board_from_cam = geometry::Inverse(cam_from_board);
  Eigen::AlignedBox2d box;
  for (double a : {0.0, 0.5, 1.0}) {
    for (double b : {0.0, 0.5, 1.0}) {
      const Eigen::Vector2d x =
          sheet.low_m.array() - margin_m +
          Eigen::Array2d(a, b) * (sheet.high_m - sheet.low_m + Eigen::Vector2d::Constant(2 * margin_m)).array();
      box.extend(projector.Project(cam_from_board * Eigen::Vector3d(x.x(), x.y(), 0)).px);
    }
  }
  const int u0 = std::max(0, static_cast<int>(box.min().x()) - 8),
            u1 = std::min(camera.width_px - 1, static_cast<int>(box.max().x()) + 8);
  const int v0 = std::max(0, static_cast<int>(box.min().y()) - 8),
            v1 = std::min(camera.height_px - 1, static_cast<int>(box.max().y()) + 8);
  Image image(camera.width_px, camera.height_px, 1, 128);
  std::vector<Eigen::Vector2d> above, below;
  for (int v = v0; v <= v1 + 1; ++v) {
    below.clear();
    for (int u = u0; u <= u1 + 1; ++u) below.push_back(OnBoardPlane(projector, board_from_cam, u - 0.5, v - 0.5));
    for (int u = u0; v > v0 && u <= u1; ++u) {
      const int k = u - u0;
      double sum = 0;
      for (int s = 0; s < samples * samples; ++s) {
        const double a = (s % samples + 0.5) / samples, b = (s / samples + 0.5) / samples;
        const Eigen::Vector2d x =
            (1 - b) * ((1 - a) * above[k] + a * above[k + 1]) + b * ((1 - a) * below[k] + a * below[k + 1]);
        const Eigen::Vector2d at = ((x - sheet.low_m).array() + margin_m) / board.square_m * kPxPerSquare - 0.5;
        const int i = static_cast<int>(std::lround(at.x())), j = static_cast<int>(std::lround(at.y()));
        const bool inside = i >= 0 && j >= 0 && i < print.width && j < print.height;
        sum += inside ? 40 + 0.7 * *print.Pixel(i, j) : 128;
      }
      *image.Pixel(u, v - 1) = static_cast<uint8_t>(std::lround(sum / (samples * samples)));
    }
    std::swap(above, below);
  }
  return image;
}

/// With a given lens, since its choice takes most of the time.
inline CalibrateOptions PlainOptions() {
  CalibrateOptions options;
  options.model = geometry::LensModel::kBrown2;
  options.warp = options.stretch = AutoOnOff::kOff;
  options.share_intrinsics = {LensSharing::Kind::kNone, {}};
  options.time_offset = TimeOffsetChoice::kNone;
  options.holdout_folds = 2;
  return options;
}

/// Whether the verdict has a reason with this code.
inline bool HasReason(const CalibrateReport& report, const std::string& code) {
  const auto& reasons = report.verdict.reasons;
  return std::any_of(reasons.begin(), reasons.end(), [&](const auto& reason) { return reason.code == code; });
}

}  // namespace mvstudio::calib::testing

namespace mvstudio::calib {
using namespace testing;
}
