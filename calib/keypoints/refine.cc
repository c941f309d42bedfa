#include "calib/keypoints/refine.h"

#include <algorithm>
#include <cmath>
#include <deque>

#include "calib/keypoints/lens_vote.h"
#include "calib/keypoints/refine_steps.h"
#include "core/error.h"
#include "core/format.h"
#include "core/join.h"
#include "core/parallel.h"
#include "core/quiet_run.h"
#include "geometry/rig/rig_covariance.h"

namespace mvstudio::calib {
namespace {

void CheckOptions(const KeypointRefineOptions& o) {
  const auto require = [](bool holds, const char* message) {
    if (!holds) throw UsageError(message);
  };
  require(o.min_score >= 0 && o.min_score <= 1, "option 'min-score' must lie in 0..1");
  require(o.max_persons >= 1, "option 'max-persons' must be at least 1");
  require(o.choice.num_folds >= 2 && o.choice.num_folds <= 50, "option 'keypoint-folds' must lie in 2..50");
  require(o.choice.sigmas >= 0, "option 'choice-sigmas' must not be negative");
  require(o.choice.gap_frames >= 0, "option 'keypoint-gap-frames' must not be negative");
  require(o.max_frames >= 4, "option 'keypoint-frames' must be at least 4");
  require(o.holdout_scale_px > 0, "option 'holdout-scale-px' must be positive");
}

void AddCovariances(const KeypointCovariance& covariance, geometry::Rig* rig) {
  geometry::StatedCovariance stated;
  stated.joint = covariance.joint, stated.begin.assign(covariance.begin.begin(), covariance.begin.end());
  stated.lens_known = covariance.lens_known, stated.pose_known = covariance.pose_known;
  stated.correlated = true;
  geometry::StoreCovariance(stated, rig);
}

double SigmaAlong(const Eigen::Matrix3d& covariance, const Eigen::Vector3d& motion) {
  const double length = motion.norm();
  return std::sqrt(length > 0 ? motion.dot(covariance * motion) / (length * length) : covariance.trace() / 3);
}

void DescribeMotion(const geometry::RigCamera& old, const geometry::RigCamera& found,
                    const std::optional<Eigen::Matrix<double, 6, 6>>& covariance, KeypointCamera* camera) {
  const Eigen::Vector3d turn =
      geometry::RotationLog((found.cam_from_world.rotation * old.cam_from_world.rotation.conjugate()).normalized());
  const Eigen::Vector3d shift = found.CenterInWorld() - old.CenterInWorld();
  camera->rotation_rad = turn.norm(), camera->translation_m = shift.norm();
  camera->focal_change = found.camera.fx() / old.camera.fx() - 1;
  camera->rotation_sigma_rad = camera->translation_sigma_m = std::nan("");
  if (!covariance) return;
  camera->rotation_sigma_rad = SigmaAlong(covariance->topLeftCorner<3, 3>(), turn);
  camera->translation_sigma_m = SigmaAlong(CentreCovariance(found.cam_from_world, *covariance), shift);
}

std::vector<Eigen::Vector2d> MeanResiduals(const std::vector<KeypointFit>& fits, size_t num_cameras, std::vector<int>* counts) {
  std::vector<Eigen::Vector2d> mean(num_cameras, Eigen::Vector2d::Zero());
  counts->assign(num_cameras, 0);
  for (const KeypointFit& fit : fits) {
    for (size_t i = 0; fit.ok && i < fit.residuals_px.size(); ++i) {
      const auto c = static_cast<size_t>(fit.joint->seen[i].camera_idx);
      mean[c] += fit.residuals_px[i], (*counts)[c] += 1;
    }
  }
  for (size_t c = 0; c < num_cameras; ++c) mean[c] /= std::max((*counts)[c], 1);
  return mean;
}

double MeanCost(const std::vector<KeypointFit>& fits) {
  double cost = 0, count = 0;
  for (const KeypointFit& fit : fits) {
    const auto views = static_cast<double>(fit.joint->seen.size());
    cost += fit.ok ? fit.cost : views * std::log1p(1e4), count += views;
  }
  return count > 0 ? cost / count : 0;
}

KeypointRefineReport Failed(Status status, const std::string& message) {
  KeypointRefineReport report;
  report.status = status, report.message = message;
  return report;
}

bool IsFinite(const geometry::Rig& rig) {
  return std::all_of(rig.cameras.begin(), rig.cameras.end(), [](const geometry::RigCamera& camera) {
    return camera.camera.params.allFinite() && camera.cam_from_world.translation.allFinite() &&
           camera.cam_from_world.rotation.coeffs().allFinite();
  });
}

/// Fits of the given and of an adjusted rig to what the adjustment did not see.
struct Measured {
  std::vector<KeypointFit> before, after;
};

/// Measures an adjustment on the test frames of its split, whose joints must outlive `measured`.
void Measure(const geometry::Rig& given, const Refinement& refinement, const std::string& name, double scale_px,
             const std::vector<std::pair<int, int>>& limbs, int num_threads, KeypointRefineReport* report, Measured* measured) {
  const int min_views = given.cameras.size() > 2 ? 3 : 2;
  const std::vector<KeypointJoint>& held = refinement.split().test;
  const std::vector<int> frames = FramesOf(held);
  const auto before = FitKeypoints(given, held, scale_px, min_views, num_threads);
  const auto after = FitKeypoints(refinement.report().rig, held, scale_px, min_views, num_threads);
  KeypointHeldOut part;
  part.name = name, part.kept_input = refinement.report().kept_input;
  part.first_frame = frames.front(), part.last_frame = frames.back();
  part.num_frames = static_cast<int>(frames.size()), part.num_train_frames = refinement.report().num_train_frames;
  part.before = ErrorOf(before, limbs), part.after = ErrorOf(after, limbs);
  report->num_test_frames += part.num_frames;
  report->held_out.push_back(std::move(part));
  measured->before.insert(measured->before.end(), before.begin(), before.end());
  measured->after.insert(measured->after.end(), after.begin(), after.end());
}

void DescribeCameras(const geometry::Rig& given, const KeypointCovariance& covariance, const Measured& measured,
                     KeypointRefineReport* report) {
  const size_t num_cameras = given.cameras.size();
  std::vector<int> counts;
  const std::vector<Eigen::Vector2d> mean_before = MeanResiduals(measured.before, num_cameras, &counts);
  const std::vector<Eigen::Vector2d> mean_after = MeanResiduals(measured.after, num_cameras, &counts);
  for (size_t c = 0; c < num_cameras; ++c) {
    KeypointCamera camera;
    camera.name = given.cameras[c].camera.name, camera.num_detections = counts[c];
    camera.mean_residual_before_px = mean_before[c], camera.mean_residual_after_px = mean_after[c];
    std::optional<Eigen::Matrix<double, 6, 6>> of_pose;
    if (!report->kept_input) {
      const Eigen::Index row = covariance.begin[c + 1] - 6;
      of_pose = covariance.joint.block<6, 6>(row, row);
    }
    DescribeMotion(given.cameras[c], report->rig.cameras[c], of_pose, &camera);
    report->cameras.push_back(camera);
  }
}

void KeepInput(const geometry::Rig& given, const std::string& why, KeypointRefineReport* report) {
  report->kept_input = true, report->rig = given, report->message = why + "; the input is kept";
  report->suspect = {};
}

/// What is adjusted and what is measured.
class Study {
 public:
  Study(const geometry::Rig& given, const std::vector<triangulate::DetectedFrame>& frames, const KeypointRefineOptions& options,
        const std::optional<FrameChoice>& train, const std::optional<FrameChoice>& test, const RunContext& run)
      : run_(run), quiet_(run.progress), gap_frames_(options.choice.gap_frames) {
    RunContext beside = run;
    beside.progress = &quiet_, beside.num_threads = 1;
    if (train || test) {
      parts_.emplace_back(
          given, frames, options, [=](const auto& joints) { return SplitKeypoints(joints, train, test); }, run);
      return;
    }
    const int gap = gap_frames_;
    parts_.emplace_back(
        given, frames, options,
        [](const auto& joints) {
          return KeypointSplit{joints, {}};
        },
        run);
    for (const int half : {0, 1})
      parts_.emplace_back(
          given, frames, options, [=](const auto& joints) { return HalveKeypoints(joints, half, gap); }, beside);
  }

  /// The whole first: it tells what cannot be done at all.
  void Run() {
    parts_[0].Run();
    if (whole().report().status != Status::kOk || parts_.size() == 1) return;
    ProgressStage stage(run_, "the same with each half, for the other to measure", 2);
    ParallelFor(2, ResolveThreads(run_.num_threads), [&](int64_t half) { parts_[static_cast<size_t>(half) + 1].Run(); });
    stage.Advance(2);
  }

  const Refinement& whole() const { return parts_[0]; }

  /// Held-out figures. False, and a status, where there are none.
  bool MeasureAll(const geometry::Rig& given, double scale_px, const std::vector<std::pair<int, int>>& limbs,
                  KeypointRefineReport* report, Measured* measured) const {
    const bool halves = parts_.size() == 3;
    std::string why;
    for (size_t i = halves ? 1 : 0; i < parts_.size(); ++i) {
      const KeypointRefineReport& own = parts_[i].report();
      if (own.status != Status::kOk) {
        why = "the " + std::string(i == 1 ? "first" : "second") + " half alone: " + own.message;
        report->status = own.status, report->notes.push_back(why);
      } else if (parts_[i].split().test.empty()) {
        report->status = Status::kTooFewViews, why = "no point is seen by two cameras at once in the test frames";
      } else {
        const std::string name = !halves ? "test frames" : i == 1 ? "second half" : "first half";
        Measure(given, parts_[i], name, scale_px, limbs, ResolveThreads(run_.num_threads), report, measured);
      }
    }
    if (halves) report->num_gap_frames = NumGapFrames();
    if (report->held_out.empty()) return report->message = why, false;
    report->status = Status::kOk;
    return true;
  }

 private:
  int NumGapFrames() const {
    const std::vector<int> part = CutWithGaps(FramesOf(whole().split().train), 2, gap_frames_);
    return static_cast<int>(std::count(part.begin(), part.end(), -1));
  }

  RunContext run_;
  QuietProgress quiet_;
  int gap_frames_;
  std::deque<Refinement> parts_;  // one; or the whole take and its halves
};

/// Cameras that state how well they know their lenses hold the freed ones; the others are named.
std::string WithoutPrior(const geometry::Rig& given) {
  std::vector<std::string> names;
  for (const geometry::RigCamera& camera : given.cameras)
    if (!camera.params_covariance) names.push_back(camera.camera.name);
  if (names.empty()) return "";
  return "lenses are adjusted, and the calibration states no covariance of those of " + Join(names, ", ") +
         ": nothing but these points holds them";
}

/// Why the adjusted rigs are worse than the given one on what they did not see; empty: they are not. Distances have judged
/// moved lenses already (VoteOnLenses).
std::string WhyWorse(const Measured& measured, double scale_px, bool lenses_moved) {
  constexpr double kMoreScatter = 1.05;
  if (!(MeanCost(measured.after) < MeanCost(measured.before))) return "the adjusted rig explains the held-out frames no better";
  if (lenses_moved) return "";
  const DistanceVote distances = CompareDistances(measured.before, measured.after, scale_px);
  if (distances.num == 0 || distances.scatter_ratio <= kMoreScatter) return "";
  return Format("distances that stay the same scatter %.0f %% more in held-out frames with the adjusted rig",
                100 * (distances.scatter_ratio - 1));
}

}  // namespace

KeypointRefineReport RefineFromKeypoints(const geometry::Rig& given, const std::vector<triangulate::DetectedFrame>& frames,
                                         const std::vector<std::pair<int, int>>& limbs, const std::optional<FrameChoice>& train,
                                         const std::optional<FrameChoice>& test, const KeypointRefineOptions& options,
                                         const RunContext& run) {
  CheckOptions(options);
  if (given.cameras.size() < 2) return Failed(Status::kTooFewViews, "a rig of one camera has nothing to adjust");
  if (!IsFinite(given)) return Failed(Status::kNonFiniteInput, "the calibration is not finite");
  const Eigen::Vector3d offset = MeanCentre(given);
  const geometry::Rig local = geometry::MovedWorld(given, offset);
  Study study(local, frames, options, train, test, run);
  study.Run();
  KeypointRefineReport report = study.whole().report();
  if (report.status != Status::kOk) return report;
  if (report.kept_input) KeepInput(local, "an adjusted rig explains held-out train frames no better", &report);
  Measured measured;
  if (!study.MeasureAll(local, options.holdout_scale_px, limbs, &report, &measured))
    return Failed(report.status, report.message);
  const std::string worse = report.kept_input ? "" : WhyWorse(measured, options.holdout_scale_px, report.plan.MovesLenses());
  if (!worse.empty()) KeepInput(local, worse, &report);
  if (!report.kept_input && report.plan.MovesLenses()) report.lenses = WithoutPrior(given);
  if (report.kept_input) measured.after = measured.before;
  report.before = ErrorOf(measured.before, limbs), report.after = ErrorOf(measured.after, limbs);
  DescribeCameras(local, study.whole().covariance(), measured, &report);
  if (report.kept_input) return report.rig = given, report;
  AddCovariances(study.whole().covariance(), &report.rig);
  report.rig = geometry::MovedWorld(report.rig, -offset);
  report.rig.gauge = geometry::RigGauge::Other(
      report.plan.free_poses ? "the camera centres of the given calibration: their mean, turn and size" : "the other cameras");
  return report;
}

}  // namespace mvstudio::calib
