#include "calib/keypoints/suspect.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/format.h"
#include "core/parallel.h"
#include "core/units.h"

namespace mvstudio::calib {
namespace {

using Kind = CameraFault;

constexpr size_t kMaxCameras = 8;

struct Hypothesis {
  Kind kind = Kind::kNone;
  size_t camera = 0;
  double cost = 0;
  KeypointFreedom freedom;
  KeypointSolution solution;
};

/// A joint without a point costs as much as one that is off by 100 times the noise in every view.
double TotalCost(const std::vector<KeypointFit>& fits) {
  double cost = 0;
  for (const KeypointFit& fit : fits) cost += fit.ok ? fit.cost : static_cast<double>(fit.joint->seen.size()) * std::log1p(1e4);
  return cost;
}

/// The cameras, those whose residuals cost most first; joints of two views say little.
std::vector<size_t> WorstFirst(size_t num_cameras, const std::vector<KeypointFit>& at_given, double cauchy_px) {
  std::vector<double> cost(num_cameras, 0), count = cost;
  for (const KeypointFit& fit : at_given) {
    if (!fit.ok || fit.joint->seen.size() < 3) continue;
    for (size_t i = 0; i < fit.residuals_px.size(); ++i) {
      const auto c = static_cast<size_t>(fit.joint->seen[i].camera_idx);
      cost[c] += KeypointCost(fit.residuals_px[i], cauchy_px), count[c] += 1;
    }
  }
  std::vector<size_t> order(cost.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](size_t a, size_t b) { return cost[a] / std::max(count[a], 1.0) > cost[b] / std::max(count[b], 1.0); });
  if (order.size() > kMaxCameras) order.resize(kMaxCameras);
  return order;
}

/// Images are padded to whole blocks, a few per cent at most, or scaled down to another format. In between, a scale about the
/// corner is the same as a turn where people keep to one part of the image, and the turn is the likelier story.
bool IsLikely(const Hypothesis& hypothesis, const geometry::Rig& given) {
  if (hypothesis.kind == Kind::kPose || hypothesis.kind == Kind::kFocal) return true;
  const int k = hypothesis.kind == Kind::kImageHeight ? 1 : 0;
  const double change = std::abs(hypothesis.solution.rig.cameras[hypothesis.camera].camera.params[k] /
                                     given.cameras[hypothesis.camera].camera.params[k] -
                                 1);
  return change < 0.025 || change > 0.2;
}

std::string Describe(const KeypointSuspect& suspect) {
  const char* name = suspect.corrected.camera.name.c_str();
  const double percent = 100 * (suspect.scale - 1), sigma = 100 * suspect.scale_sigma;
  switch (suspect.fault) {
    case Kind::kNone:
      return "no single camera explains the errors";
    case Kind::kPose:
      return Format("%s: turned by %.3f +- %.3f deg and moved by %.1f +- %.1f mm against its calibration", name,
                    RadToDeg(suspect.rotation_rad), RadToDeg(suspect.rotation_sigma_rad), 1e3 * suspect.translation_m,
                    1e3 * suspect.translation_sigma_m);
    case Kind::kFocal:
      return Format("%s: its focal length is %+.2f +- %.2f %% off the calibration's", name, percent, sigma);
    case Kind::kImage:
      return Format("%s: its images are scaled by %.4f +- %.4f against the calibration", name, suspect.scale,
                    suspect.scale_sigma);
    case Kind::kImageWidth:
      return Format("%s: its images are scaled by %.4f +- %.4f in width against the calibration", name, suspect.scale,
                    suspect.scale_sigma);
    case Kind::kImageHeight:
      return Format("%s: its images are scaled by %.4f +- %.4f in height against the calibration", name, suspect.scale,
                    suspect.scale_sigma);
  }
  return "";
}

/// sqrt(u^T C u) along the unit vector of `motion`; the mean of the axes where there is none.
double SigmaAlong(const Eigen::Matrix3d& covariance, const Eigen::Vector3d& motion) {
  const double length = motion.norm();
  if (!(length > 0)) return std::sqrt(covariance.trace() / 3);
  const Eigen::Vector3d u = motion / length;
  return std::sqrt(u.dot(covariance * u));
}

}  // namespace

std::vector<KeypointSuspect> FindSuspects(const geometry::Rig& given, const geometry::Rig& refined,
                                          const std::vector<KeypointJoint>& all_joints, double cauchy_px,
                                          const RunContext& run) {
  if (given.cameras.size() < 3) return {};
  constexpr size_t kMaxObservations = 6000;  // a hundred for each of the few parameters
  const int num_threads = ResolveThreads(run.num_threads);
  const std::vector<KeypointJoint> joints = ThinnedTo(all_joints, kMaxObservations);
  const std::vector<KeypointFit> at_given = FitKeypoints(given, joints, cauchy_px, 2, num_threads);
  const double before = TotalCost(at_given),
               gain = before - TotalCost(FitKeypoints(refined, joints, cauchy_px, 2, num_threads));
  std::vector<Hypothesis> all;
  for (const size_t camera : WorstFirst(given.cameras.size(), at_given, cauchy_px))
    for (const Kind kind : {Kind::kPose, Kind::kFocal, Kind::kImage, Kind::kImageWidth, Kind::kImageHeight})
      all.push_back({kind, camera, 0, FreedomOfFault(given, kind, static_cast<int>(camera)), {}});
  ProgressStage stage(run, "look for the camera that is wrong", 1);
  ParallelFor(static_cast<int64_t>(all.size()), num_threads, [&](int64_t i) {
    Hypothesis& each = all[static_cast<size_t>(i)];
    each.solution = SolveKeypoints(given, joints, each.freedom, cauchy_px, 1, &at_given);
    each.cost = each.solution.status == Status::kOk && IsLikely(each, given)
                    ? TotalCost(FitKeypoints(each.solution.rig, joints, cauchy_px, 2, 1))
                    : before;
  });
  stage.Advance();
  std::vector<KeypointSuspect> suspects;
  for (const bool pose : {false, true}) {
    const Hypothesis* best = nullptr;
    for (const Hypothesis& each : all)
      if ((each.kind == Kind::kPose) == pose && each.cost < (best ? best->cost : before)) best = &each;
    if (!best) continue;
    KeypointSuspect suspect;
    suspect.fault = best->kind, suspect.camera_idx = static_cast<int>(best->camera);
    suspect.explained = gain > 0 ? (before - best->cost) / gain : 1;
    suspects.push_back(std::move(suspect));
  }
  return suspects;
}

void DescribeSuspect(const geometry::Rig& given, const geometry::Rig& adjusted, const KeypointCovariance& covariance,
                     KeypointSuspect* suspect) {
  const auto c = static_cast<size_t>(suspect->camera_idx);
  const geometry::RigCamera &old = given.cameras[c], &found = adjusted.cameras[c];
  const bool known = covariance.status == Status::kOk;
  suspect->corrected = found;
  if (suspect->fault != Kind::kPose) {
    const int k = suspect->fault == Kind::kImageHeight ? 1 : 0;
    suspect->scale = found.camera.params[k] / old.camera.params[k];
    const int row = known ? covariance.begin[c] + k : 0;
    suspect->scale_sigma = known ? std::sqrt(covariance.joint(row, row)) / old.camera.params[k] : NAN;
    suspect->message = Describe(*suspect);
    return;
  }
  const Eigen::Vector3d turn =
      geometry::RotationLog((found.cam_from_world.rotation * old.cam_from_world.rotation.conjugate()).normalized());
  const Eigen::Vector3d shift = found.CenterInWorld() - old.CenterInWorld();
  suspect->rotation_rad = turn.norm(), suspect->translation_m = shift.norm();
  suspect->rotation_sigma_rad = suspect->translation_sigma_m = NAN;
  if (known) {
    const Eigen::Index row = covariance.begin[c + 1] - 6;
    suspect->rotation_sigma_rad = SigmaAlong(covariance.joint.block<3, 3>(row, row), turn);
    suspect->translation_sigma_m =
        SigmaAlong(CentreCovariance(found.cam_from_world, covariance.joint.block<6, 6>(row, row)), shift);
  }
  suspect->message = Describe(*suspect);
}

}  // namespace mvstudio::calib
