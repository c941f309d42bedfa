#include <cmath>

#include "calib/keypoints/bundle.h"
#include "geometry/rig/alignment.h"
#include "geometry/rigid/decompositions.h"

namespace mvstudio::calib {
namespace {

Eigen::Matrix3Xd Centres(const geometry::Rig& rig) {
  Eigen::Matrix3Xd centres(3, static_cast<Eigen::Index>(rig.cameras.size()));
  for (size_t c = 0; c < rig.cameras.size(); ++c) centres.col(static_cast<Eigen::Index>(c)) = rig.cameras[c].CenterInWorld();
  return centres;
}

geometry::Alignment AlignByOrientation(const geometry::Rig& rig, const geometry::Rig& given) {
  const Eigen::Matrix3Xd a = Centres(rig), b = Centres(given);
  const Eigen::Vector3d mean_a = a.rowwise().mean(), mean_b = b.rowwise().mean();
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (size_t c = 0; c < rig.cameras.size(); ++c)
    sum += (given.cameras[c].cam_from_world.rotation.conjugate() * rig.cameras[c].cam_from_world.rotation).toRotationMatrix();
  geometry::Alignment alignment;
  const double size_a = (a.colwise() - mean_a).norm(), size_b = (b.colwise() - mean_b).norm();
  alignment.scale = size_a > 0 && size_b > 0 ? size_b / size_a : 1;
  if (sum.determinant() > 0) alignment.b_from_a.rotation = geometry::NearestRotation(sum);
  alignment.b_from_a.translation = mean_b - alignment.scale * (alignment.b_from_a.rotation * mean_a);
  return alignment;
}

}  // namespace

bool CentresHoldFrame(const geometry::Rig& rig) {
  const Eigen::Matrix3Xd centres = Centres(rig);
  if (centres.cols() < 3) return false;
  const Eigen::Vector3d mean = centres.rowwise().mean();
  const Eigen::MatrixXd centred = (centres.colwise() - mean).transpose();
  const Eigen::VectorXd sizes = geometry::SingularValues(centred);
  constexpr double kThinnest = 0.05;  // of the longest extent
  return sizes[1] > kThinnest * sizes[0];
}

geometry::Rig AlignToGiven(const geometry::Rig& rig, const geometry::Rig& given) {
  geometry::Alignment alignment;
  alignment.status = Status::kDegenerate;
  if (CentresHoldFrame(given)) alignment = geometry::AlignPoints(Centres(rig), Centres(given), true);
  if (alignment.status != Status::kOk) alignment = AlignByOrientation(rig, given);
  geometry::Rig aligned = rig;
  for (geometry::RigCamera& camera : aligned.cameras) {
    const Eigen::Vector3d centre =
        alignment.b_from_a.rotation * (alignment.scale * camera.CenterInWorld()) + alignment.b_from_a.translation;
    camera.cam_from_world.rotation = (camera.cam_from_world.rotation * alignment.b_from_a.rotation.conjugate()).normalized();
    camera.cam_from_world.translation = -(camera.cam_from_world.rotation * centre);
  }
  return aligned;
}

}  // namespace mvstudio::calib
