#include "calib/keypoints/refine_steps.h"

#include <algorithm>
#include <cmath>

#include "core/parallel.h"

namespace mvstudio::calib {
namespace {

bool AnyCrowd(const std::vector<triangulate::DetectedFrame>& frames) {
  for (const triangulate::DetectedFrame& frame : frames)
    for (const auto& people : frame.people)
      if (people.size() > 1) return true;
  return false;
}

/// Who is who, by a rig that may be far off: the usual limit, or four times that where far more detections then agree.
std::vector<KeypointJoint> FirstCollection(const geometry::Rig& rig, const std::vector<triangulate::DetectedFrame>& frames,
                                           triangulate::AssociationOptions options, const RunContext& run,
                                           LeftOutPersons* left_out) {
  std::vector<KeypointJoint> joints = CollectKeypoints(rig, frames, options, run, left_out);
  if (!AnyCrowd(frames)) return joints;
  double diagonal_px = 0;
  for (const geometry::RigCamera& camera : rig.cameras)
    diagonal_px += std::hypot(camera.camera.width_px, camera.camera.height_px) / static_cast<double>(rig.cameras.size());
  options.max_error_px = 4 * 0.015 * diagonal_px;
  LeftOutPersons others;
  std::vector<KeypointJoint> wide = CollectKeypoints(rig, frames, options, run, &others);
  if (!(NumObservations(wide) > 1.1 * static_cast<double>(NumObservations(joints)))) return joints;
  *left_out = std::move(others);
  return wide;
}

bool SameJoints(const std::vector<KeypointJoint>& a, const std::vector<KeypointJoint>& b) {
  const auto same = [](const KeypointJoint& x, const KeypointJoint& y) {
    return x.frame == y.frame && x.person == y.person && x.joint_idx == y.joint_idx && x.seen.size() == y.seen.size() &&
           std::equal(x.seen.begin(), x.seen.end(), y.seen.begin(),
                      [](const auto& p, const auto& q) { return p.camera_idx == q.camera_idx && p.px == q.px; });
  };
  return a.size() == b.size() && std::equal(a.begin(), a.end(), b.begin(), same);
}

}  // namespace

Refinement::Refinement(const geometry::Rig& given, const std::vector<triangulate::DetectedFrame>& frames,
                       const KeypointRefineOptions& options, Split split, const RunContext& run)
    : given_(given),
      frames_(frames),
      options_(options),
      make_split_(std::move(split)),
      run_(run),
      num_threads_(ResolveThreads(run.num_threads)) {
  association_.min_score = options.min_score;
  association_.max_persons = options.max_persons;
}

void Refinement::Run() {
  if (!AdjustPoses()) return;
  std::vector<KeypointCulprit> culprits = FindCulprits(given_, solution_.rig, train_, solution_.cauchy_px, run_);
  std::vector<KeypointPlan> faults;
  for (const KeypointCulprit& culprit : culprits) {
    faults.emplace_back();
    faults.back().fault = culprit.fault, faults.back().fault_camera = culprit.camera_idx;
  }
  KeypointChoiceOptions choose = options_.choice;
  choose.poses_only = !options_.lenses;
  choose.num_folds = std::min(choose.num_folds, static_cast<int>(FramesOf(train_).size() / 2));
  const KeypointChoice choice = ChooseKeypointPlan(given_, solution_.rig, train_, solution_.cauchy_px, faults, choose, run_);
  report_.plan = choice.plan, report_.decisions = choice.decisions;
  if (!report_.plan.Changes()) {
    report_.kept_input = true, report_.rig = given_;
    return;
  }
  if (!AdjustAll()) return;
  for (const KeypointCulprit& culprit : culprits)
    if (choice.plan.fault == culprit.fault) report_.culprit = culprit;
  if (report_.culprit.fault != CameraFault::kNone) DescribeCulprit(given_, report_.rig, covariance_, &report_.culprit);
}

bool Refinement::Fail(Status status, const std::string& message) {
  report_.status = status, report_.message = message;
  return false;
}

bool Refinement::AdjustPoses() {
  ProgressStage stage(run_, "adjust the cameras' poses", 3);
  std::vector<KeypointJoint> joints = FirstCollection(given_, frames_, association_, run_, &report_.left_out);
  KeypointPlan plan;
  plan.free_poses = true;
  const KeypointFreedom freedom = FreedomOf(given_, plan);
  geometry::Rig start = given_;
  for (int round = 0; round < 3; ++round) {
    split_ = make_split_(joints);
    train_ = Limited(split_.train, options_.max_frames);
    const std::string why = WhyTooFew(given_, train_);
    if (!why.empty()) return Fail(Status::kTooFewViews, why);
    solution_ = SolveKeypoints(start, train_, freedom, 0, num_threads_);
    if (solution_.status != Status::kOk) return Fail(solution_.status, solution_.message);
    solution_.rig = AlignToGiven(solution_.rig, given_);
    stage.Advance();
    if (!AnyCrowd(frames_)) break;
    std::vector<KeypointJoint> again = CollectKeypoints(solution_.rig, frames_, association_, run_, &report_.left_out);
    if (SameJoints(joints, again)) break;
    joints = std::move(again), start = solution_.rig;
  }
  report_.cauchy_px = solution_.cauchy_px;
  report_.sigma_px = solution_.cauchy_px * std::sqrt(3.0 / (2 * std::log(2.0)));
  report_.num_train_frames = static_cast<int>(FramesOf(train_).size());
  report_.num_train_joints = solution_.num_joints;
  return MeasureCovariance(freedom);
}

bool Refinement::MeasureCovariance(const KeypointFreedom& freedom) {
  covariance_ = CovarianceOfKeypoints(solution_, train_, freedom, num_threads_, &given_);
  const std::string loose = WhyLoose(solution_.rig, covariance_);
  return loose.empty() || Fail(Status::kDegenerate, loose);
}

bool Refinement::AdjustAll() {
  const KeypointPlan& plan = report_.plan;
  if (plan.MovesLenses() || !plan.free_poses) {
    geometry::Rig start = StartOf(given_, plan);
    for (size_t c = 0; plan.free_poses && c < start.cameras.size(); ++c)
      start.cameras[c].cam_from_world = solution_.rig.cameras[c].cam_from_world;
    const KeypointFreedom freedom = FreedomOf(start, plan);
    solution_ = SolveKeypoints(start, train_, freedom, solution_.cauchy_px, num_threads_);
    if (solution_.status != Status::kOk) return Fail(solution_.status, solution_.message);
    // With one camera free the others hold the frame.
    if (plan.free_poses) solution_.rig = AlignToGiven(solution_.rig, given_);
    if (!MeasureCovariance(freedom)) return false;
  }
  report_.rig = solution_.rig;
  return true;
}

}  // namespace mvstudio::calib
