#include "calib/points/scene_carry.h"

#include "geometry/rigid/cross_matrix.h"

namespace mvstudio::calib {
namespace {

using Eigen::Index;

/// Perturbation of cam_from_world = cam_from_rig * rig_from_world by those of the two.
struct PoseChain {
  Eigen::Matrix<double, 6, 6> by_cam_from_rig = Eigen::Matrix<double, 6, 6>::Identity();
  Eigen::Matrix<double, 6, 6> by_rig_from_world = Eigen::Matrix<double, 6, 6>::Zero();
};

PoseChain ChainOf(const geometry::Rigid3& cam_from_rig, const geometry::Rigid3& rig_from_world) {
  PoseChain chain;
  const Eigen::Matrix3d r = cam_from_rig.rotation.toRotationMatrix();
  chain.by_rig_from_world.topLeftCorner<3, 3>() = chain.by_rig_from_world.bottomRightCorner<3, 3>() = r;
  chain.by_cam_from_rig.bottomLeftCorner<3, 3>() = -geometry::CrossMatrix(Eigen::Vector3d(r * rig_from_world.translation));
  return chain;
}

/// What is given (P0 lens parameters and a pose a camera) in the columns of the resection (P, which may be more, and a pose).
Eigen::MatrixXd GivenOfResection(const geometry::StatedCovariance& stated, const std::vector<size_t>& indices,
                                 const PointResection& resection) {
  Index rows = 0, row = 0;
  for (const geometry::Camera& camera : resection.cameras) rows += camera.params.size() + 6;
  Eigen::MatrixXd pick = Eigen::MatrixXd::Zero(rows, stated.joint.rows());
  for (size_t k = 0; k < indices.size(); ++k) {
    const Index first = stated.begin[indices[k]], pose = stated.PoseRow(indices[k]), p = resection.cameras[k].params.size();
    pick.block(row, first, pose - first, pose - first).setIdentity();
    pick.block<6, 6>(row + p, pose).setIdentity();
    row += p + 6;
  }
  return pick;
}

}  // namespace

PlacedCovariance::PlacedCovariance(const geometry::Rig& given, bool rigid)
    : given_(given), rigid_(rigid), stated_(geometry::StatedCovarianceOf(given)) {
  by_given_.resize(0, stated_.joint.rows());
  for (size_t c = 0; c < given.cameras.size() && !rigid; ++c) {
    stated_.joint.middleRows<6>(stated_.PoseRow(c)).setZero();
    stated_.joint.middleCols<6>(stated_.PoseRow(c)).setZero();
  }
}

void PlacedCovariance::Add(const std::vector<size_t>& indices, const PointResection& resection) {
  const Eigen::MatrixXd given = GivenOfResection(stated_, indices, resection), unknowns = resection.unknowns_by_given * given;
  Eigen::MatrixXd by_given = given, by_unknowns = Eigen::MatrixXd::Zero(given.rows(), unknowns.rows());
  Index row = 0, column = 6;
  for (size_t k = 0; k < indices.size(); ++k) {
    const geometry::RigCamera& camera = given_.cameras[indices[k]];
    const Eigen::MatrixXd& directions = resection.lens_directions[k];
    const Index p = resection.cameras[k].params.size();
    const PoseChain chain = ChainOf(rigid_ ? camera.cam_from_world : geometry::Rigid3(), resection.rig_from_world);
    if (directions.cols() > 0) by_unknowns.block(row, column, p, directions.cols()) = directions;
    by_unknowns.block<6, 6>(row + p, 0) = chain.by_rig_from_world;
    by_given.middleRows<6>(row + p) = chain.by_cam_from_rig * given.middleRows<6>(row + p);
    row += p + 6, column += directions.cols();
    begin_.push_back(begin_.back() + p + 6);
    lens_known_.push_back(stated_.lens_known[indices[k]]);
    if (!lens_known_.back() || (rigid_ && !stated_.pose_known[indices[k]])) unknown_.push_back(camera.camera.name);
  }
  by_given += by_unknowns * unknowns;
  const Index before = by_given_.rows(), after = before + row;
  by_given_.conservativeResize(after, Eigen::NoChange);
  by_given_.bottomRows(row) = by_given;
  own_.conservativeResizeLike(Eigen::MatrixXd::Zero(after, after));
  own_.bottomRightCorner(row, row) = by_unknowns * resection.unknowns_covariance * by_unknowns.transpose();
}

geometry::StatedCovariance PlacedCovariance::Joint() const {
  geometry::StatedCovariance out;
  out.joint = by_given_ * stated_.joint * by_given_.transpose() + own_;
  out.begin = begin_, out.lens_known = lens_known_, out.correlated = true;
  out.pose_known.assign(lens_known_.size(), true);
  for (size_t c = 0; c < lens_known_.size(); ++c) {
    if (lens_known_[c]) continue;
    const Index count = out.PoseRow(c) - out.begin[c];
    out.joint.middleRows(out.begin[c], count).setZero();
    out.joint.middleCols(out.begin[c], count).setZero();
  }
  return out;
}

}  // namespace mvstudio::calib
