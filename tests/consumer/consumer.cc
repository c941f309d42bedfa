// As the commands do, calibrates two cameras from a file of corners and triangulates a take with the result. As their libraries
// do, triangulates a point, and compares an image with itself.
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>

#include "avatar/metrics/ssim.h"
#include "calib/corners/corner_files.h"
#include "geometry/lens/camera.h"
#include "geometry/rig/rig_io.h"
#include "stages/calibrate/run.h"
#include "stages/triangulate/run.h"
#include "triangulate/point/point.h"

namespace {

using namespace mvstudio;
namespace fs = std::filesystem;

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

calib::CornerFile Filmed(const geometry::Rig& rig) {
  calib::CornerFile input;
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

/// calibration.json in `folder`, and what it was made of.
stages::CalibrateReport Calibrated(const geometry::Rig& truth, const fs::path& folder) {
  calib::WriteCornerFile(Filmed(truth), (folder / "corners.csv").string());
  stages::CalibrateOptions options;
  options.corners.corners = (folder / "corners.csv").string(), options.out = (folder / "calib").string();
  return stages::RunCalibrate(options);
}

/// Where an end of a wand is, metres in world.
Eigen::Vector3d WandEnd(int end, int frame) {
  return {0.2 + 0.1 * std::cos(0.3 * frame), 0.1 + 0.2 * end, 1.5 + 0.1 * std::sin(0.2 * frame)};
}

/// What the cameras see of the wand, triangulated.
stages::TriangulateReport Triangulated(const geometry::Rig& truth, const std::string& calibration, const fs::path& folder) {
  std::ofstream table(folder / "wand.csv");
  table << "camera,frame,person,joint,x_px,y_px,score\n";
  for (const auto& camera : truth.cameras) {
    for (int i = 0; i < 60; ++i) {
      const Eigen::Vector3d x = camera.cam_from_world * WandEnd(i % 2, i / 2);
      const Eigen::Vector2d px = geometry::Projector(camera.camera).Project(x).px;
      table << camera.camera.name << "," << i / 2 << ",0," << (i % 2 ? "top" : "grip") << "," << px.x() << "," << px.y()
            << ",1\n";
    }
  }
  table.close();
  stages::TriangulateOptions options;
  options.pose.calib = calibration, options.pose.points2d = (folder / "wand.csv").string();
  options.out = (folder / "pose3d").string();
  return stages::RunTriangulate(options);
}

/// The largest error of a take's points, metres; infinite without them.
double WorstM(const stages::TriangulateReport& report) {
  double worst_m = report.points.num_points == 60 ? 0 : 1.0 / 0.0;
  for (const triangulate::TakePoint& at : report.take.points) {
    const int end = report.skeleton.joints[static_cast<size_t>(at.joint_idx)] == "top";
    worst_m = std::max(worst_m, (at.point.x_in_world - WandEnd(end, at.frame)).norm());
  }
  return worst_m;
}

}  // namespace

int main() {
  const geometry::Rig truth = TrueRig();
  const fs::path folder = fs::temp_directory_path() / "mvstudio-consumer";
  fs::remove_all(folder), fs::create_directories(folder);
  const stages::CalibrateReport calibrated = Calibrated(truth, folder);
  const double take_error_m = WorstM(Triangulated(truth, calibrated.path, folder));
  fs::remove_all(folder);
  const calib::CalibrateReport& report = std::get<stages::BoardCalibration>(calibrated.found).solved.report;
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

  std::printf("focal length %.3f px (620), point off by %.3f mm, those of a take by %.3f mm, SSIM %.6f\n", focal_px,
              1e3 * (found.x_in_world - point).norm(), 1e3 * take_error_m, ssim);
  const bool right = report.status == Status::kOk && std::abs(focal_px - 620) < 1 && found.status == Status::kOk &&
                     (found.x_in_world - point).norm() < 1e-3 && take_error_m < 2e-3 && ssim == 1;
  return right ? 0 : 1;
}
