#include "calib/keypoint_refine.h"

#include <algorithm>
#include <cmath>

#include "calib/keypoint_split.h"
#include "core/error.h"
#include "core/parallel.h"
#include "geometry/rig_covariance.h"

namespace mvstudio::calib {
namespace {

void CheckOptions(const KeypointRefineOptions& o) {
  const auto require = [](bool holds, const char* message) {
    if (!holds) throw UsageError(message);
  };
  require(o.min_score >= 0 && o.min_score <= 1, "--min-score must lie in 0..1");
  require(o.max_persons >= 1, "--max-persons must be at least 1");
  require(o.choice.num_folds >= 2 && o.choice.num_folds <= 50, "--keypoint-folds must lie in 2..50");
  require(o.choice.sigmas >= 0, "--choice-sigmas must not be negative");
  require(o.max_frames >= 4, "--keypoint-frames must be at least 4");
  require(o.holdout_scale_px > 0, "--holdout-scale-px must be positive");
}

bool AnyCrowd(const std::vector<triangulate::DetectedFrame>& frames) {
  for (const triangulate::DetectedFrame& frame : frames)
    for (const auto& people : frame.people)
      if (people.size() > 1) return true;
  return false;
}

size_t NumObservations(const std::vector<KeypointJoint>& joints) {
  size_t count = 0;
  for (const KeypointJoint& joint : joints) count += joint.seen.size();
  return count;
}

/// Who is who, by a rig that may be far off: the usual limit, or four times that where far more detections then agree.
std::vector<KeypointJoint> FirstCollection(const geometry::Rig& rig, const std::vector<triangulate::DetectedFrame>& frames,
                                           triangulate::AssociationOptions options, const RunContext& run) {
  std::vector<KeypointJoint> joints = CollectKeypoints(rig, frames, options, run);
  if (!AnyCrowd(frames)) return joints;
  double diagonal_px = 0;
  for (const geometry::RigCamera& camera : rig.cameras)
    diagonal_px += std::hypot(camera.camera.width_px, camera.camera.height_px) / static_cast<double>(rig.cameras.size());
  options.max_error_px = 4 * 0.015 * diagonal_px;
  std::vector<KeypointJoint> wide = CollectKeypoints(rig, frames, options, run);
  return NumObservations(wide) > 1.1 * static_cast<double>(NumObservations(joints)) ? wide : joints;
}

bool SameJoints(const std::vector<KeypointJoint>& a, const std::vector<KeypointJoint>& b) {
  const auto same = [](const KeypointJoint& x, const KeypointJoint& y) {
    return x.frame == y.frame && x.person == y.person && x.joint_idx == y.joint_idx && x.seen.size() == y.seen.size() &&
           std::equal(x.seen.begin(), x.seen.end(), y.seen.begin(),
                      [](const auto& p, const auto& q) { return p.camera_idx == q.camera_idx && p.px == q.px; });
  };
  return a.size() == b.size() && std::equal(a.begin(), a.end(), b.begin(), same);
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

/// The adjustment in a world whose origin lies amid the cameras.
class Refinement {
 public:
  Refinement(const geometry::Rig& given, const std::vector<triangulate::DetectedFrame>& frames,
             const KeypointRefineOptions& options, const std::optional<FrameChoice>& train,
             const std::optional<FrameChoice>& test, const RunContext& run)
      : given_(given),
        frames_(frames),
        options_(options),
        train_(train),
        test_(test),
        run_(run),
        num_threads_(ResolveThreads(run.num_threads)) {
    association_.min_score = options.min_score;
    association_.max_persons = options.max_persons;
  }

  KeypointRefineReport Run() {
    if (!AdjustPoses()) return report_;
    const std::vector<KeypointCulprit> culprits = FindCulprits(given_, solution_.rig, split_.train, solution_.cauchy_px, run_);
    std::vector<KeypointPlan> faults;
    for (const KeypointCulprit& culprit : culprits) {
      faults.emplace_back();
      faults.back().fault = culprit.fault, faults.back().fault_camera = culprit.camera_idx;
    }
    KeypointChoiceOptions choose = options_.choice;
    choose.poses_only = !options_.lenses;
    choose.num_folds = std::min(choose.num_folds, static_cast<int>(FramesOf(split_.train).size() / 2));
    const KeypointChoice choice =
        ChooseKeypointPlan(given_, solution_.rig, split_.train, solution_.cauchy_px, faults, choose, run_);
    report_.plan = choice.plan, report_.decisions = choice.decisions;
    for (const KeypointCulprit& culprit : culprits)
      if (choice.plan.fault == culprit.fault) report_.culprit = culprit;
    if (report_.plan.Changes()) AdjustAll();
    return report_;
  }

  const KeypointSplit& split() const { return split_; }
  const KeypointCovariance& covariance() const { return covariance_; }

 private:
  bool Fail(Status status, const std::string& message) {
    report_.status = status, report_.message = message;
    return false;
  }

  bool AdjustPoses() {
    ProgressStage stage(run_, "adjust the cameras' poses", 3);
    std::vector<KeypointJoint> joints = FirstCollection(given_, frames_, association_, run_);
    KeypointPlan plan;
    plan.free_poses = true;
    geometry::Rig start = given_;
    for (int round = 0; round < 3; ++round) {
      split_ = SplitKeypoints(joints, train_, test_, options_.max_frames);
      const std::string why = WhyTooFew(given_, split_);
      if (!why.empty()) return Fail(Status::kTooFewViews, why);
      solution_ = SolveKeypoints(start, split_.train, FreedomOf(start, plan), 0, num_threads_);
      if (solution_.status != Status::kOk) return Fail(solution_.status, solution_.message);
      solution_.rig = AlignToGiven(solution_.rig, given_);
      stage.Advance();
      if (!AnyCrowd(frames_)) break;
      std::vector<KeypointJoint> again = CollectKeypoints(solution_.rig, frames_, association_, run_);
      if (SameJoints(joints, again)) break;
      joints = std::move(again), start = solution_.rig;
    }
    report_.cauchy_px = solution_.cauchy_px;
    report_.sigma_px = solution_.cauchy_px * std::sqrt(3.0 / (2 * std::log(2.0)));
    report_.num_train_frames = static_cast<int>(FramesOf(split_.train).size());
    report_.num_test_frames = static_cast<int>(FramesOf(split_.test).size());
    report_.num_train_joints = solution_.num_joints;
    const KeypointCovariance covariance = CovarianceOfKeypoints(solution_, split_.train, FreedomOf(start, plan), num_threads_);
    const std::string loose = WhyLoose(solution_.rig, covariance);
    return loose.empty() ? true : Fail(Status::kDegenerate, loose);
  }

  bool AdjustAll() {
    geometry::Rig start = StartOf(given_, report_.plan);
    for (size_t c = 0; report_.plan.free_poses && c < start.cameras.size(); ++c)
      start.cameras[c].cam_from_world = solution_.rig.cameras[c].cam_from_world;
    const KeypointFreedom freedom = FreedomOf(start, report_.plan);
    if (report_.plan.MovesLenses() || !report_.plan.free_poses) {
      solution_ = SolveKeypoints(start, split_.train, freedom, solution_.cauchy_px, num_threads_);
      if (solution_.status != Status::kOk) return Fail(solution_.status, solution_.message);
      // With one camera free the others hold the frame.
      if (report_.plan.free_poses) solution_.rig = AlignToGiven(solution_.rig, given_);
    }
    covariance_ = CovarianceOfKeypoints(solution_, split_.train, freedom, num_threads_, &given_);
    const std::string loose = WhyLoose(solution_.rig, covariance_);
    if (!loose.empty()) return Fail(Status::kDegenerate, loose);
    report_.rig = solution_.rig;
    return true;
  }

  const geometry::Rig& given_;
  const std::vector<triangulate::DetectedFrame>& frames_;
  const KeypointRefineOptions& options_;
  const std::optional<FrameChoice>&train_, &test_;
  const RunContext& run_;
  int num_threads_;
  triangulate::AssociationOptions association_;
  KeypointSplit split_;
  KeypointSolution solution_;
  KeypointCovariance covariance_;
  KeypointRefineReport report_;
};

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

void DescribeCameras(const geometry::Rig& given, const Refinement& refinement, const std::vector<KeypointFit>& before,
                     const std::vector<KeypointFit>& after, KeypointRefineReport* report) {
  const size_t num_cameras = given.cameras.size();
  std::vector<int> counts;
  const std::vector<Eigen::Vector2d> mean_before = MeanResiduals(before, num_cameras, &counts);
  const std::vector<Eigen::Vector2d> mean_after = MeanResiduals(after, num_cameras, &counts);
  for (size_t c = 0; c < num_cameras; ++c) {
    KeypointCamera camera;
    camera.name = given.cameras[c].camera.name, camera.num_detections = counts[c];
    camera.mean_residual_before_px = mean_before[c], camera.mean_residual_after_px = mean_after[c];
    std::optional<Eigen::Matrix<double, 6, 6>> covariance;
    if (!report->kept_input) {
      const Eigen::Index row = refinement.covariance().begin[c + 1] - 6;
      covariance = refinement.covariance().joint.block<6, 6>(row, row);
    }
    DescribeMotion(given.cameras[c], report->rig.cameras[c], covariance, &camera);
    report->cameras.push_back(camera);
  }
}

void KeepInput(const geometry::Rig& given, const std::string& why, KeypointRefineReport* report) {
  report->kept_input = true, report->rig = given, report->message = why + "; the input is kept";
  report->culprit = {};
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
  Refinement refinement(local, frames, options, train, test, run);
  KeypointRefineReport report = refinement.Run();
  if (report.status != Status::kOk) return report;
  if (!report.plan.Changes()) KeepInput(local, "an adjusted rig explains held-out train frames no better", &report);

  const int min_views = given.cameras.size() > 2 ? 3 : 2, num_threads = ResolveThreads(run.num_threads);
  const std::vector<KeypointJoint>& held = refinement.split().test;
  const std::vector<KeypointFit> before = FitKeypoints(local, held, options.holdout_scale_px, min_views, num_threads);
  std::vector<KeypointFit> after = FitKeypoints(report.rig, held, options.holdout_scale_px, min_views, num_threads);
  if (!report.kept_input && !(MeanCost(after) < MeanCost(before))) {
    KeepInput(local, "the adjusted rig explains the test frames no better", &report);
    after = before;
  }
  report.before = ErrorOf(before, limbs), report.after = ErrorOf(after, limbs);
  DescribeCameras(local, refinement, before, after, &report);
  if (report.kept_input) return report.rig = given, report;
  AddCovariances(refinement.covariance(), &report.rig);
  report.rig = geometry::MovedWorld(report.rig, -offset);
  report.rig.gauge =
      report.plan.free_poses ? "the camera centres of the given calibration: their mean, turn and size" : "the other cameras";
  return report;
}

}  // namespace mvstudio::calib
