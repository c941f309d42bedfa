#include "synth/detections.h"

#include "core/random.h"

namespace mvstudio::synth {

dataset::Person2d DetectJoints(const BodyScene& scene, const geometry::RigCamera& camera, const geometry::Skeleton& skeleton,
                               const Eigen::Matrix3Xd& joints_in_world, double noise_px, uint64_t seed) {
  constexpr double kFaceDepth = 0.05, kLimbDepth = 0.16;  // m of body that may cover a joint that is still visible
  const geometry::Projector projector(camera.camera);
  const Eigen::Vector3d eye = camera.CenterInWorld();
  Rng rng(seed);
  dataset::Person2d person;
  for (size_t j = 0; j < skeleton.joints.size(); ++j) {
    const double noise_x = noise_px * rng.Normal(), noise_y = noise_px * rng.Normal();
    dataset::Keypoint2d point;
    const geometry::Projection p = projector.Project(camera.cam_from_world * Eigen::Vector3d(joints_in_world.col(j)));
    if (p.status == Status::kOk && geometry::InImage(camera.camera, p.px)) {
      const std::string& name = skeleton.joints[j];
      const bool face = name == "Nose" || name.find("Eye") != std::string::npos || name.find("Ear") != std::string::npos;
      const bool hidden = scene.DepthBehindSurface(eye, joints_in_world.col(j)) > (face ? kFaceDepth : kLimbDepth);
      if (!(face && hidden)) point = {p.px[0] + noise_x, p.px[1] + noise_y, hidden ? 0.4 : 0.9};
    }
    person.keypoints.push_back(point);
  }
  return person;
}

}  // namespace mvstudio::synth
