#include "calib/lens/held_out_view.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <cmath>
#include <limits>
#include <optional>

#include "calib/board/homography.h"
#include "calib/lens/intrinsics.h"
#include "calib/lens/resection.h"

namespace mvstudio::calib {
namespace {

using geometry::Camera;
using geometry::Rigid3;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr Eigen::Index kMinHalved = 8;
constexpr double kMaxLeverage = 1;      // variance of a corner's place by the pose, over that of its detection
constexpr double kMinLeft = 0.05;       // of a corner's variance that a fit leaves: less says nothing
constexpr double kClearlyBetter = 0.7;  // ratio of rms below which the other pose of the plane is accepted

bool Usable(const Resection& pose) { return pose.status == Status::kOk || pose.status == Status::kNotConverged; }

/// The pose near the given one, unless the corners clearly say another.
Resection PoseNear(const Camera& camera, const View& view, const Rigid3& near_pose) {
  const Resection alone = ResectPlane(camera, view), near = RefinePose(camera, view, near_pose);
  if (!Usable(near)) return alone;
  return Usable(alone) && alone.rms_px < kClearlyBetter * near.rms_px ? alone : near;
}

/// Pose from the corners with a weight, of which some may be wrong: those far off the first pose lose their weights.
Resection RobustResect(const Camera& camera, const Rigid3& near_pose, View* view) {
  const Eigen::VectorXd prior = view->weights;
  Resection pose = PoseNear(camera, *view, near_pose);
  for (int round = 0; round < 3 && pose.status == Status::kOk; ++round) {
    const auto residuals = ResidualsOf(*view, camera, pose.cam_from_board);
    if (!residuals) break;
    const Eigen::ArrayXd distances = residuals->colwise().norm().transpose().array() * prior.array().sqrt();
    const double limit = std::max(1e-6, 4 * Median(distances));
    const Eigen::VectorXd before = view->weights;
    view->weights = (distances <= limit).select(prior.array(), 0.0);
    const Resection next = (view->weights.array() > 0).count() < 4 ? Resection{Status::kTooFewViews, {}, 0, 0}
                                                                   : RefinePose(camera, *view, pose.cam_from_board);
    if (next.status != Status::kOk) {
      view->weights = before;
      break;
    }
    pose = next;
  }
  return pose;
}

View Bent(View view, const RigState& state) {
  view.x_in_board = BentCorners(view, state);
  return view;
}

/// Inverse of the normal matrix of the pose; nothing when the corners leave it open.
std::optional<Matrix6d> PoseCovariance(const Camera& camera, const View& view, const Rigid3& pose) {
  const auto linear = LinearizeView(view, camera, pose, false);
  if (!linear) return std::nullopt;
  const Matrix6d normal = linear->d_pose.transpose() * linear->d_pose;
  const Eigen::LDLT<Matrix6d> factor(normal);
  if (factor.info() != Eigen::Success || !factor.isPositive()) return std::nullopt;
  const Matrix6d covariance = factor.solve(Matrix6d::Identity());
  return covariance.allFinite() ? std::optional<Matrix6d>(covariance) : std::nullopt;
}

/// Errors of one half of the corners, with the pose from the other half.
void ScoreHalf(const Camera& camera, const View& bent, const Rigid3& near_pose, int pose_half, std::vector<double>* errors) {
  View from = HalfOf(bent, pose_half), scored = HalfOf(bent, 1 - pose_half);
  const Resection pose = RobustResect(camera, near_pose, &from);
  const Eigen::VectorXd weights = scored.weights;
  if (!Usable(pose)) {
    errors->insert(errors->end(), static_cast<size_t>((weights.array() > 0).count()), kInfinity);
    return;
  }
  const auto covariance = PoseCovariance(camera, from, pose.cam_from_board);
  if (!covariance) return;
  const auto linear = LinearizeView(scored, camera, pose.cam_from_board, false);
  View any = scored;
  any.weights.setZero();  // so that corners that do not project give infinity
  const Eigen::Matrix2Xd residuals = *ResidualsOf(any, camera, pose.cam_from_board);
  for (Eigen::Index i = 0; i < scored.size(); ++i) {
    if (weights[i] <= 0) continue;
    if (linear) {
      const Eigen::Matrix<double, 2, 6> d = linear->d_pose.middleRows<2>(2 * i);
      if ((d * *covariance * d.transpose()).trace() / 2 > kMaxLeverage) continue;
    }
    errors->push_back(residuals.col(i).norm());
  }
}

/// Studentised residuals of a view with few corners.
void ScoreFew(const Camera& camera, View bent, const Rigid3& near_pose, std::vector<double>* errors) {
  const Resection pose = PoseNear(camera, bent, near_pose);
  const auto linear = Usable(pose) ? LinearizeView(bent, camera, pose.cam_from_board, false) : std::nullopt;
  const auto covariance = linear ? PoseCovariance(camera, bent, pose.cam_from_board) : std::nullopt;
  for (Eigen::Index i = 0; i < bent.size(); ++i) {
    if (bent.weights[i] <= 0) continue;
    if (!covariance) {
      errors->push_back(kInfinity);
      continue;
    }
    const Eigen::Matrix<double, 2, 6> d = linear->d_pose.middleRows<2>(2 * i);
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> left(Eigen::Matrix2d::Identity() - d * *covariance * d.transpose());
    if (left.eigenvalues()[0] < kMinLeft) continue;
    const Eigen::Vector2d residual = linear->residuals.segment<2>(2 * i) / std::sqrt(bent.weights[i]);
    errors->push_back((left.operatorInverseSqrt() * residual).norm());
  }
}

}  // namespace

void AppendHeldOutErrors(const Camera& camera, const View& view, const RigState& state, const Rigid3& near_pose,
                         std::vector<double>* errors_px) {
  const View bent = Bent(view, state);
  if ((view.weights.array() > 0).count() < kMinHalved) return ScoreFew(camera, bent, near_pose, errors_px);
  for (int half = 0; half < 2; ++half) ScoreHalf(camera, bent, near_pose, half, errors_px);
}

void AppendLeftOutPoints(const Camera& camera, const View& view, std::vector<double>* errors_px) {
  constexpr Eigen::Index kFolds = 5;
  BundleOptions options;
  options.reject_outliers = false;
  for (Eigen::Index fold = 0; fold < kFolds; ++fold) {
    View rest = view;
    for (Eigen::Index i = fold; i < view.size(); i += kFolds) rest.weights[i] = 0;
    const MonoSolution solved = RefineMono(camera, {rest}, options);
    if (solved.status != Status::kOk && solved.status != Status::kNotConverged) continue;
    const Eigen::Matrix2Xd residuals = BundleResiduals(solved.views, solved.state)[0];
    for (Eigen::Index i = fold; i < view.size(); i += kFolds) {
      if (view.weights[i] > 0) errors_px->push_back(residuals.col(i).norm());
    }
  }
}

}  // namespace mvstudio::calib
