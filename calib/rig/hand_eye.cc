#include "calib/rig/hand_eye.h"

#include <Eigen/QR>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "calib/board/homography.h"
#include "core/format.h"
#include "core/random.h"
#include "geometry/rigid/cross_matrix.h"
#include "geometry/rigid/decompositions.h"

namespace mvstudio::calib {
namespace {

using Eigen::Index;
using geometry::Rigid3;
using Vector12d = Eigen::Matrix<double, 12, 1>;
using Matrix612 = Eigen::Matrix<double, 6, 12>;

struct Solution {
  Rigid3 a_from_b, q_from_p;
};

bool IsFinite(const Rigid3& pose) { return pose.rotation.coeffs().allFinite() && pose.translation.allFinite(); }

/// Motion of body p in a and of body q in b between two pairs: the same turn seen from two places.
struct Motion {
  Rigid3 in_a, in_b;
  Eigen::Vector3d turn_a, turn_b;  // rotation vectors
};

Motion MotionBetween(const HandEyePair& from, const HandEyePair& to) {
  Motion motion{to.a_from_p * geometry::Inverse(from.a_from_p), to.b_from_q * geometry::Inverse(from.b_from_q), {}, {}};
  motion.turn_a = geometry::RotationLog(motion.in_a.rotation);
  motion.turn_b = geometry::RotationLog(motion.in_b.rotation);
  return motion;
}

/// Motions between pairs 1, 2, 4, … apart.
std::vector<Motion> Motions(const std::vector<HandEyePair>& pairs) {
  std::vector<Motion> motions;
  for (size_t gap = 1; gap < pairs.size(); gap *= 2) {
    for (size_t i = 0; i + gap < pairs.size(); ++i) motions.push_back(MotionBetween(pairs[i], pairs[i + gap]));
  }
  return motions;
}

/// RMS turn about the second strongest axis.
double AxisSpread(const std::vector<Motion>& motions) {
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const Motion& motion : motions) scatter += motion.turn_a * motion.turn_a.transpose();
  const Eigen::Vector3d size = geometry::SingularValues(scatter);
  return std::sqrt(size[1] / static_cast<double>(std::max<size_t>(1, motions.size())));
}

Eigen::Quaterniond MeanRotation(const std::vector<Rigid3>& poses) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (const Rigid3& pose : poses) sum += pose.rotation.toRotationMatrix();
  return Eigen::Quaterniond(geometry::ProcrustesRotation(sum));
}

/// Park and Martin; q_from_p is the mean over the pairs.
std::optional<Solution> ClosedForm(const std::vector<HandEyePair>& pairs, const std::vector<Motion>& motions,
                                   double min_spread) {
  if (AxisSpread(motions) < min_spread) return std::nullopt;
  Eigen::Matrix3d cross = Eigen::Matrix3d::Zero();
  for (const Motion& motion : motions) cross += motion.turn_a * motion.turn_b.transpose();
  const Eigen::Matrix3d rotation = geometry::ProcrustesRotation(cross);
  Eigen::MatrixXd left(3 * motions.size(), 3);
  Eigen::VectorXd right(3 * motions.size());
  for (size_t m = 0; m < motions.size(); ++m) {
    const auto row = static_cast<Index>(3 * m);
    left.middleRows<3>(row) = motions[m].in_a.rotation.toRotationMatrix() - Eigen::Matrix3d::Identity();
    right.segment<3>(row) = rotation * motions[m].in_b.translation - motions[m].in_a.translation;
  }
  Solution solution;
  solution.a_from_b = {Eigen::Quaterniond(rotation), left.colPivHouseholderQr().solve(right)};
  if (!IsFinite(solution.a_from_b)) return std::nullopt;
  std::vector<Rigid3> each;
  for (const HandEyePair& pair : pairs) {
    each.push_back(geometry::Inverse(solution.a_from_b * pair.b_from_q) * pair.a_from_p);
    solution.q_from_p.translation += each.back().translation / static_cast<double>(pairs.size());
  }
  solution.q_from_p.rotation = MeanRotation(each);
  return solution;
}

/// Rotation (radians) and translation (metres) by which a_from_b * b_from_q * q_from_p misses a_from_p.
geometry::Vector6d Miss(const Solution& solution, const HandEyePair& pair) {
  const Rigid3 predicted = solution.a_from_b * pair.b_from_q * solution.q_from_p;
  geometry::Vector6d miss;
  miss << geometry::RotationLog(predicted.rotation * pair.a_from_p.rotation.conjugate()),
      predicted.translation - pair.a_from_p.translation;
  return miss;
}

/// Derivative of Miss with respect to left perturbations of a_from_b and of q_from_p (to first order in the rotation missed).
Matrix612 MissDerivative(const Solution& solution, const HandEyePair& pair) {
  const Rigid3 a_from_q = solution.a_from_b * pair.b_from_q;
  const Eigen::Matrix3d turn = a_from_q.rotation.toRotationMatrix();
  const Eigen::Vector3d lever = a_from_q * solution.q_from_p.translation - solution.a_from_b.translation;
  Matrix612 d = Matrix612::Zero();
  d.block<3, 3>(0, 0).setIdentity();
  d.block<3, 3>(0, 6) = turn;
  d.block<3, 3>(3, 0) = -geometry::CrossMatrix(lever);
  d.block<3, 3>(3, 3).setIdentity();
  d.block<3, 3>(3, 9) = turn;
  return d;
}

/// Median distance of the bodies from their devices: turns metres into radians.
double TypicalDistance(const std::vector<HandEyePair>& pairs) {
  Eigen::VectorXd distance(static_cast<Index>(pairs.size()));
  for (size_t i = 0; i < pairs.size(); ++i) {
    distance[static_cast<Index>(i)] = (pairs[i].a_from_p.translation.norm() + pairs[i].b_from_q.translation.norm()) / 2;
  }
  return std::max(1e-9, Median(distance));
}

double MedianMiss(const Solution& solution, const std::vector<HandEyePair>& pairs, double distance) {
  Eigen::VectorXd misses(static_cast<Index>(pairs.size()));
  for (size_t i = 0; i < pairs.size(); ++i) {
    const geometry::Vector6d miss = Miss(solution, pairs[i]);
    misses[static_cast<Index>(i)] = miss.head<3>().norm() + miss.tail<3>().norm() / distance;
  }
  return Median(misses);
}

/// Three pairs whose motions turn about different axes, or all of them: whichever leaves the smallest median error.
std::optional<Solution> BestStart(const std::vector<HandEyePair>& pairs, double distance, double min_spread) {
  constexpr int kSamples = 300;
  const auto n = static_cast<int>(pairs.size());
  std::optional<Solution> best;
  double best_miss = std::numeric_limits<double>::infinity();
  const auto consider = [&](const std::vector<HandEyePair>& chosen) {
    const auto candidate = ClosedForm(chosen, Motions(chosen), min_spread);
    const double miss = candidate ? MedianMiss(*candidate, pairs, distance) : best_miss;
    if (miss < best_miss) best_miss = miss, best = candidate;
  };
  consider(pairs);
  Rng rng(1);
  for (int sample = 0; sample < kSamples && n > 3; ++sample) {
    const auto i = static_cast<int>(rng.Index(n)), j = static_cast<int>(rng.Index(n)), k = static_cast<int>(rng.Index(n));
    if (i != j && j != k && i != k) consider({pairs[i], pairs[j], pairs[k]});
  }
  return best;
}

struct Refined {
  Solution solution;
  Eigen::VectorXd weights;  // (pairs)
  double rotation_sigma = 0, translation_sigma = 0;
  Vector12d sigma = Vector12d::Constant(std::numeric_limits<double>::infinity());
};

/// Standard deviations per coordinate of the two halves of the misses, from their medians.
void EstimateNoise(const std::vector<HandEyePair>& pairs, double distance, Refined* refined) {
  const auto n = static_cast<Index>(pairs.size());
  Eigen::VectorXd rotation(n), translation(n);
  for (Index i = 0; i < n; ++i) {
    const geometry::Vector6d miss = Miss(refined->solution, pairs[i]);
    rotation[i] = miss.head<3>().norm(), translation[i] = miss.tail<3>().norm();
  }
  constexpr double kMedianOfNorm = 1.5382;  // of a 3-D standard normal vector
  const double freed = std::sqrt(static_cast<double>(n) / std::max<double>(1, static_cast<double>(n) - 2));  // 12 of 6 n
  refined->rotation_sigma = std::max(1e-9, freed * Median(rotation) / kMedianOfNorm);
  refined->translation_sigma = std::max(1e-9 * distance, freed * Median(translation) / kMedianOfNorm);
}

/// One Gauss-Newton step with Geman and McClure's weights; its length in units of the noise, or nothing when singular.
std::optional<double> Step(const std::vector<HandEyePair>& pairs, Refined* refined) {
  constexpr double kReach = 4;  // noise levels, beyond which a pair has almost no weight
  const auto n = static_cast<Index>(pairs.size());
  Eigen::MatrixXd left(6 * n, 12);
  Eigen::VectorXd right(6 * n);
  refined->weights.resize(n);
  geometry::Vector6d unit;
  unit << Eigen::Vector3d::Constant(1 / refined->rotation_sigma), Eigen::Vector3d::Constant(1 / refined->translation_sigma);
  for (Index i = 0; i < n; ++i) {
    const geometry::Vector6d miss = unit.cwiseProduct(Miss(refined->solution, pairs[i]));
    const double ratio = miss.squaredNorm() / (6 * kReach * kReach);
    refined->weights[i] = 1 / ((1 + ratio) * (1 + ratio));
    const double root = std::sqrt(refined->weights[i]);
    left.middleRows<6>(6 * i) = root * unit.asDiagonal() * MissDerivative(refined->solution, pairs[i]);
    right.segment<6>(6 * i) = -root * miss;
  }
  const Eigen::RowVectorXd scale = left.colwise().norm().cwiseMax(1e-300);
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(left * scale.cwiseInverse().asDiagonal(),
                                              Eigen::ComputeThinU | Eigen::ComputeThinV);
  if (svd.singularValues()[11] < 1e-10 * svd.singularValues()[0]) return std::nullopt;
  const Vector12d scaled = svd.solve(right);
  const Vector12d delta = scaled.cwiseQuotient(scale.transpose());
  refined->solution.a_from_b = geometry::Perturb(delta.head<6>(), refined->solution.a_from_b);
  refined->solution.q_from_p = geometry::Perturb(delta.tail<6>(), refined->solution.q_from_p);
  const Eigen::MatrixXd half = svd.matrixV() * svd.singularValues().cwiseInverse().asDiagonal();
  const Vector12d spread = half.rowwise().norm();
  refined->sigma = spread.cwiseQuotient(scale.transpose());
  return delta.cwiseQuotient(refined->sigma).norm();
}

Refined Refine(const std::vector<HandEyePair>& pairs, const Solution& start, double distance) {
  constexpr int kRounds = 5, kSteps = 20;
  Refined refined;
  refined.solution = start;
  for (int round = 0; round < kRounds; ++round) {
    EstimateNoise(pairs, distance, &refined);
    for (int step = 0; step < kSteps; ++step) {
      const auto length = Step(pairs, &refined);
      if (!length) return refined.sigma.setConstant(std::numeric_limits<double>::infinity()), refined;
      if (*length < 1e-6) break;
    }
  }
  return refined;
}

std::string Degrees(double radians) { return Format("%.2g deg", radians * 180 / M_PI); }

HandEye Refuse(Status status, const std::string& message) {
  HandEye result;
  result.status = status, result.message = message;
  return result;
}

void Summarise(const std::vector<HandEyePair>& pairs, const Refined& refined, HandEye* result) {
  result->a_from_b = refined.solution.a_from_b, result->q_from_p = refined.solution.q_from_p;
  result->a_from_b_sigma = refined.sigma.head<6>();
  for (size_t i = 0; i < pairs.size(); ++i) {
    if (refined.weights[static_cast<Index>(i)] < 0.25) continue;
    const geometry::Vector6d miss = Miss(refined.solution, pairs[i]);
    ++result->num_inliers;
    result->rotation_rms_rad += miss.head<3>().squaredNorm();
    result->translation_rms_m += miss.tail<3>().squaredNorm();
  }
  const int count = std::max(1, result->num_inliers);
  result->rotation_rms_rad = std::sqrt(result->rotation_rms_rad / count);
  result->translation_rms_m = std::sqrt(result->translation_rms_m / count);
}

/// The turn about the second axis of the pairs that count.
double InlierSpread(const std::vector<HandEyePair>& pairs, const Eigen::VectorXd& weights) {
  std::vector<HandEyePair> inliers;
  for (size_t i = 0; i < pairs.size(); ++i) {
    if (weights[static_cast<Index>(i)] >= 0.25) inliers.push_back(pairs[i]);
  }
  return AxisSpread(Motions(inliers));
}

}  // namespace

HandEye SolveHandEye(const std::vector<HandEyePair>& pairs, const HandEyeOptions& options) {
  for (const HandEyePair& pair : pairs) {
    if (!IsFinite(pair.a_from_p) || !IsFinite(pair.b_from_q)) return Refuse(Status::kNonFiniteInput, "a pose is not finite");
  }
  if (pairs.size() < 3) {
    return Refuse(Status::kTooFewViews,
                  "only " + std::to_string(pairs.size()) + " of the 3 simultaneous frames that are needed");
  }
  const double distance = TypicalDistance(pairs);
  const auto start = BestStart(pairs, distance, options.min_axis_spread_rad);
  if (!start) {
    return Refuse(Status::kDegenerate, "in all frames the boards turn about one axis only (about a second one by " +
                                           Degrees(AxisSpread(Motions(pairs))) + ")");
  }
  const Refined refined = Refine(pairs, *start, distance);
  HandEye result;
  Summarise(pairs, refined, &result);
  const double spread = InlierSpread(pairs, refined.weights);
  const bool rotated = spread >= std::max(options.min_axis_spread_rad, options.min_axis_spread_noise * refined.rotation_sigma);
  const bool rotation = result.a_from_b_sigma.head<3>().maxCoeff() <= options.max_rotation_sigma_rad;
  const bool translation = result.a_from_b_sigma.tail<3>().maxCoeff() <= options.max_translation_sigma * distance;
  if (result.num_inliers < 3) {
    result.status = Status::kDegenerate;
    result.message = "fewer than 3 frames agree with each other";
  } else if (!rotated || !rotation || !translation) {
    result.status = Status::kDegenerate;
    result.message = "the boards turn too little about a second axis (" + Degrees(spread) + ") for the noise of their poses (" +
                     Degrees(refined.rotation_sigma) + ")";
  }
  return result;
}

}  // namespace mvstudio::calib
