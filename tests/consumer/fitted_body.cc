// Fits a mannequin of 1.75 m to the joints and silhouettes of a larger person, who stands in five cameras for ten time
// steps. Needs no libtorch.
#include <cmath>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "avatar/body/fit/fit_body.h"
#include "avatar/body/fit/rim.h"
#include "avatar/body/surface_nets.h"
#include "core/random.h"
#include "geometry/rigid/rigid3.h"

namespace {

using namespace mvstudio;
constexpr int kNumSteps = 10, kNumCameras = 5, kSizePx = 160;

/// A mannequin of another height, with a belly and thick legs.
body::BodyTemplate Person() {
  constexpr double kHeightM = 1.84;
  body::BodyTemplate person = body::MakeMannequin(kHeightM, 0.5);
  const Eigen::Matrix3Xf normals = body::VertexNormals(person.vertices, person.faces);
  for (Eigen::Index v = 0; v < person.vertices.cols(); ++v) {
    const double z = person.vertices(2, v) / kHeightM;
    const double belly = 0.035 * std::exp(-std::pow((z - 0.6) / 0.08, 2)), leg = z < 0.45 ? 0.012 : 0;
    person.vertices.col(v) += static_cast<float>(belly + leg) * normals.col(v);
  }
  return person;
}

/// Looks at the person from 3 m away, `angle_rad` about the vertical.
geometry::RigCamera CameraAt(double angle_rad) {
  const Eigen::Vector3d place(3 * std::sin(angle_rad), -3 * std::cos(angle_rad), 1.2);
  const Eigen::Vector3d forward = (Eigen::Vector3d(0, 0, 0.9) - place).normalized();
  const Eigen::Vector3d right = forward.cross(Eigen::Vector3d::UnitZ()).normalized();
  Eigen::Matrix3d axes;
  axes << right.transpose(), forward.cross(right).transpose(), forward.transpose();
  geometry::RigCamera camera;
  camera.camera = geometry::MakePinhole("cam", kSizePx, kSizePx, 1.2 * kSizePx);
  camera.cam_from_world.rotation = geometry::NearestRotation(axes);
  camera.cam_from_world.translation = -(axes * place);
  return camera;
}

/// Every bone turned by about 8 degrees.
body::ArticulatedPose SomePose(const body::BodyTemplate& person, Rng* rng) {
  body::ArticulatedPose pose;
  for (size_t b = 0; b < person.bone_names.size(); ++b) {
    const Eigen::Vector3d turn(rng->Normal(), rng->Normal(), rng->Normal());
    pose.local_rotations.push_back(geometry::RotationExp(0.1 * turn));
  }
  return pose;
}

/// What the cameras see of a pose; every fifth time step is held out.
body::FitStep Seen(const body::BodyTemplate& person, const body::ArticulatedPose& pose, int frame) {
  const body::BodyPose posed = ToBodyPose(person, pose);
  const Eigen::Matrix3Xf vertices = SkinVertices(person, posed);
  body::FitStep step;
  step.frame = frame;
  step.joints.x_in_world = PosedCoco19(person, posed), step.joints.valid.fill(true);
  for (int c = 0; c < kNumCameras; ++c) {
    const geometry::RigCamera camera = CameraAt(2 * M_PI * c / kNumCameras);
    auto outline = std::make_shared<body::MaskOutline>(body::RasterizeCover(person.faces, vertices, camera));
    step.views.push_back({"cam" + std::to_string(c), camera, outline, nullptr, frame % 5 == 2});
  }
  return step;
}

/// Mean distance of a body's vertices from the nearest ones of the person, metres.
double DistanceM(const Eigen::Matrix3Xf& found, const Eigen::Matrix3Xf& person) {
  double sum_m = 0;
  int count = 0;
  for (Eigen::Index v = 0; v < found.cols(); v += 31, ++count)
    sum_m += std::sqrt((person.colwise() - found.col(v)).colwise().squaredNorm().minCoeff());
  return sum_m / count;
}

/// Mean distance of the fitted surface from the person's, over the poses of the take, metres.
double SurfaceErrorM(const body::BodyFit& fit, const body::BodyTemplate& person,
                     const std::vector<body::ArticulatedPose>& poses) {
  double sum_m = 0;
  for (const auto& [frame, pose] : fit.person.seen) {
    const Eigen::Matrix3Xf truth = SkinVertices(person, ToBodyPose(person, poses[static_cast<size_t>(frame)]));
    sum_m += DistanceM(SkinVertices(fit.person.body, ToBodyPose(fit.person.body, pose)), truth);
  }
  return sum_m / static_cast<double>(fit.person.seen.size());
}

}  // namespace

int main() {
  const body::BodyTemplate person = Person();
  Rng rng(5);
  std::vector<body::FitStep> steps;
  std::vector<body::ArticulatedPose> poses;
  for (int i = 0; i < kNumSteps; ++i) {
    poses.push_back(SomePose(person, &rng));
    steps.push_back(Seen(person, poses.back(), i));
  }
  const body::BodyFit fit = FitBody(body::MakeMannequin(1.75, 0.5), steps, {}, {});
  const double error_m = SurfaceErrorM(fit, person, poses);
  std::printf("body: IoU of held-out silhouettes %.3f (the mannequin's %.3f), surface off by %.1f mm\n", fit.iou,
              fit.iou_before, 1e3 * error_m);
  return fit.status == Status::kOk && fit.iou > 0.9 && fit.iou > fit.iou_before + 0.02 && error_m < 0.015 ? 0 : 1;
}
