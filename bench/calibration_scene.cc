#include <algorithm>
#include <cmath>

#include "bench/calibration.h"
#include "core/random.h"
#include "core/units.h"
#include "geometry/lens/camera.h"

namespace mvstudio::bench {
namespace {

using geometry::Rigid3;

constexpr double kRadius = 3.0;         // of the ring, metres
constexpr double kMaxSlantRad = 1.1;    // beyond it detectors give up
constexpr double kShareInImage = 0.75;  // of a board's corners

geometry::Camera MakeLens(int index, Rng* rng) {
  geometry::Camera camera{"cam" + std::to_string(index), geometry::LensModel::kBrown4, 1280, 1024, Eigen::VectorXd(8), {}};
  const double focal = 1100 * (1 + rng->Uniform(-0.02, 0.02));
  camera.params << focal, focal, 639.5 + rng->Uniform(-10, 10), 511.5 + rng->Uniform(-10, 10), -0.2, 0.06, 5e-4, -4e-4;
  return camera;
}

Rigid3 CameraInRing(int index, int count) {
  const double angle = 2 * kPi * index / count;
  const Eigen::Vector3d eye(kRadius * std::cos(angle), kRadius * std::sin(angle), 0.5 + 0.7 * (index % 3));
  const Eigen::Vector3d z = (Eigen::Vector3d(0, 0, 1) - eye).normalized(), x = z.cross(Eigen::Vector3d::UnitZ()).normalized();
  Eigen::Matrix3d r;
  r << x.transpose(), z.cross(x).transpose(), z.transpose();
  Rigid3 cam_from_world;
  cam_from_world.rotation = Eigen::Quaterniond(r);
  cam_from_world.translation = -(cam_from_world.rotation * eye);
  return cam_from_world;
}

Rigid3 RandomBoard(const calib::Board& board, Rng* rng) {
  const double heading = rng->Uniform(0, 2 * kPi), pitch = rng->Uniform(-0.5, 0.5), roll = rng->Uniform(-0.5, 0.5);
  Rigid3 pose;
  pose.rotation = geometry::RotationExp(Eigen::Vector3d(0, 0, heading)) * geometry::RotationExp(Eigen::Vector3d(pitch, 0, 0)) *
                  geometry::RotationExp(Eigen::Vector3d(0, roll, 0)) * geometry::RotationExp(Eigen::Vector3d(-kPi / 2, 0, 0));
  const Eigen::Vector3d middle((board.cols - 1) * board.square_m / 2, (board.rows - 1) * board.square_m / 2, 0);
  const Eigen::Vector3d center(rng->Uniform(-0.9, 0.9), rng->Uniform(-0.9, 0.9), rng->Uniform(0.5, 1.6));
  pose.translation = center - pose.rotation * middle;
  return pose;
}

/// The corners of a board that a camera sees; none when too few.
calib::Detection Observe(const calib::Board& board, const calib::RigState& truth, int camera, int frame, double noise_px,
                         Rng* rng) {
  const geometry::Projector projector(truth.cameras[camera]);
  const Eigen::Matrix3Xd corners = calib::CornersInBoard(board);
  const Eigen::Matrix2Xd warp = calib::WarpBasis(corners);
  const Rigid3 cam_from_board = truth.cam_from_world[camera] * truth.world_from_board[frame];
  calib::Detection detection;
  detection.camera_idx = camera;
  detection.frame_idx = frame;
  const Eigen::Vector3d into_board = cam_from_board.rotation * Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d view_direction = (cam_from_board * Eigen::Vector3d(corners.rowwise().mean())).normalized();
  if (into_board.dot(view_direction) < std::cos(kMaxSlantRad)) return detection;  // the printed side looks away
  std::vector<Eigen::Vector2d> points;
  for (int i = 0; i < corners.cols(); ++i) {
    const Eigen::Vector3d bent = corners.col(i) + Eigen::Vector3d(0, 0, warp.col(i).dot(truth.board_warp_m[0]));
    const geometry::Projection projection = projector.Project(cam_from_board * bent);
    if (projection.status != Status::kOk || !geometry::InImage(truth.cameras[camera], projection.px)) continue;
    detection.corner_ids.push_back(i);
    points.push_back(projection.px + noise_px * Eigen::Vector2d(rng->Normal(), rng->Normal()));
  }
  if (static_cast<double>(points.size()) < kShareInImage * static_cast<double>(corners.cols()))
    detection.corner_ids.clear(), points.clear();
  detection.points_px.resize(2, static_cast<Eigen::Index>(points.size()));
  for (size_t i = 0; i < points.size(); ++i) detection.points_px.col(static_cast<Eigen::Index>(i)) = points[i];
  return detection;
}

calib::RigState NearTruth(const calib::RigState& truth, Rng* rng) {
  const auto random = [&](double angle, double length) {
    geometry::Vector6d v;
    for (int i = 0; i < 3; ++i) v[i] = rng->Uniform(-angle, angle), v[3 + i] = rng->Uniform(-length, length);
    return v;
  };
  calib::RigState start = truth;
  start.board_warp_m[0].setZero();
  for (size_t c = 0; c < truth.cameras.size(); ++c) {
    start.cameras[c].params.head<2>() *= 1 + rng->Uniform(-0.01, 0.01);
    start.cameras[c].params.tail<4>() *= 0.8;
    if (c > 0) start.cam_from_world[c] = geometry::Perturb(random(0.003, 0.01), truth.cam_from_world[c]);
  }
  for (Rigid3& pose : start.world_from_board) pose = geometry::Perturb(random(0.003, 0.01), pose);
  return start;
}

}  // namespace

RigScene MakeRigScene(int num_cameras, int num_corners, double noise_px, uint64_t seed) {
  RigScene scene;
  scene.board = calib::ParseBoard("chessboard:10x10:60mm");
  Rng rng(seed);
  calib::RigState& truth = scene.truth;
  truth.board_warp_m[0] = Eigen::Vector2d(1.0e-3, -0.5e-3);
  for (int c = 0; c < num_cameras; ++c) {
    truth.cameras.push_back(MakeLens(c, &rng));
    truth.cam_from_world.push_back(CameraInRing(c, num_cameras));
  }
  std::vector<calib::Detection> detections;
  for (int frame = 0; scene.num_corners < num_corners; ++frame) {
    truth.world_from_board.push_back(RandomBoard(scene.board, &rng));
    truth.frames.push_back(frame);
    for (int c = 0; c < num_cameras; ++c) {
      const calib::Detection detection = Observe(scene.board, truth, c, frame, noise_px, &rng);
      if (detection.num_corners() == 0) continue;
      scene.num_corners += detection.num_corners();
      detections.push_back(detection);
    }
  }
  for (const calib::Detection& detection : detections)
    scene.views.push_back(calib::MakeView({scene.board}, detection, truth.frames));
  scene.start = NearTruth(truth, &rng);
  return scene;
}

std::vector<Eigen::Vector2d> MapPixels(const geometry::Camera& camera, int cols, int rows) {
  std::vector<Eigen::Vector2d> pixels;
  for (int row = 0; row < rows; ++row) {
    for (int col = 0; col < cols; ++col)
      pixels.emplace_back((camera.width_px - 1.0) * col / (cols - 1), (camera.height_px - 1.0) * row / (rows - 1));
  }
  return pixels;
}

}  // namespace mvstudio::bench
