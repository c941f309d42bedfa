// Calibrates two cameras from exact corners, triangulates a point and, as the command does, a take with the result, and
// compares an image with itself.
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>

#include "avatar/metrics/ssim.h"
#include "calib/calibrate.h"
#include "geometry/lens/camera.h"
#include "geometry/rig/rig_io.h"
#include "stages/triangulate/run.h"
#include "triangulate/point/point.h"

namespace {

using namespace mvstudio;

geometry::Rig TrueRig() {
  geometry::Rig rig;
  for (const double x_m : {0.0, 0.6}) {
    geometry::RigCamera camera;
    camera.camera = geometry::MakePinhole(x_m == 0 ? "left" : "right", 640, 480, 620);
    camera.cam_from_world.rotation = Eigen::AngleAxisd(0.3 * x_m, Eigen::Vector3d::UnitY());
    camera.cam_from_world.translation = -(camera.cam_from_world.rotation * Eigen::Vector3d(x_m, 0, 0));
    rig.cameras.push_back(camera);
  }
  return rig;
}

calib::CalibrateInput Filmed(const geometry::Rig& rig) {
  calib::CalibrateInput input;
  input.boards = {calib::ParseBoard("chessboard:8x5:40mm")};
  const Eigen::Matrix3Xd corners = calib::CornersInBoard(input.boards[0]);
  for (const auto& camera : rig.cameras) input.cameras.push_back({camera.camera.name, 640, 480});
  for (int frame = 0; frame < 24; ++frame) {
    const Eigen::Vector3d place(0.1 + 0.3 * std::cos(2.4 * frame), 0.2 * std::sin(2.4 * frame), 1.1 + 0.02 * frame);
    const Eigen::Quaterniond turn(Eigen::AngleAxisd(0.5, Eigen::Vector3d(std::sin(1.7 * frame), std::cos(1.7 * frame), 0)));
    for (size_t c = 0; c < rig.cameras.size(); ++c) {
      const geometry::Projector projector(rig.cameras[c].camera);
      calib::Detection detection;
      detection.camera_idx = static_cast<int>(c), detection.frame_idx = frame;
      detection.points_px.resize(2, corners.cols());
      for (Eigen::Index i = 0; i < corners.cols(); ++i) {
        const Eigen::Vector3d x = turn * (corners.col(i) - corners.rowwise().mean()) + place;
        const geometry::Projection seen = projector.Project(rig.cameras[c].cam_from_world * x);
        const double noise = 0.05 * std::sin(12.9898 * static_cast<double>(i) + 78.233 * frame + 37.7 * static_cast<double>(c));
        detection.corner_ids.push_back(static_cast<int>(i));
        detection.points_px.col(i) = seen.px + Eigen::Vector2d(noise, -noise);
      }
      input.detections.push_back(std::move(detection));
    }
  }
  return input;
}

/// The stage of the command: options in, files and a report out. The largest error of its points, metres; infinite without
/// them.
double StageErrorM(const geometry::Rig& rig, const geometry::Rig& truth) {
  namespace fs = std::filesystem;
  const fs::path folder = fs::temp_directory_path() / "mvstudio-consumer";
  fs::remove_all(folder), fs::create_directories(folder);
  const auto wand_end = [](int end, int frame) {
    return Eigen::Vector3d(0.2 + 0.1 * std::cos(0.3 * frame), 0.1 + 0.2 * end, 1.5 + 0.1 * std::sin(0.2 * frame));
  };
  std::ofstream table(folder / "wand.csv");
  table << "camera,frame,person,joint,x_px,y_px,score\n";
  for (const auto& camera : truth.cameras) {
    for (int i = 0; i < 60; ++i) {
      const Eigen::Vector2d px = geometry::Projector(camera.camera).Project(camera.cam_from_world * wand_end(i % 2, i / 2)).px;
      table << camera.camera.name << "," << i / 2 << ",0," << (i % 2 ? "top" : "grip") << "," << px.x() << "," << px.y()
            << ",1\n";
    }
  }
  table.close();
  geometry::WriteRig(rig, (folder / "calibration.json").string());
  stages::TriangulateOptions options;
  options.pose.calib = (folder / "calibration.json").string(), options.pose.points2d = (folder / "wand.csv").string();
  options.out = (folder / "pose3d").string();
  const stages::TriangulateReport report = stages::RunTriangulate(options);
  double worst_m = report.points.num_points == 60 ? 0 : 1.0 / 0.0;
  for (const triangulate::TakePoint& at : report.take.points) {
    const int end = report.skeleton.joints[static_cast<size_t>(at.joint_idx)] == "top";
    worst_m = std::max(worst_m, (at.point.x_in_world - wand_end(end, at.frame)).norm());
  }
  fs::remove_all(folder);
  return worst_m;
}

}  // namespace

int main() {
  const geometry::Rig truth = TrueRig();
  const calib::CalibrateReport report = calib::Calibrate(Filmed(truth), {}, {});
  const double focal_px = report.rig.cameras.at(0).camera.fx();

  const Eigen::Vector3d point(0.2, 0.1, 1.5);
  std::vector<triangulate::Observation> seen;
  for (int c = 0; c < 2; ++c) {
    const auto& camera = truth.cameras[static_cast<size_t>(c)];
    seen.push_back({c, geometry::Projector(camera.camera).Project(camera.cam_from_world * point).px});
  }
  const triangulate::Point found = triangulate::TriangulatePoint(triangulate::Prepare(report.rig), seen);

  Image image(32, 32, 3, 0);
  for (size_t i = 0; i < image.pixels.size(); ++i) image.pixels[i] = static_cast<uint8_t>(i * 37);
  const double ssim = metrics::Ssim(image, image).value;

  const double stage_error_m = StageErrorM(report.rig, truth);

  std::printf("focal length %.3f px (620), point off by %.3f mm, those of a take by %.3f mm, SSIM %.6f\n", focal_px,
              1e3 * (found.x_in_world - point).norm(), 1e3 * stage_error_m, ssim);
  const bool right = report.status == Status::kOk && std::abs(focal_px - 620) < 1 && found.status == Status::kOk &&
                     (found.x_in_world - point).norm() < 1e-3 && stage_error_m < 2e-3 && ssim == 1;
  return right ? 0 : 1;
}
