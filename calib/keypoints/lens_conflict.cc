#include "calib/keypoints/lens_conflict.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "calib/keypoints/lens_vote.h"
#include "calib/keypoints/profile.h"
#include "core/format.h"
#include "core/parallel.h"
#include "core/statistics.h"
#include "geometry/rig/rig_covariance.h"

namespace mvstudio::calib {
namespace {

constexpr int kParts = 8;

/// The eighth of the space that holds each point; -1: no point.
std::vector<int> PartOf(const std::vector<KeypointFit>& fits) {
  std::vector<Eigen::Vector3d> points;
  for (const KeypointFit& fit : fits)
    if (fit.ok) points.push_back(fit.x_in_world);
  std::vector<int> part(fits.size(), -1);
  if (points.empty()) return part;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& x : points) mean += x / static_cast<double>(points.size());
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& x : points) spread += (x - mean) * (x - mean).transpose();
  const Eigen::Matrix3d axes = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(spread).eigenvectors();
  Eigen::Vector3d middle;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> along;
    for (const Eigen::Vector3d& x : points) along.push_back(axes.col(axis).dot(x));
    middle[axis] = LinearQuantile(std::move(along), 0.5);
  }
  for (size_t f = 0; f < fits.size(); ++f) {
    if (!fits[f].ok) continue;
    const Eigen::Vector3d along = axes.transpose() * fits[f].x_in_world;
    part[f] = (along[0] > middle[0]) + 2 * (along[1] > middle[1]) + 4 * (along[2] > middle[2]);
  }
  return part;
}

/// At most `most` of the fits with a point, evenly spread.
std::vector<KeypointFit> SomeOf(const std::vector<KeypointFit>& fits, size_t most) {
  std::vector<KeypointFit> ok, some;
  for (const KeypointFit& fit : fits)
    if (fit.ok) ok.push_back(fit);
  for (size_t i = 0; i < std::min(most, ok.size()); ++i) some.push_back(ok[i * ok.size() / std::min(most, ok.size())]);
  return some;
}

geometry::Rig Without(const KeypointProfile& profile, int part, const KeypointFreedom& freedom) {
  std::vector<bool> left_out(kParts, false);
  left_out[static_cast<size_t>(part)] = true;
  if (const auto rig = SolveWithout(profile, left_out)) return *rig;
  std::vector<KeypointJoint> rest;
  for (size_t f = 0; f < profile.fits.size(); ++f)
    if (profile.group_of_fit[f] >= 0 && profile.group_of_fit[f] != part) rest.push_back(*profile.fits[f].joint);
  const KeypointSolution solution = SolveKeypoints(profile.rig, rest, freedom, profile.cauchy_px, 1);
  return solution.status == Status::kOk ? solution.rig : geometry::Rig();
}

/// Standard deviations of the lens in the space of its freed directions over those that a calibration states there, along the
/// axes that make both covariances diagonal: terms that trade off against each other may be known well together.
std::vector<double> RatiosToStated(const LensConflict& conflict, const geometry::Rig& given, const KeypointFreedom& freedom) {
  std::vector<double> ratios;
  for (size_t c = 0; c < given.cameras.size() && c < freedom.lens_directions.size(); ++c) {
    const auto& stated = given.cameras[c].params_covariance;
    if (!stated || stated->rows() != conflict.lens[c].rows()) continue;
    const Eigen::MatrixXd free = freedom.lens_directions[c].colwise().normalized();
    if (free.cols() == 0) continue;
    const Eigen::MatrixXd known = free.transpose() * *stated * free, found = free.transpose() * conflict.lens[c] * free;
    const Eigen::LLT<Eigen::MatrixXd> whitened(known);
    if (whitened.info() != Eigen::Success) continue;  // a term that the calibration holds exactly, or states nothing of
    const Eigen::MatrixXd half = whitened.matrixL().solve(found);
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> axes(whitened.matrixL().solve(half.transpose()),
                                                              Eigen::EigenvaluesOnly);
    for (const double squared : axes.eigenvalues()) ratios.push_back(std::sqrt(std::fmax(0.0, squared)));
  }
  return ratios;
}

}  // namespace

LensConflict ConflictBySpace(const geometry::Rig& rig, const std::vector<KeypointFit>& fits, const KeypointFreedom& freedom,
                             double cauchy_px, int num_threads) {
  const KeypointProfile profile = ProfileOf(rig, fits, PartOf(fits), kParts, freedom, cauchy_px, num_threads);
  std::vector<geometry::Rig> rigs(kParts);
  ParallelFor(kParts, num_threads,
              [&](int64_t part) { rigs[static_cast<size_t>(part)] = Without(profile, static_cast<int>(part), freedom); });
  const std::vector<KeypointFit> some = SomeOf(fits, 600);
  LensConflict conflict;
  for (const geometry::RigCamera& camera : rig.cameras)
    conflict.lens.emplace_back(Eigen::MatrixXd::Zero(camera.camera.params.size(), camera.camera.params.size()));
  constexpr double kJackknife = (kParts - 1.0) / kParts;
  double squares = 0;
  for (const geometry::Rig& other : rigs) {
    if (other.cameras.empty()) return conflict;
    const double bend = BendPx(rig, some, RefitKeypoints(other, some, cauchy_px, num_threads), cauchy_px);
    squares += kJackknife * bend * bend;
    for (size_t c = 0; c < rig.cameras.size(); ++c) {
      const Eigen::VectorXd off = other.cameras[c].camera.params - rig.cameras[c].camera.params;
      conflict.lens[c] += kJackknife * off * off.transpose();
    }
  }
  conflict.solved = true, conflict.bend_px = std::sqrt(squares);
  return conflict;
}

std::string WhyNotDetermined(const LensConflict& conflict, double bend_px, double gain_px, const geometry::Rig& given,
                             const KeypointFreedom& freedom) {
  constexpr double kSigmas = 2, kHarmless = 0.5;
  if (!conflict.solved) return "without an eighth of the space the points do not determine it";
  // Points that move by less than what the change explains are no worse off with it.
  if (kSigmas * conflict.bend_px > std::max(bend_px, kHarmless * gain_px))
    return Format("parts of the space ask for different ones: it moves points by %.2f px, which are uncertain by %.2f px",
                  bend_px, conflict.bend_px);
  const std::vector<double> ratios = RatiosToStated(conflict, given, freedom);
  if (ratios.empty()) return "";
  const double ratio = LinearQuantile(ratios, 0.5);
  if (ratio <= 1) return "";
  return Format("the calibration knows its lenses better than these points do: their errors are %.1f times those it states",
                ratio);
}

}  // namespace mvstudio::calib
