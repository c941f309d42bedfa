#include "avatar/body/fit/pose_solver.h"

#include <cmath>

#include "core/check.h"
#include "geometry/solve/least_squares.h"

namespace mvstudio::body {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double kCauchy = 3;  // residuals of this many standard deviations are doubted

/// Cauchy: half the loss and the weight of a residual whose square in standard deviations is `s`.
double CauchyLoss(double s) { return 0.5 * kCauchy * kCauchy * std::log1p(s / (kCauchy * kCauchy)); }
double CauchyWeight(double s) { return 1 / (1 + s / (kCauchy * kCauchy)); }

class PoseProblem : public geometry::LeastSquaresProblem<Eigen::Dynamic, ArticulatedPose> {
 public:
  PoseProblem(const BodyTemplate& body, const PoseProblemInput& input) : body_(body), input_(input) {}

  bool Linearize(const ArticulatedPose& pose, Equations* out) const {
    const PosedBones bones(body_, pose);
    const auto size = static_cast<Eigen::Index>(3 * body_.bone_names.size() + 3);
    out->h = Eigen::MatrixXd::Zero(size, size), out->g = VectorXd::Zero(size), out->cost = 0;
    AddJoints(bones, out);
    for (const RotationPrior& prior : input_.priors) AddPrior(bones, pose, prior, out);
    for (const SurfaceResidual& residual : input_.surface) AddSurface(bones, residual, out);
    return std::isfinite(out->cost);
  }

  ArticulatedPose Retract(const ArticulatedPose& pose, const Step& step) const { return body::Retract(body_, pose, step); }

  Step SolveStep(const Equations& at, double damping) const {
    constexpr double kMaxTurn = 0.6;  // rad in one step: the linear model holds no further
    Step step = geometry::DampedStep<Eigen::Dynamic>(at.h, at.g, damping, 1e-6);
    const double largest = step.head(step.size() - 3).cwiseAbs().maxCoeff();
    return largest > kMaxTurn ? Step(step * (kMaxTurn / largest)) : step;
  }

 private:
  void AddJoints(const PosedBones& bones, Equations* out) const {
    for (int j = 0; j < 19; ++j) {
      if (!input_.joints.valid[j]) continue;
      const int b = body_.coco19_bone[j];
      const Vector3d x = bones.At(b, body_.coco19.col(j));
      const double inverse = 1 / input_.joints.sigma_m[j];
      const Vector3d residual = inverse * (x - input_.joints.x_in_world.col(j));
      const double weight = CauchyWeight(residual.squaredNorm());
      out->cost += CauchyLoss(residual.squaredNorm());
      for (int k = 0; k < 3; ++k) {
        VectorXd row = VectorXd::Zero(out->g.size());
        bones.AddDerivative(b, x, Vector3d::Unit(k), inverse, &row);
        AddRow(row, residual[k], weight, out);
      }
    }
  }

  void AddPrior(const PosedBones& bones, const ArticulatedPose& pose, const RotationPrior& prior, Equations* out) const {
    for (size_t b = 0; b < prior.mean.size(); ++b) {
      if (prior.weight[b].isZero()) continue;
      const auto at = static_cast<Eigen::Index>(3 * b);
      const Vector3d residual = prior.weight[b] * geometry::RotationLog(prior.mean[b].conjugate() * pose.local_rotations[b]);
      // Left step on local_b in the parent's axes, seen after mean^-1: exact for small residuals.
      const Matrix3d jacobian = prior.weight[b] * prior.mean[b].conjugate().toRotationMatrix() *
                                bones.ParentRotation(static_cast<int>(b)).transpose();
      out->cost += 0.5 * residual.squaredNorm();
      out->h.block<3, 3>(at, at) += jacobian.transpose() * jacobian;
      out->g.segment<3>(at) += jacobian.transpose() * residual;
    }
  }

  void AddSurface(const PosedBones& bones, const SurfaceResidual& measured, Equations* out) const {
    const double moved = measured.direction.dot(bones.Vertex(measured.vertex) - measured.at);
    const double residual = measured.weight * (moved - measured.gap);
    out->cost += CauchyLoss(residual * residual);
    const VectorXd row = bones.VertexDerivative(measured.vertex, measured.weight * measured.direction);
    AddRow(row, residual, CauchyWeight(residual * residual), out);
  }

  /// Rows are mostly zeros: a point moves with a handful of bones.
  static void AddRow(const VectorXd& row, double residual, double weight, Equations* out) {
    thread_local std::vector<Eigen::Index> used;
    used.clear();
    for (Eigen::Index i = 0; i < row.size(); ++i) {
      if (row[i] != 0) used.push_back(i);
    }
    for (const Eigen::Index i : used) {
      out->g[i] += weight * row[i] * residual;
      for (const Eigen::Index k : used) out->h(i, k) += weight * row[i] * row[k];
    }
  }

  const BodyTemplate& body_;
  const PoseProblemInput& input_;
};

/// Weight with `along` rad about `axis` and `across` rad about the axes normal to it.
Matrix3d AxisWeight(const Vector3d& axis, double along, double across) {
  const Matrix3d project = axis.normalized() * axis.normalized().transpose();
  return project / along + (Matrix3d::Identity() - project) / across;
}

/// Weight of a bone that lies along `axis` in the rest pose.
Matrix3d RoleWeight(BoneRole role, const Vector3d& axis) {
  constexpr double kFree = 3;  // rad
  switch (role) {
    case BoneRole::kPelvis:
      return Matrix3d::Zero();
    case BoneRole::kSpine:
    case BoneRole::kChest:
      return Matrix3d::Identity() / 0.25;
    case BoneRole::kNeck:
      return Matrix3d::Identity() / 0.3;
    case BoneRole::kHead:
      return Matrix3d::Identity() / 0.4;
    case BoneRole::kLeftClavicle:
    case BoneRole::kRightClavicle:
      return AxisWeight(axis, 0.2, 0.3);
    case BoneRole::kLeftUpperArm:
    case BoneRole::kRightUpperArm:
      return AxisWeight(axis, 0.5, kFree);
    case BoneRole::kLeftForearm:
    case BoneRole::kRightForearm:
      return AxisWeight(axis, 0.4, kFree);
    case BoneRole::kLeftThigh:
    case BoneRole::kRightThigh:
      return AxisWeight(axis, 0.35, kFree);
    case BoneRole::kLeftShin:
    case BoneRole::kRightShin:
      return AxisWeight(Vector3d::UnitX(), kFree, 0.15);  // a hinge
    case BoneRole::kLeftHand:
    case BoneRole::kRightHand:
    case BoneRole::kLeftFoot:
    case BoneRole::kRightFoot:
      return AxisWeight(axis, 0.2, 0.25);
    case BoneRole::kOther:
      break;
  }
  return Matrix3d::Identity() / 0.02;  // follows its parent
}

}  // namespace

RotationPrior AnatomicalPrior(const BodyTemplate& body) {
  RotationPrior prior;
  prior.mean.assign(body.bone_names.size(), Eigen::Quaterniond::Identity());
  for (size_t b = 0; b < body.bone_names.size(); ++b) {
    const auto at = static_cast<Eigen::Index>(b);
    prior.weight.push_back(RoleWeight(body.bone_roles[b], body.bone_tails.col(at) - body.bone_heads.col(at)));
  }
  prior.weight[0].setZero();  // people stand and turn anyhow
  return prior;
}

PoseSolution SolvePose(const BodyTemplate& body, const PoseProblemInput& input, const ArticulatedPose& start,
                       int max_iterations) {
  MVS_CHECK(start.local_rotations.size() == body.bone_names.size(),
            start.local_rotations.size() << " rotations for " << body.bone_names.size() << " bones");
  geometry::LeastSquaresOptions options;
  options.max_iterations = max_iterations, options.first_damping = 1e-3, options.cost_tolerance = 1e-6;
  const auto end = geometry::SolveLeastSquares(PoseProblem(body, input), start, options);
  return {end.status, end.state, end.equations.cost};
}

}  // namespace mvstudio::body
