#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <map>

#include "calib/held_covariance.h"
#include "calib/keypoint_bundle.h"
#include "calib/point_problem.h"
#include "core/parallel.h"
#include "geometry/cross_matrix.h"
#include "geometry/lens_derivatives.h"

namespace mvstudio::calib {
namespace {

constexpr size_t kStretches = 10;

PointScene CamerasOf(const geometry::Rig& rig) {
  PointScene scene;
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    scene.lenses.push_back(rig.cameras[c].camera);
    scene.lens_of_camera.push_back(static_cast<int>(c));
    scene.cam_from_world.push_back(rig.cameras[c].cam_from_world);
  }
  return scene;
}

/// The equations of the cameras alone, points eliminated, from some of the joints.
struct Equations {
  bool ok = false;
  Eigen::MatrixXd h;
  Eigen::VectorXd g;
};

Equations Equate(const PointScene& cameras, const std::vector<const KeypointFit*>& fits, const PointBundleOptions& options,
                 double cauchy_px) {
  PointScene scene = cameras;
  scene.points.resize(3, static_cast<Eigen::Index>(fits.size()));
  std::vector<PointObservation> observations;
  for (size_t p = 0; p < fits.size(); ++p) {
    scene.points.col(static_cast<Eigen::Index>(p)) = fits[p]->x_in_world;
    for (const triangulate::Observation& seen : fits[p]->joint->seen)
      observations.push_back({seen.camera_idx, static_cast<int>(p), seen.px, 1});
  }
  PointProblem problem(scene, observations, options, PointProblem::Blocks::kPoints, cauchy_px);
  SchurSystem system;
  problem.AllocateSystem(&system);
  problem.Try(Eigen::VectorXd::Zero(system.g.size()), Eigen::MatrixXd::Zero(3, system.num_blocks()));
  Equations equations;
  equations.ok = problem.LinearizeTrial(&system);
  if (!equations.ok) return equations;
  // Points that only two far views hold along the ray are held by the least damping.
  const ReducedSystem reduced = Reduce(system, 1e-9, options.num_threads);
  equations.h = reduced.h.selfadjointView<Eigen::Lower>();
  equations.g = reduced.g;
  return equations;
}

/// Derivative of the centre -R^T t for R <- Exp(w) R, t <- t + s.
Eigen::Matrix<double, 3, 6> CentreFromPose(const geometry::Rigid3& cam_from_world) {
  const Eigen::Matrix3d world_r_cam = cam_from_world.rotation.toRotationMatrix().transpose();
  Eigen::Matrix<double, 3, 6> derivative;
  derivative << -world_r_cam * geometry::CrossMatrix(cam_from_world.translation), -world_r_cam;
  return derivative;
}

/// Rows that hold place, turn and size of the camera centres (turn: of the orientations where the centres lie on a line), over
/// the unknowns of the bundle.
Eigen::MatrixXd GaugeRows(const geometry::Rig& rig, const std::vector<int>& pose_column, Eigen::Index num_unknowns) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const geometry::RigCamera& camera : rig.cameras)
    mean += camera.CenterInWorld() / static_cast<double>(rig.cameras.size());
  const bool by_centres = CentresHoldFrame(rig);
  Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(7, num_unknowns);
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    const geometry::Rigid3& pose = rig.cameras[c].cam_from_world;
    const Eigen::Matrix3d world_r_cam = pose.rotation.toRotationMatrix().transpose();
    const Eigen::Matrix<double, 3, 6> centre = CentreFromPose(pose);
    Eigen::Matrix<double, 3, 6> turn = Eigen::Matrix<double, 3, 6>::Zero();  // R <- Exp(w) R turns the camera by R^T w in world
    turn.leftCols<3>() = world_r_cam;
    const Eigen::Vector3d arm = rig.cameras[c].CenterInWorld() - mean;
    rows.block<3, 6>(0, pose_column[c]) = centre;
    rows.block<3, 6>(3, pose_column[c]) = by_centres ? Eigen::Matrix<double, 3, 6>(geometry::CrossMatrix(arm) * centre) : turn;
    rows.block<1, 6>(6, pose_column[c]) = arm.transpose() * centre;
  }
  return rows;
}

/// Basis (n, n - rank) of what the rows leave free.
Eigen::MatrixXd NullSpace(const Eigen::MatrixXd& rows) {
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(rows, Eigen::ComputeFullV);
  const Eigen::Index rank = (svd.singularValues().array() > 1e-12 * svd.singularValues()[0]).count();
  return svd.matrixV().rightCols(rows.cols() - rank);
}

struct Layout {
  std::vector<int> lens_column, pose_column;  // in the bundle's unknowns
  std::vector<Eigen::MatrixXd> directions;
};

Layout LayOut(const PointScene& cameras, const PointBundleOptions& options) {
  const std::vector<PointObservation> none;
  PointScene empty = cameras;
  empty.points.resize(3, 0);
  const PointProblem problem(empty, none, options, PointProblem::Blocks::kPoints, 0);
  Layout layout;
  for (int c = 0; c < static_cast<int>(cameras.lenses.size()); ++c) {
    layout.lens_column.push_back(problem.lens_column(c));
    layout.pose_column.push_back(problem.camera_column(c));
    layout.directions.push_back(problem.directions(c));
  }
  return layout;
}

/// One observation's derivatives by the bundle's unknowns (rows of `by_unknowns`) and by its point, and the curvature of its
/// cost.
struct Derivatives {
  Eigen::Matrix<double, 2, 3> by_point;
  Eigen::Matrix2d curvature;
};

Derivatives Differentiate(const geometry::RigCamera& camera, const KeypointFit& fit, size_t view, const Layout& layout,
                          double cauchy_px, Eigen::Ref<Eigen::MatrixXd> by_unknowns) {
  const auto c = static_cast<size_t>(fit.joint->seen[view].camera_idx);
  const Eigen::Vector3d turned = camera.cam_from_world.rotation * fit.x_in_world;
  geometry::LensDerivatives d;
  Eigen::Vector2d px;
  Derivatives out;
  geometry::ProjectLens(camera.camera, turned + camera.cam_from_world.translation, &px, &d);
  out.by_point = d.d_px_d_x_in_cam * camera.cam_from_world.rotation.toRotationMatrix();
  if (layout.pose_column[c] >= 0) {
    by_unknowns.middleCols<3>(layout.pose_column[c]) = -d.d_px_d_x_in_cam * geometry::CrossMatrix(turned);
    by_unknowns.middleCols<3>(layout.pose_column[c] + 3) = d.d_px_d_x_in_cam;
  }
  const Eigen::MatrixXd& directions = layout.directions[c];
  for (int k = 0; layout.lens_column[c] >= 0 && k < d.count; ++k)
    by_unknowns.middleCols(layout.lens_column[c], directions.cols()) +=
        d.d_px.col(k) * directions.row(d.columns[static_cast<size_t>(k)]);
  const Eigen::Vector2d r = fit.residuals_px[view] / cauchy_px;
  const double weight = 1 / (1 + r.squaredNorm());
  out.curvature = weight * Eigen::Matrix2d::Identity() - 2 * weight * weight * r * r.transpose();
  return out;
}

/// Half the second derivatives of the cost, as a function of the cameras with every point at its best: not those of the
/// weighted squares, which are too large where views disagree.
Eigen::MatrixXd CurvatureOf(const geometry::Rig& rig, const std::vector<const KeypointFit*>& fits, const Layout& layout,
                            Eigen::Index num_unknowns, double cauchy_px) {
  Eigen::MatrixXd h = Eigen::MatrixXd::Zero(num_unknowns, num_unknowns);
  for (const KeypointFit* fit : fits) {
    const auto rows = 2 * static_cast<Eigen::Index>(fit->joint->seen.size());
    Eigen::MatrixXd by_unknowns = Eigen::MatrixXd::Zero(rows, num_unknowns), curved = by_unknowns;
    Eigen::Matrix<double, 3, Eigen::Dynamic> mixed = Eigen::MatrixXd::Zero(3, num_unknowns);
    Eigen::Matrix3d of_point = Eigen::Matrix3d::Zero();
    for (size_t view = 0; view < fit->joint->seen.size(); ++view) {
      const auto c = static_cast<size_t>(fit->joint->seen[view].camera_idx);
      auto own = by_unknowns.middleRows(2 * static_cast<Eigen::Index>(view), 2);
      const Derivatives d = Differentiate(rig.cameras[c], *fit, view, layout, cauchy_px, own);
      curved.middleRows(2 * static_cast<Eigen::Index>(view), 2) = d.curvature * own;
      mixed += d.by_point.transpose() * d.curvature * own;
      of_point += d.by_point.transpose() * d.curvature * d.by_point;
    }
    const Eigen::LDLT<Eigen::Matrix3d> factor(of_point);
    if (!factor.isPositive() || !(factor.vectorD().minCoeff() > 1e-9 * factor.vectorD().maxCoeff())) continue;
    h += by_unknowns.transpose() * curved - mixed.transpose() * factor.solve(mixed);
  }
  return h;
}

/// Solutions without one of up to ten stretches of time, in the frame of the whole solution.
std::vector<geometry::Rig> LeaveOutStretches(const KeypointSolution& solution, const std::vector<KeypointJoint>& joints,
                                             const KeypointFreedom& freedom, int num_threads) {
  std::map<int, size_t> rank;
  for (const int frame : FramesOf(joints)) rank.emplace(frame, rank.size());
  const size_t count = std::min(kStretches, rank.size());
  const bool held = std::any_of(freedom.fix_pose.begin(), freedom.fix_pose.end(), [](bool fixed) { return fixed; });
  std::vector<geometry::Rig> rigs(count);
  ParallelFor(static_cast<int64_t>(count), num_threads, [&](int64_t i) {
    std::vector<KeypointJoint> rest;
    for (const KeypointJoint& joint : joints)
      if (rank.at(joint.frame) * count / rank.size() != static_cast<size_t>(i)) rest.push_back(joint);
    geometry::Rig& rig = rigs[static_cast<size_t>(i)];
    rig = SolveKeypoints(solution.rig, rest, freedom, solution.cauchy_px, 1).rig;
    if (!held) rig = AlignToGiven(rig, solution.rig);
  });
  return rigs;
}

/// `rig` minus `reference` in the bundle's unknowns.
Eigen::VectorXd Difference(const geometry::Rig& rig, const geometry::Rig& reference, const Layout& layout,
                           Eigen::Index num_unknowns) {
  Eigen::VectorXd off = Eigen::VectorXd::Zero(num_unknowns);
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

Eigen::MatrixXd Spread(const geometry::Rig& rig, const std::vector<int>& begin, const Layout& layout,
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

/// The unknowns of a bundle together with the given lenses and the held poses whose errors are known: a lens has the directions that
/// were adjusted and then all its parameters.
struct WithGiven {
  Layout layout;
  std::vector<Eigen::Index> estimated, held;
  Eigen::MatrixXd held_covariance;
  Eigen::Index size = 0;
};

/// Sets what is known of each camera: what was adjusted in whole, and what is given. Lenses of another model were not given.
WithGiven AddGiven(const geometry::Rig& rig, const Layout& own, Eigen::Index num_unknowns, const geometry::Rig* given,
                   KeypointCovariance* out) {
  WithGiven all;
  all.layout = own, all.estimated.resize(static_cast<size_t>(num_unknowns));
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
  all.held_covariance = rows.empty() ? Eigen::MatrixXd(0, 0) : Eigen::MatrixXd(stated.joint(rows, rows));
  return all;
}

}  // namespace

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
  const std::vector<KeypointFit> fits = FitKeypoints(solution.rig, joints, solution.cauchy_px, 2, num_threads);
  std::vector<const KeypointFit*> all;
  for (const KeypointFit& fit : fits)
    if (fit.ok) all.push_back(&fit);
  PointBundleOptions options;
  options.fix_camera = freedom.fix_pose, options.lens_directions = freedom.lens_directions, options.num_threads = num_threads;
  const PointScene cameras = CamerasOf(solution.rig);
  const Equations whole = Equate(cameras, all, options, solution.cauchy_px);
  if (!whole.ok) return degenerate("a joint does not project at the solution");
  const Layout layout = LayOut(cameras, options);
  const Eigen::Index n = whole.h.rows();
  const Eigen::MatrixXd h = CurvatureOf(solution.rig, all, layout, n, solution.cauchy_px);
  const Eigen::VectorXd scale = whole.h.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  Eigen::MatrixXd basis = Eigen::MatrixXd::Identity(n, n);
  if (std::none_of(freedom.fix_pose.begin(), freedom.fix_pose.end(), [](bool fixed) { return fixed; }))
    basis = NullSpace(GaugeRows(solution.rig, layout.pose_column, n) * scale.asDiagonal());
  const Eigen::MatrixXd held = basis.transpose() * scale.asDiagonal() * h * scale.asDiagonal() * basis;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(held);
  constexpr double kSmallest = 1e-10;  // of equations with unit diagonal
  if (!(eigen.eigenvalues()[0] > kSmallest)) return degenerate("the joints do not hold all cameras in place");
  const Eigen::MatrixXd to_unknowns = scale.asDiagonal() * basis;
  const Eigen::MatrixXd inverse = to_unknowns * eigen.eigenvectors() * eigen.eigenvalues().cwiseInverse().asDiagonal() *
                                  eigen.eigenvectors().transpose() * to_unknowns.transpose();
  const std::vector<geometry::Rig> rigs = LeaveOutStretches(solution, joints, freedom, num_threads);
  double sum = 0;
  for (const geometry::Rig& rig : rigs) {
    const Eigen::VectorXd off =
        basis.transpose() * scale.cwiseInverse().asDiagonal() * Difference(rig, solution.rig, layout, n);
    sum += off.dot(held * off);
  }
  // Jackknife: the variance is (n - 1) / n times the sum of squares of the solutions that leave one of n stretches out.
  const double left_out = static_cast<double>(rigs.size());
  const double factor = sum * (left_out - 1) / left_out / static_cast<double>(basis.cols());
  const Eigen::MatrixXd covariance = factor * inverse;
  out.begin.assign(1, 0);
  for (const geometry::RigCamera& camera : solution.rig.cameras)
    out.begin.push_back(out.begin.back() + static_cast<int>(camera.camera.params.size()) + 6);
  out.joint = out.from_joints = Spread(solution.rig, out.begin, layout, covariance);
  const WithGiven with = AddGiven(solution.rig, layout, n, given, &out);
  if (with.held.empty()) return out;
  const Eigen::MatrixXd normal = CurvatureOf(solution.rig, all, with.layout, with.size, solution.cauchy_px);
  out.joint = Spread(solution.rig, out.begin, with.layout,
                     CovarianceWithHeld(normal, with.estimated, with.held, inverse, covariance, with.held_covariance));
  return out;
}

}  // namespace mvstudio::calib
