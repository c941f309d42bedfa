#include "calib/keypoints/refine_steps.h"

#include <algorithm>
#include <cmath>

#include "calib/keypoints/place.h"
#include "calib/keypoints/profile.h"
#include "core/format.h"
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

constexpr size_t kJudges = 6000;       // observations
constexpr double kLeastFitting = 0.4;  // a camera of which a smaller part of the views fits has no part in the rig

/// Cameras, and what part of their views fits.
using Misfits = std::vector<std::pair<double, size_t>>;

/// The cameras of which less than most views fit a solution, the worst first. Empty optional: nothing speaks against it; an
/// empty list: none stands out, and the residuals are beyond what detectors err.
std::optional<Misfits> CamerasThatDoNotFit(const KeypointSolution& solution, const std::vector<KeypointJoint>& joints,
                                           int num_threads) {
  constexpr double kMostNoise = 0.004, kLeastShare = 0.6;  // of the images' diagonal; of a Cauchy variable 0.8 fit
  std::vector<double> fitting(solution.rig.cameras.size(), 0), count = fitting;
  if (solution.status != Status::kOk) return Misfits();
  for (const KeypointFit& fit : FitKeypoints(solution.rig, joints, solution.cauchy_px, 2, num_threads)) {
    for (size_t v = 0; v < fit.residuals_px.size(); ++v) {
      const auto c = static_cast<size_t>(fit.joint->seen[v].camera_idx);
      count[c] += 1, fitting[c] += fit.residuals_px[v].norm() <= kInlierScales * solution.cauchy_px;
    }
  }
  Misfits wrong;
  double diagonal_px = 0;
  for (size_t c = 0; c < count.size(); ++c) {
    const geometry::Camera& lens = solution.rig.cameras[c].camera;
    diagonal_px += std::hypot(lens.width_px, lens.height_px) / static_cast<double>(count.size());
    if (fitting[c] < kLeastShare * count[c]) wrong.emplace_back(fitting[c] / count[c], c);
  }
  if (wrong.empty() && std::sqrt(3.0) * solution.cauchy_px <= kMostNoise * diagonal_px) return std::nullopt;
  std::sort(wrong.begin(), wrong.end());
  return wrong;
}

/// By the cost under the smaller of the two scales.
bool IsBetter(const KeypointSolution& a, const KeypointSolution& b, const std::vector<KeypointJoint>& joints, int num_threads) {
  if (a.status != Status::kOk || b.status != Status::kOk) return a.status == Status::kOk;
  const double scale = std::min(a.cauchy_px, b.cauchy_px);
  const auto cost = [&](const geometry::Rig& rig) {
    double sum = 0;
    for (const KeypointFit& fit : FitKeypoints(rig, joints, scale, 2, num_threads))
      sum += fit.ok ? fit.cost : static_cast<double>(fit.joint->seen.size()) * std::log1p(1e4);
    return sum;
  };
  return cost(a.rig) < cost(b.rig);
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
  std::vector<KeypointSuspect> suspects = FindSuspects(given_, solution_.rig, train_, solution_.cauchy_px, run_);
  std::vector<KeypointPlan> faults;
  for (const KeypointSuspect& suspect : suspects) {
    faults.emplace_back();
    faults.back().fault = suspect.fault, faults.back().fault_camera = suspect.camera_idx;
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
  for (const KeypointSuspect& suspect : suspects)
    if (choice.plan.fault == suspect.fault) report_.suspect = suspect;
  if (report_.suspect.fault != CameraFault::kNone) DescribeSuspect(given_, report_.rig, covariance_, &report_.suspect);
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
    solution_ = SolvePoses(start, freedom);
    if (solution_.status != Status::kOk) return Fail(solution_.status, solution_.message);
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

KeypointSolution Refinement::SolvePoses(const geometry::Rig& start, const KeypointFreedom& freedom) const {
  KeypointSolution best = SolveKeypoints(start, train_, freedom, 0, num_threads_);
  best.rig = AlignToGiven(best.rig, given_);
  const std::vector<KeypointJoint> judges = ThinnedTo(train_, kJudges);
  const std::optional<Misfits> misfits = CamerasThatDoNotFit(best, judges, num_threads_);
  if (!misfits) return best;
  std::vector<size_t> wrong;
  for (const auto& [share, camera] : *misfits) wrong.push_back(camera);
  std::vector<std::optional<geometry::Rig>> starts = {PlaceAnew(given_, train_)};
  if (!wrong.empty()) starts.push_back(PlaceByOthers(best.rig, train_, wrong));
  for (const std::optional<geometry::Rig>& other : starts) {
    if (!other) continue;
    KeypointSolution solution = SolveKeypoints(AlignToGiven(*other, given_), train_, freedom, 0, num_threads_);
    solution.rig = AlignToGiven(solution.rig, given_);
    if (IsBetter(solution, best, judges, num_threads_)) best = std::move(solution);
  }
  return best;
}

bool Refinement::MeasureCovariance(const KeypointFreedom& freedom) {
  covariance_ = CovarianceOfKeypoints(solution_, train_, freedom, num_threads_, &given_);
  const std::optional<Misfits> misfits = CamerasThatDoNotFit(solution_, ThinnedTo(train_, kJudges), num_threads_);
  const std::string loose = WhyLoose(solution_.rig, covariance_, !misfits);
  if (!loose.empty()) return Fail(Status::kDegenerate, loose);
  report_.unsteady = WhyUnsteady(solution_.rig, covariance_);
  if (report_.unsteady.empty() && misfits && !misfits->empty() && misfits->front().first < kLeastFitting)
    report_.unsteady = Format("of camera %s's views %.0f %% fit the others' points",
                              solution_.rig.cameras[misfits->front().second].camera.name.c_str(), 100 * misfits->front().first);
  return true;
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
