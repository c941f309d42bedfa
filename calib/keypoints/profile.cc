#include "calib/keypoints/profile.h"

#include <Eigen/Cholesky>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

#include "calib/points/point_bundle.h"
#include "core/check.h"
#include "core/parallel.h"
#include "geometry/lens/lens_derivatives.h"
#include "geometry/rigid/cross_matrix.h"

namespace mvstudio::calib {
namespace {

using Matrix2X = Eigen::Matrix<double, 2, Eigen::Dynamic>;

bool AllFree(const KeypointFreedom& freedom) {
  return std::none_of(freedom.fix_pose.begin(), freedom.fix_pose.end(), [](bool fixed) { return fixed; });
}

/// Own columns of a camera: those of its lens, then six of its pose.
std::vector<int> ColumnsOf(const KeypointLayout& layout, size_t camera) {
  std::vector<int> columns;
  for (int k = 0; k < layout.directions[camera].cols(); ++k) columns.push_back(layout.lens_column[camera] + k);
  for (int k = 0; layout.pose_column[camera] >= 0 && k < 6; ++k) columns.push_back(layout.pose_column[camera] + k);
  return columns;
}

/// One view's derivatives by its camera's own unknowns and by the point.
struct ViewDerivatives {
  Matrix2X by_camera;
  Eigen::Matrix<double, 2, 3> by_point;
};

bool Differentiate(const geometry::RigCamera& camera, const Eigen::Vector3d& x_in_world, const Eigen::MatrixXd& directions,
                   bool free_pose, ViewDerivatives* out) {
  const Eigen::Matrix3d cam_r_world = camera.cam_from_world.rotation.toRotationMatrix();
  const Eigen::Vector3d rotated = cam_r_world * x_in_world;
  geometry::LensDerivatives d;
  Eigen::Vector2d px;
  if (!geometry::ProjectLens(camera.camera, rotated + camera.cam_from_world.translation, &px, &d)) return false;
  const Eigen::Index lens = directions.cols();
  out->by_camera.setZero(2, lens + (free_pose ? 6 : 0));
  for (int i = 0; lens > 0 && i < d.count; ++i)
    out->by_camera.leftCols(lens) += d.d_px.col(i) * directions.row(d.columns[static_cast<size_t>(i)]);
  if (free_pose) {
    out->by_camera.middleCols<3>(lens) = -d.d_px_d_x_in_cam * geometry::CrossMatrix(rotated);
    out->by_camera.middleCols<3>(lens + 3) = d.d_px_d_x_in_cam;
  }
  out->by_point = d.d_px_d_x_in_cam * cam_r_world;
  return true;
}

/// Sums of one group.
class GroupSum {
 public:
  GroupSum(const geometry::Rig& rig, const KeypointLayout& layout, double cauchy_px, bool of_inliers = false)
      : rig_(rig), layout_(layout), cauchy_px_(cauchy_px), of_inliers_(of_inliers) {
    h.setZero(layout.total, layout.total);
    g.setZero(layout.total);
    diagonal.setZero(layout.total);
    for (size_t c = 0; c < rig.cameras.size(); ++c) columns_of_.push_back(ColumnsOf(layout, c));
  }

  void Add(const KeypointFit& fit) {
    if (!fit.ok || !Differentiate(fit)) return;
    Eigen::Matrix3d of_point = Eigen::Matrix3d::Zero();
    for (size_t v = 0; v < views_.size(); ++v) of_point += views_[v].by_point.transpose() * curvature_[v] * views_[v].by_point;
    const Eigen::LLT<Eigen::Matrix3d> factor(of_point);
    constexpr double kThinnest = 1e-9;  // of the largest pivot
    const Eigen::Array3d pivots = Eigen::Matrix3d(factor.matrixL()).diagonal().array().square();
    if (factor.info() != Eigen::Success || !(pivots.minCoeff() > kThinnest * pivots.maxCoeff())) return;
    AddOwn(fit);
    Eliminate(factor);
  }

  Eigen::MatrixXd h;  // lower
  Eigen::VectorXd g, diagonal;

 private:
  bool Differentiate(const KeypointFit& fit) {
    const auto& seen = fit.joint->seen;
    views_.resize(seen.size()), curvature_.resize(seen.size());
    for (size_t v = 0; v < seen.size(); ++v) {
      const auto c = static_cast<size_t>(seen[v].camera_idx);
      if (!calib::Differentiate(rig_.cameras[c], fit.x_in_world, layout_.directions[c], layout_.pose_column[c] >= 0,
                                &views_[v]))
        return false;
      const Eigen::Vector2d r = fit.residuals_px[v] / cauchy_px_;
      const double weight = 1 / (1 + r.squaredNorm());
      curvature_[v].setZero();
      if (of_inliers_ && r.norm() <= kInlierScales) curvature_[v].setIdentity();
      if (!of_inliers_) curvature_[v] = weight * Eigen::Matrix2d::Identity() - 2 * weight * weight * r * r.transpose();
    }
    return true;
  }

  /// What each view adds to its own camera.
  void AddOwn(const KeypointFit& fit) {
    mixed_columns_.clear();
    for (size_t v = 0; v < views_.size(); ++v) {
      const std::vector<int>& columns = columns_of_[static_cast<size_t>(fit.joint->seen[v].camera_idx)];
      mixed_columns_.insert(mixed_columns_.end(), columns.begin(), columns.end());
    }
    mixed_.resize(3, static_cast<Eigen::Index>(mixed_columns_.size()));
    Eigen::Index at = 0;
    for (size_t v = 0; v < views_.size(); ++v) {
      const Matrix2X& j = views_[v].by_camera;
      if (j.cols() == 0) continue;
      const Matrix2X curved = curvature_[v] * j;
      const Eigen::Vector2d r = fit.residuals_px[v];
      const double weight = 1 / (1 + r.squaredNorm() / (cauchy_px_ * cauchy_px_));
      const int* columns = mixed_columns_.data() + at;
      for (Eigen::Index a = 0; a < j.cols(); ++a) {
        for (Eigen::Index b = 0; b < j.cols(); ++b)
          if (columns[b] >= columns[a]) h(columns[b], columns[a]) += j.col(b).dot(curved.col(a));
        g[columns[a]] -= weight * j.col(a).dot(r);  // residuals are observed minus projected
        diagonal[columns[a]] += weight * j.col(a).squaredNorm();
      }
      mixed_.middleCols(at, j.cols()) = views_[v].by_point.transpose() * curved;
      at += j.cols();
    }
  }

  void Eliminate(const Eigen::LLT<Eigen::Matrix3d>& factor) {
    if (mixed_.cols() == 0) return;  // seen by fixed cameras alone
    factor.matrixL().solveInPlace(mixed_);
    for (Eigen::Index a = 0; a < mixed_.cols(); ++a) {
      const Eigen::Vector3d left = mixed_.col(a);
      for (Eigen::Index b = 0; b < mixed_.cols(); ++b) {
        const int row = mixed_columns_[static_cast<size_t>(b)], col = mixed_columns_[static_cast<size_t>(a)];
        if (row >= col) h(row, col) -= left.dot(mixed_.col(b));
      }
    }
  }

  const geometry::Rig& rig_;
  const KeypointLayout& layout_;
  double cauchy_px_;
  bool of_inliers_;
  std::vector<std::vector<int>> columns_of_;  // per camera
  std::vector<ViewDerivatives> views_;
  std::vector<Eigen::Matrix2d> curvature_;
  Eigen::Matrix<double, 3, Eigen::Dynamic> mixed_;  // derivatives by the point and by `mixed_columns_`
  std::vector<int> mixed_columns_;
};

/// Rows that hold place, turn and size of the camera centres (turn: of the orientations where the centres lie on a line).
Eigen::MatrixXd GaugeRows(const geometry::Rig& rig, const KeypointLayout& layout) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const geometry::RigCamera& camera : rig.cameras)
    mean += camera.CenterInWorld() / static_cast<double>(rig.cameras.size());
  const bool by_centres = CentresHoldFrame(rig);
  Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(7, layout.total);
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    const geometry::Rigid3& pose = rig.cameras[c].cam_from_world;
    const Eigen::Matrix3d world_r_cam = pose.rotation.toRotationMatrix().transpose();
    const Eigen::Matrix<double, 3, 6> centre = CentreFromPose(pose);
    Eigen::Matrix<double, 3, 6> turn = Eigen::Matrix<double, 3, 6>::Zero();  // R <- Exp(w) R turns the camera by R^T w in world
    turn.leftCols<3>() = world_r_cam;
    const Eigen::Vector3d arm = rig.cameras[c].CenterInWorld() - mean;
    const int column = layout.pose_column[c];
    rows.block<3, 6>(0, column) = centre;
    rows.block<3, 6>(3, column) = by_centres ? Eigen::Matrix<double, 3, 6>(geometry::CrossMatrix(arm) * centre) : turn;
    rows.block<1, 6>(6, column) = arm.transpose() * centre;
  }
  return rows;
}

/// Basis (n, n - rank) of what the rows leave free.
Eigen::MatrixXd NullSpace(const Eigen::MatrixXd& rows) {
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(rows, Eigen::ComputeFullV);
  const Eigen::Index rank = (svd.singularValues().array() > 1e-12 * svd.singularValues()[0]).count();
  return svd.matrixV().rightCols(rows.cols() - rank);
}

/// Gradient of f (see KeypointEquations) at fits.
Eigen::VectorXd GradientOf(const geometry::Rig& rig, const std::vector<KeypointFit>& fits, const KeypointLayout& layout,
                           double cauchy_px) {
  Eigen::VectorXd g = Eigen::VectorXd::Zero(layout.total);
  ViewDerivatives d;
  for (const KeypointFit& fit : fits) {
    for (size_t v = 0; fit.ok && v < fit.joint->seen.size(); ++v) {
      const auto c = static_cast<size_t>(fit.joint->seen[v].camera_idx);
      const bool free_pose = layout.pose_column[c] >= 0;
      const Eigen::Index lens = layout.directions[c].cols();
      if (!free_pose && lens == 0) continue;
      if (!Differentiate(rig.cameras[c], fit.x_in_world, layout.directions[c], free_pose, &d)) continue;
      const Eigen::Vector2d r = fit.residuals_px[v];
      const Eigen::VectorXd own = -d.by_camera.transpose() * r / (1 + r.squaredNorm() / (cauchy_px * cauchy_px));
      if (lens > 0) g.segment(layout.lens_column[c], lens) += own.head(lens);
      if (free_pose) g.segment<6>(layout.pose_column[c]) += own.tail<6>();
    }
  }
  return g;
}

double CostOf(const std::vector<KeypointFit>& fits, double cauchy_px) {
  double cost = 0;
  for (const KeypointFit& fit : fits) cost += fit.ok ? fit.cost : static_cast<double>(fit.joint->seen.size()) * std::log1p(1e4);
  return cauchy_px * cauchy_px / 2 * cost;
}

Eigen::MatrixXd FreeMotions(const geometry::Rig& rig, const KeypointFreedom& freedom, const KeypointLayout& layout,
                            const Eigen::VectorXd& diagonal) {
  const Eigen::Index n = layout.total;
  Eigen::VectorXd scale(n);
  for (Eigen::Index i = 0; i < n; ++i) scale[i] = diagonal[i] > 0 ? 1 / std::sqrt(diagonal[i]) : 1;
  Eigen::MatrixXd basis = Eigen::MatrixXd::Identity(n, n);
  if (AllFree(freedom)) basis = NullSpace(GaugeRows(rig, layout) * scale.asDiagonal());
  return scale.asDiagonal() * basis;
}

std::vector<KeypointFit> FitsWithout(const KeypointProfile& profile, const std::vector<bool>& left_out) {
  std::vector<KeypointFit> inside;
  for (size_t f = 0; f < profile.fits.size(); ++f) {
    const int group = profile.group_of_fit[f];
    if (group >= 0 && !left_out[static_cast<size_t>(group)] && profile.fits[f].ok) inside.push_back(profile.fits[f]);
  }
  return inside;
}

}  // namespace

KeypointLayout LayOut(const geometry::Rig& rig, const KeypointFreedom& freedom) {
  KeypointLayout layout;
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    const bool any_lens = c < freedom.lens_directions.size();
    layout.directions.push_back(any_lens ? freedom.lens_directions[c] : FixedLens(rig.cameras[c].camera));
    const auto lens = static_cast<int>(layout.directions[c].cols());
    layout.lens_column.push_back(lens > 0 ? layout.total : -1);
    layout.total += lens;
  }
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    const bool fixed = c < freedom.fix_pose.size() && freedom.fix_pose[c];
    layout.pose_column.push_back(fixed ? -1 : layout.total);
    layout.total += fixed ? 0 : 6;
  }
  return layout;
}

KeypointProfile ProfileOf(const geometry::Rig& rig, std::vector<KeypointFit> fits, std::vector<int> group_of_fit,
                          int num_groups, const KeypointFreedom& freedom, double cauchy_px, int num_threads) {
  MVS_CHECK(cauchy_px > 0 && group_of_fit.size() == fits.size(), "a scale, and a group for each joint");
  KeypointProfile profile{rig, cauchy_px, std::move(fits), std::move(group_of_fit), LayOut(rig, freedom), {}, {}, {}};
  const auto count = static_cast<size_t>(num_groups);
  profile.h.resize(count), profile.g.resize(count);
  std::vector<Eigen::VectorXd> diagonals(count);
  ParallelFor(num_groups, num_threads, [&](int64_t group) {
    const auto i = static_cast<size_t>(group);
    GroupSum sum(rig, profile.layout, cauchy_px);
    for (size_t f = 0; f < profile.fits.size(); ++f)
      if (profile.group_of_fit[f] == static_cast<int>(group)) sum.Add(profile.fits[f]);
    profile.h[i] = sum.h.selfadjointView<Eigen::Lower>();
    profile.g[i] = std::move(sum.g), diagonals[i] = std::move(sum.diagonal);
  });
  Eigen::VectorXd diagonal = Eigen::VectorXd::Zero(profile.layout.total);
  for (const Eigen::VectorXd& of_group : diagonals) diagonal += of_group;
  profile.motions = FreeMotions(rig, freedom, profile.layout, diagonal);
  return profile;
}

Eigen::MatrixXd CurvatureWithout(const KeypointProfile& profile, const std::vector<bool>& left_out) {
  Eigen::MatrixXd h = Eigen::MatrixXd::Zero(profile.layout.total, profile.layout.total);
  for (size_t group = 0; group < profile.h.size(); ++group)
    if (!left_out[group]) h += profile.h[group];
  return h;
}

Eigen::MatrixXd CurvatureUnder(const KeypointProfile& profile, const KeypointLayout& layout, bool of_inliers) {
  GroupSum sum(profile.rig, layout, profile.cauchy_px, of_inliers);
  for (size_t f = 0; f < profile.fits.size(); ++f)
    if (profile.group_of_fit[f] >= 0) sum.Add(profile.fits[f]);
  return sum.h.selfadjointView<Eigen::Lower>();
}

geometry::Rig Moved(const geometry::Rig& rig, const KeypointLayout& layout, const Eigen::VectorXd& step) {
  geometry::Rig moved = rig;
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    geometry::RigCamera& camera = moved.cameras[c];
    const Eigen::MatrixXd& d = layout.directions[c];
    if (layout.lens_column[c] >= 0) camera.camera.params += d * step.segment(layout.lens_column[c], d.cols());
    if (layout.pose_column[c] >= 0)
      camera.cam_from_world = geometry::Perturb(step.segment<6>(layout.pose_column[c]), camera.cam_from_world);
  }
  return moved;
}

namespace {

/// A step far from the minimum can leave what a lens may be: a focal length below zero.
bool AreLenses(const geometry::Rig& rig) {
  return std::all_of(rig.cameras.begin(), rig.cameras.end(),
                     [](const geometry::RigCamera& c) { return geometry::WhyInvalidLens(c.camera).empty(); });
}

}  // namespace

std::optional<geometry::Rig> SolveWithout(const KeypointProfile& profile, const std::vector<bool>& left_out, double tolerance) {
  constexpr int kMaxSteps = 30;
  const Eigen::MatrixXd &motions = profile.motions, h = CurvatureWithout(profile, left_out);
  std::vector<KeypointFit> inside = FitsWithout(profile, left_out);
  const Eigen::LLT<Eigen::MatrixXd> factor(Eigen::MatrixXd(motions.transpose() * h * motions));
  if (factor.info() != Eigen::Success || inside.empty()) return std::nullopt;
  geometry::Rig rig = profile.rig;
  double cost = CostOf(inside, profile.cauchy_px);
  for (int i = 0; i < kMaxSteps; ++i) {
    const Eigen::VectorXd g = motions.transpose() * GradientOf(rig, inside, profile.layout, profile.cauchy_px);
    const Eigen::VectorXd step = -factor.solve(g);
    if (!step.allFinite()) return std::nullopt;
    if (-0.5 * g.dot(step) <= tolerance * cost) return rig;
    const geometry::Rig moved = Moved(rig, profile.layout, motions * step);
    if (!AreLenses(moved)) return i == 0 ? std::nullopt : std::optional(rig);
    std::vector<KeypointFit> next = RefitKeypoints(moved, inside, profile.cauchy_px, 1);
    const double next_cost = CostOf(next, profile.cauchy_px);
    if (!(next_cost < cost)) return i == 0 ? std::nullopt : std::optional(rig);
    rig = moved, inside = std::move(next), cost = next_cost;
  }
  return rig;
}

}  // namespace mvstudio::calib
