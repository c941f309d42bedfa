#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <map>

#include "calib/covariance/held_covariance.h"
#include "calib/keypoints/bundle.h"
#include "calib/keypoints/profile.h"
#include "core/parallel.h"
#include "geometry/rigid/cross_matrix.h"

namespace mvstudio::calib {
namespace {

constexpr size_t kStretches = 10;

/// The joints without those of one stretch.
std::vector<KeypointJoint> Without(const std::vector<KeypointFit>& fits, const std::vector<int>& stretch_of_fit, int stretch) {
  std::vector<KeypointJoint> rest;
  for (size_t f = 0; f < fits.size(); ++f)
    if (stretch_of_fit[f] != stretch) rest.push_back(*fits[f].joint);
  return rest;
}

/// Solutions without one of the intervals of time, in the frame of the whole solution.
std::vector<geometry::Rig> LeaveOutStretches(const KeypointProfile& profile, const KeypointFreedom& freedom, int num_threads) {
  const bool held = std::any_of(freedom.fix_pose.begin(), freedom.fix_pose.end(), [](bool fixed) { return fixed; });
  std::vector<geometry::Rig> rigs(profile.h.size());
  ParallelFor(static_cast<int64_t>(rigs.size()), num_threads, [&](int64_t i) {
    geometry::Rig& rig = rigs[static_cast<size_t>(i)];
    std::vector<bool> left_out(rigs.size(), false);
    left_out[static_cast<size_t>(i)] = true;
    if (const auto solved = SolveWithout(profile, left_out)) {
      rig = *solved;
    } else {
      const auto rest = Without(profile.fits, profile.group_of_fit, static_cast<int>(i));
      rig = SolveKeypoints(profile.rig, rest, freedom, profile.cauchy_px, 1).rig;
    }
    if (!held) rig = AlignToGiven(rig, profile.rig);
  });
  return rigs;
}

/// `rig` minus `reference` in the cameras' unknowns.
Eigen::VectorXd Difference(const geometry::Rig& rig, const geometry::Rig& reference, const KeypointLayout& layout) {
  Eigen::VectorXd off = Eigen::VectorXd::Zero(layout.total);
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    const geometry::Rigid3 &a = rig.cameras[c].cam_from_world, &b = reference.cameras[c].cam_from_world;
    const Eigen::MatrixXd& d = layout.directions[c];
    if (layout.pose_column[c] >= 0) {
      off.segment<3>(layout.pose_column[c]) = geometry::RotationLog((a.rotation * b.rotation.conjugate()).normalized());
      off.segment<3>(layout.pose_column[c] + 3) = a.translation - b.translation;
    }
    if (layout.lens_column[c] >= 0)
      off.segment(layout.lens_column[c], d.cols()) =
          d.colPivHouseholderQr().solve(rig.cameras[c].camera.params - reference.cameras[c].camera.params);
  }
  return off;
}

Eigen::MatrixXd Spread(const geometry::Rig& rig, const std::vector<int>& begin, const KeypointLayout& layout,
                       const Eigen::MatrixXd& covariance) {
  Eigen::MatrixXd all_from_unknowns = Eigen::MatrixXd::Zero(begin.back(), covariance.rows());
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    const Eigen::MatrixXd& d = layout.directions[c];
    const Eigen::Index pose_row = begin[c + 1] - 6;
    if (layout.lens_column[c] >= 0) all_from_unknowns.block(begin[c], layout.lens_column[c], d.rows(), d.cols()) = d;
    if (layout.pose_column[c] >= 0) all_from_unknowns.block<6, 6>(pose_row, layout.pose_column[c]).setIdentity();
  }
  return all_from_unknowns * covariance * all_from_unknowns.transpose();
}

/// The unknowns of a bundle together with the given lenses and the held poses whose errors are known: a lens has the directions
/// that were adjusted and then all its parameters.
struct WithGiven {
  KeypointLayout layout;
  std::vector<Eigen::Index> estimated, held;
  Eigen::MatrixXd held_covariance;
  Eigen::Index size = 0;
};

/// Sets what is known of each camera: what was adjusted in whole, and what is given. Lenses of another model were not given.
WithGiven AddGiven(const geometry::Rig& rig, const KeypointLayout& own, const geometry::Rig* given, KeypointCovariance* out) {
  WithGiven all;
  all.layout = own, all.estimated.resize(static_cast<size_t>(own.total));
  const geometry::StatedCovariance stated = given ? geometry::StatedCovarianceOf(*given) : geometry::StatedCovariance();
  std::vector<Eigen::Index> rows;  // of the held columns, in `stated`
  const auto hold = [&](Eigen::Index first_row, Eigen::Index count) {
    for (Eigen::Index i = 0; i < count; ++i) all.held.push_back(all.size++), rows.push_back(first_row + i);
  };
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    const Eigen::MatrixXd& d = own.directions[c];
    const Eigen::Index p = rig.cameras[c].camera.params.size(), free = own.lens_column[c] >= 0 ? d.cols() : 0;
    const bool whole = free == p, same = given && given->cameras[c].camera.model == rig.cameras[c].camera.model;
    const bool hold_lens = !whole && same && stated.lens_known[c];
    all.layout.lens_column[c] = free > 0 || hold_lens ? static_cast<int>(all.size) : -1;
    for (Eigen::Index i = 0; i < free; ++i) all.estimated[static_cast<size_t>(own.lens_column[c] + i)] = all.size++;
    if (hold_lens) {
      all.layout.directions[c] = Eigen::MatrixXd::Identity(p, p);
      if (free > 0) all.layout.directions[c] = (Eigen::MatrixXd(p, free + p) << d, Eigen::MatrixXd::Identity(p, p)).finished();
      hold(stated.begin[c], p);
    }
    const bool free_pose = own.pose_column[c] >= 0, hold_pose = !free_pose && given && stated.pose_known[c];
    all.layout.pose_column[c] = free_pose || hold_pose ? static_cast<int>(all.size) : -1;
    for (int i = 0; free_pose && i < 6; ++i) all.estimated[static_cast<size_t>(own.pose_column[c] + i)] = all.size++;
    if (hold_pose) hold(stated.PoseRow(c), 6);
    out->lens_known.push_back(whole || hold_lens), out->pose_known.push_back(free_pose || hold_pose);
  }
  all.layout.total = static_cast<int>(all.size);
  all.held_covariance = rows.empty() ? Eigen::MatrixXd(0, 0) : Eigen::MatrixXd(stated.joint(rows, rows));
  return all;
}

/// The interval of time, of `count`, that contains each fit.
std::vector<int> StretchOf(const std::vector<KeypointFit>& fits, const std::vector<int>& frames, size_t count) {
  std::map<int, size_t> rank;
  for (const int frame : frames) rank.emplace(frame, rank.size());
  std::vector<int> stretch;
  for (const KeypointFit& fit : fits) stretch.push_back(static_cast<int>(rank.at(fit.joint->frame) * count / rank.size()));
  return stretch;
}

double SmallestEigenvalue(const Eigen::MatrixXd& matrix) {
  return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(matrix, Eigen::EigenvaluesOnly).eigenvalues()[0];
}

/// Whether a cost's curvature has the shape of its data in every direction. Near a bad solution, and where views disagree, it
/// vanishes or turns down along some, which then says nothing about what the data determine.
bool IsCurved(const Eigen::MatrixXd& curved, const Eigen::MatrixXd& geometry) {
  constexpr double kLeastShare = 0.05;
  if (!curved.allFinite()) return false;
  const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> eigen(curved, geometry,
                                                                        Eigen::EigenvaluesOnly | Eigen::Ax_lBx);
  return eigen.info() == Eigen::Success && eigen.eigenvalues()[0] > kLeastShare;
}

/// Inverse within the motions, over all unknowns.
Eigen::MatrixXd InverseOf(const Eigen::MatrixXd& of_motions, const Eigen::MatrixXd& motions) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(of_motions);
  return motions * eigen.eigenvectors() * eigen.eigenvalues().cwiseInverse().asDiagonal() * eigen.eigenvectors().transpose() *
         motions.transpose();
}

}  // namespace

Eigen::Matrix<double, 3, 6> CentreFromPose(const geometry::Rigid3& cam_from_world) {
  const Eigen::Matrix3d world_r_cam = cam_from_world.rotation.toRotationMatrix().transpose();
  Eigen::Matrix<double, 3, 6> derivative;
  derivative << -world_r_cam * geometry::CrossMatrix(cam_from_world.translation), -world_r_cam;
  return derivative;
}

Eigen::Matrix3d CentreCovariance(const geometry::Rigid3& cam_from_world, const Eigen::Matrix<double, 6, 6>& covariance) {
  const Eigen::Matrix<double, 3, 6> derivative = CentreFromPose(cam_from_world);
  return derivative * covariance * derivative.transpose();
}

KeypointCovariance CovarianceOfKeypoints(const KeypointSolution& solution, const std::vector<KeypointJoint>& joints,
                                         const KeypointFreedom& freedom, int num_threads, const geometry::Rig* given) {
  KeypointCovariance out;
  const auto degenerate = [&](const char* message) {
    out.status = Status::kDegenerate, out.message = message;
    return out;
  };
  std::vector<KeypointFit> fits = FitKeypoints(solution.rig, joints, solution.cauchy_px, 2, num_threads);
  const std::vector<int> frames = FramesOf(joints);
  const size_t count = std::min(kStretches, frames.size());
  if (count < 2 || !(solution.cauchy_px > 0)) return degenerate("too few frames to estimate the cameras' uncertainty");
  std::vector<int> stretch_of_fit = StretchOf(fits, frames, count);
  const KeypointProfile profile = ProfileOf(solution.rig, std::move(fits), std::move(stretch_of_fit), static_cast<int>(count),
                                            freedom, solution.cauchy_px, num_threads);
  const Eigen::MatrixXd& motions = profile.motions;
  const Eigen::MatrixXd geometry = motions.transpose() * CurvatureUnder(profile, profile.layout, true) * motions;
  constexpr double kSmallest = 1e-10;  // of equations with unit diagonal
  if (!geometry.allFinite() || geometry.rows() == 0 || !(SmallestEigenvalue(geometry) > kSmallest))
    return degenerate("the joints that fit together do not determine all camera poses");
  const Eigen::MatrixXd curved = motions.transpose() * CurvatureWithout(profile, std::vector<bool>(count, false)) * motions;
  const bool by_inliers = !IsCurved(curved, geometry);
  const Eigen::MatrixXd& held = by_inliers ? geometry : curved;
  out.from_geometry = profile.cauchy_px * profile.cauchy_px * InverseOf(geometry, motions);
  const Eigen::MatrixXd inverse = InverseOf(held, motions);
  const std::vector<geometry::Rig> rigs = LeaveOutStretches(profile, freedom, num_threads);
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> by_motions(motions);
  double sum = 0;
  for (const geometry::Rig& rig : rigs) {
    const Eigen::VectorXd off = by_motions.solve(Difference(rig, solution.rig, profile.layout));
    sum += off.dot(held * off);
  }
  // Jackknife: the variance is (n - 1) / n times the sum of squares of the solutions that leave one of n stretches out.
  const auto left_out = static_cast<double>(rigs.size());
  const double factor = sum * (left_out - 1) / left_out / static_cast<double>(motions.cols());
  const Eigen::MatrixXd covariance = factor * inverse;
  out.begin.assign(1, 0);
  for (const geometry::RigCamera& camera : solution.rig.cameras)
    out.begin.push_back(out.begin.back() + static_cast<int>(camera.camera.params.size()) + 6);
  out.joint = out.from_joints = Spread(solution.rig, out.begin, profile.layout, covariance);
  out.from_geometry = Spread(solution.rig, out.begin, profile.layout, out.from_geometry);
  const WithGiven with = AddGiven(solution.rig, profile.layout, given, &out);
  if (with.held.empty()) return out;
  const Eigen::MatrixXd normal = CurvatureUnder(profile, with.layout, by_inliers);
  out.joint = Spread(solution.rig, out.begin, with.layout,
                     CovarianceWithHeld(normal, with.estimated, with.held, inverse, covariance, with.held_covariance));
  return out;
}

}  // namespace mvstudio::calib
