#include "calib/keypoints/choice.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>

#include "calib/keypoints/lens_conflict.h"
#include "calib/keypoints/lens_vote.h"
#include "calib/keypoints/profile.h"
#include "calib/keypoints/split.h"
#include "calib/points/point_bundle.h"
#include "core/choice/heldout_choice.h"
#include "core/parallel.h"

namespace mvstudio::calib {
namespace {

using Distortion = KeypointPlan::Distortion;

struct Candidate {
  std::string name;
  KeypointPlan plan;
  std::vector<double> block_cost;  // mean cost of a residual in each interval of time
  double mean = 0;
  geometry::Rig rig = {};              // adjusted to all frames
  std::vector<KeypointFit> fits = {};  // of it
  std::string refusal = {};
};

/// Stretches of time, two a fold. Group 3 f and 3 f + 1: the two of fold f; 3 f + 2: the gap after it.
std::map<int, int> Stretches(const std::vector<KeypointJoint>& joints, int num_folds, int gap_frames) {
  const std::vector<int> frames = FramesOf(joints), fold = CutWithGaps(frames, num_folds, gap_frames);
  std::vector<int> size(static_cast<size_t>(num_folds), 0), seen = size;
  for (const int f : fold) size[static_cast<size_t>(std::max(f, 0))] += f >= 0;
  std::map<int, int> stretch;
  int last = 0;
  for (size_t i = 0; i < frames.size(); ++i) {
    const auto f = static_cast<size_t>(std::max(fold[i], 0));
    if (fold[i] >= 0) last = fold[i];
    stretch[frames[i]] = fold[i] < 0 ? 3 * last + 2 : 3 * last + (2 * seen[f]++ >= size[f]);
  }
  return stretch;
}

/// A joint without a point costs as much as one that is off by 100 times the noise in every view.
double CostOf(const KeypointFit& fit) {
  return fit.ok ? fit.cost : static_cast<double>(fit.joint->seen.size()) * std::log1p(1e4);
}

class PlanJudge {
 public:
  PlanJudge(const geometry::Rig& given, const geometry::Rig& start, const std::vector<KeypointJoint>& joints, double cauchy_px,
            const KeypointChoiceOptions& options)
      : given_(given),
        start_(start),
        joints_(ThinnedTo(joints, kMaxObservations)),
        cauchy_px_(cauchy_px),
        num_folds_(options.num_folds),
        stretch_(Stretches(joints_, options.num_folds, options.gap_frames)) {}

  void Score(Candidate* candidate, int num_threads) const {
    std::vector<double> cost(static_cast<size_t>(3 * num_folds_), 0), count = cost;
    const bool moves = candidate->plan.free_poses || candidate->plan.fault != CameraFault::kNone;
    const geometry::Rig start = StartFor(candidate->plan);
    const KeypointProfile profile = moves ? Adjusted(start, candidate->plan, num_threads) : KeypointProfile{};
    candidate->rig = moves ? profile.rig : start;
    candidate->fits = moves ? profile.fits : FitKeypoints(start, joints_, cauchy_px_, 2, num_threads);
    ParallelFor(num_folds_, num_threads, [&](int64_t f) {
      const int fold = static_cast<int>(f);
      Count(moves ? Without(profile, fold, candidate->plan) : start, fold, &cost, &count);
    });
    for (size_t b = 0; b < cost.size(); ++b)
      if (count[b] > 0) candidate->block_cost.push_back(cost[b] / count[b]);
    for (const double value : candidate->block_cost)
      candidate->mean += value / static_cast<double>(candidate->block_cost.size());
  }

 private:
  static constexpr size_t kMaxObservations = 12000;

  geometry::Rig StartFor(const KeypointPlan& plan) const {
    geometry::Rig rig = StartOf(given_, plan);
    for (size_t c = 0; plan.free_poses && c < rig.cameras.size(); ++c)
      rig.cameras[c].cam_from_world = start_.cameras[c].cam_from_world;
    return rig;
  }

  KeypointProfile Adjusted(const geometry::Rig& start, const KeypointPlan& plan, int num_threads) const {
    const KeypointFreedom freedom = FreedomOf(start, plan);
    const geometry::Rig rig = SolveKeypoints(start, joints_, freedom, cauchy_px_, num_threads).rig;
    std::vector<KeypointFit> fits = FitKeypoints(rig, joints_, cauchy_px_, 2, num_threads);
    std::vector<int> group;
    for (const KeypointFit& fit : fits) group.push_back(stretch_.at(fit.joint->frame));
    return ProfileOf(rig, std::move(fits), std::move(group), 3 * num_folds_, freedom, cauchy_px_, num_threads);
  }

  /// Groups of a fold and of the gaps beside it.
  bool IsOut(int group, int fold) const { return group >= 3 * fold - 1 && group <= 3 * fold + 2; }

  geometry::Rig Without(const KeypointProfile& profile, int fold, const KeypointPlan& plan) const {
    std::vector<bool> out(static_cast<size_t>(3 * num_folds_));
    for (size_t group = 0; group < out.size(); ++group) out[group] = IsOut(static_cast<int>(group), fold);
    if (const auto rig = SolveWithout(profile, out)) return *rig;
    std::vector<KeypointJoint> inside;
    for (const KeypointJoint& joint : joints_)
      if (!IsOut(stretch_.at(joint.frame), fold)) inside.push_back(joint);
    const geometry::Rig start = StartFor(plan);
    return SolveKeypoints(start, inside, FreedomOf(start, plan), cauchy_px_, 1).rig;
  }

  void Count(const geometry::Rig& rig, int fold, std::vector<double>* cost, std::vector<double>* count) const {
    std::vector<KeypointJoint> held;
    for (const KeypointJoint& joint : joints_)
      if (stretch_.at(joint.frame) / 3 == fold && stretch_.at(joint.frame) % 3 < 2) held.push_back(joint);
    for (const KeypointFit& fit : FitKeypoints(rig, held, cauchy_px_, 2, 1)) {
      const auto b = static_cast<size_t>(stretch_.at(fit.joint->frame));
      (*cost)[b] += CostOf(fit), (*count)[b] += static_cast<double>(fit.joint->seen.size());
    }
  }

  const geometry::Rig &given_, &start_;
  std::vector<KeypointJoint> joints_;
  double cauchy_px_;
  int num_folds_;
  std::map<int, int> stretch_;
};

double LengthOf(double cost, double cauchy_px) { return cauchy_px * std::sqrt(std::expm1(cost)); }

/// A change that explains nothing more is not looked at in space.
std::string WhyRefused(const geometry::Rig& given, const Candidate& base, const Candidate& candidate, double cauchy_px,
                       int num_threads) {
  const LensVote vote = VoteOnLenses(base.rig, base.fits, candidate.fits, LengthOf(base.mean, cauchy_px),
                                     LengthOf(candidate.mean, cauchy_px), cauchy_px);
  if (!vote.refusal.empty() || vote.by_distances || !(candidate.mean < base.mean)) return vote.refusal;
  const KeypointFreedom freedom = FreedomOf(candidate.rig, candidate.plan);
  const LensConflict conflict = ConflictBySpace(candidate.rig, candidate.fits, freedom, cauchy_px, num_threads);
  return WhyNotDetermined(conflict, vote.bend_px, vote.gain_px, given, freedom);
}

/// Whether a change lowers the held-out error by more than chance. Beside the best of its group alone, a change whose error
/// varies much would pass although it is worse than none.
bool Pays(const HeldOutCandidate& none, const HeldOutCandidate& change, const HeldOutRule& rule) {
  return ChooseHeldOut({none, change}, rule).index == 1;
}

/// `candidates` from least to most change; the first is never refused. Four groups of lens terms are asked one after the other,
/// and one that is freed by chance takes the rig's size with it: they need more.
KeypointPlan Decide(const std::string& group, const std::vector<Candidate>& candidates, double cauchy_px,
                    const KeypointChoiceOptions& options, std::vector<KeypointDecision>* decisions) {
  constexpr double kOfLenses = 1.5;
  HeldOutRule rule;
  rule.standard_errors = (candidates.back().plan.MovesLenses() ? kOfLenses : 1) * options.sigmas, rule.relative = options.gain,
  rule.min_units = 1;
  std::vector<HeldOutCandidate> held_out, allowed;
  std::vector<size_t> place;
  for (size_t i = 0; i < candidates.size(); ++i) {
    const Candidate& each = candidates[i];
    held_out.push_back({each.name, each.block_cost, LengthOf(each.mean, cauchy_px)});
    if (i == 0 || (each.refusal.empty() && Pays(held_out[0], held_out[i], rule)))
      allowed.push_back(held_out.back()), place.push_back(i);
  }
  const HeldOutChoice choice = ChooseHeldOut(held_out, rule);
  const size_t chosen = place[static_cast<size_t>(ChooseHeldOut(allowed, rule).index)];
  for (size_t i = 0; i < candidates.size(); ++i) {
    const double px = held_out[i].loss, error = choice.verdicts[i].worse_by.standard_error;
    const double px_per_cost = cauchy_px * cauchy_px * std::exp(candidates[i].mean) / (2 * std::max(px, 1e-12));
    decisions->push_back({group, candidates[i].name, px, error * px_per_cost, i == chosen, candidates[i].refusal});
  }
  return candidates[chosen].plan;
}

struct Group {
  std::string name;
  std::vector<std::pair<std::string, std::function<void(KeypointPlan*)>>> changes;
};

std::vector<Group> LensGroups() {
  return {{"focal", {{"free", [](KeypointPlan* p) { p->free_focal = true; }}}},
          {"image-scale", {{"free", [](KeypointPlan* p) { p->free_image = true; }}}},
          {"principal-point", {{"free", [](KeypointPlan* p) { p->free_principal = true; }}}},
          {"distortion",
           {{"drop", [](KeypointPlan* p) { p->distortion = Distortion::kDrop; }},
            {"free", [](KeypointPlan* p) { p->distortion = Distortion::kFree; }}}}};
}

}  // namespace

const char* ToString(CameraFault fault) {
  constexpr const char* kNames[] = {"none", "pose", "focal-length", "image-scale", "image-width", "image-height"};
  return kNames[static_cast<int>(fault)];
}

const char* ToString(Distortion distortion) {
  return distortion == Distortion::kKeep ? "keep" : distortion == Distortion::kDrop ? "drop" : "free";
}

geometry::Rig StartOf(const geometry::Rig& given, const KeypointPlan& plan) {
  geometry::Rig rig = given;
  for (geometry::RigCamera& camera : rig.cameras) {
    if (plan.distortion == Distortion::kDrop) camera.camera = geometry::PinholeOf(camera.camera);
    if (plan.distortion == Distortion::kFree && camera.camera.params.size() == 4) {
      camera.camera.model = geometry::LensModel::kBrown1;
      camera.camera.params.conservativeResize(5);
      camera.camera.params[4] = 0;
    }
  }
  return rig;
}

KeypointFreedom FreedomOfFault(const geometry::Rig& rig, CameraFault fault, int camera_idx) {
  KeypointFreedom freedom;
  const auto camera = static_cast<size_t>(camera_idx);
  freedom.fix_pose.assign(rig.cameras.size(), true);
  for (const geometry::RigCamera& each : rig.cameras) freedom.lens_directions.push_back(FixedLens(each.camera));
  if (fault == CameraFault::kPose) return freedom.fix_pose[camera] = false, freedom;
  const Eigen::VectorXd& p = rig.cameras[camera].camera.params;
  Eigen::MatrixXd direction = Eigen::MatrixXd::Zero(p.size(), 1);
  if (fault != CameraFault::kImageHeight) direction(0, 0) = p[0];
  if (fault != CameraFault::kImageWidth) direction(1, 0) = p[1];
  if (fault == CameraFault::kImage || fault == CameraFault::kImageWidth) direction(2, 0) = p[2] + 0.5;
  if (fault == CameraFault::kImage || fault == CameraFault::kImageHeight) direction(3, 0) = p[3] + 0.5;
  freedom.lens_directions[camera] = direction;
  return freedom;
}

KeypointFreedom FreedomOf(const geometry::Rig& rig, const KeypointPlan& plan) {
  if (plan.fault != CameraFault::kNone) return FreedomOfFault(rig, plan.fault, plan.fault_camera);
  KeypointFreedom freedom;
  if (!plan.free_poses) freedom.fix_pose.assign(rig.cameras.size(), true);
  for (const geometry::RigCamera& camera : rig.cameras) {
    const Eigen::VectorXd& p = camera.camera.params;
    std::vector<Eigen::VectorXd> columns;
    const auto add = [&](int parameter, double by) {
      columns.emplace_back(Eigen::VectorXd::Zero(p.size()));
      columns.back()[parameter] = by;
    };
    if (plan.free_image) {
      add(0, p[0]), columns.back()[2] = plan.free_principal ? 0 : p[2] + 0.5;
      add(1, p[1]), columns.back()[3] = plan.free_principal ? 0 : p[3] + 0.5;
    }
    // With the image's scale and the principal point free, a focal length by itself is nothing new.
    if (plan.free_focal && !(plan.free_image && plan.free_principal)) add(0, p[0]), columns.back()[1] = p[1];
    if (plan.free_principal) add(2, p[0]), add(3, p[1]);
    if (plan.distortion == Distortion::kFree && p.size() > 4) add(4, 1);
    Eigen::MatrixXd directions(p.size(), static_cast<Eigen::Index>(columns.size()));
    for (size_t i = 0; i < columns.size(); ++i) directions.col(static_cast<Eigen::Index>(i)) = columns[i];
    freedom.lens_directions.push_back(directions);
  }
  return freedom;
}

KeypointChoice ChooseKeypointPlan(const geometry::Rig& given, const geometry::Rig& start,
                                  const std::vector<KeypointJoint>& joints, double cauchy_px,
                                  const std::vector<KeypointPlan>& faults, const KeypointChoiceOptions& options,
                                  const RunContext& run) {
  const int num_threads = ResolveThreads(run.num_threads);
  const PlanJudge judge(given, start, joints, cauchy_px, options);
  KeypointChoice choice;
  std::vector<Group> groups = {{"extrinsics", {}}};
  for (const KeypointPlan& fault : faults) {
    const std::string name = given.cameras[static_cast<size_t>(fault.fault_camera)].camera.name + ":" + ToString(fault.fault);
    groups[0].changes.emplace_back(name, [&fault](KeypointPlan* p) { *p = fault; });
  }
  groups[0].changes.emplace_back("free", [](KeypointPlan* p) { p->free_poses = true; });
  if (!options.poses_only)
    for (Group& group : LensGroups()) groups.push_back(std::move(group));
  ProgressStage stage(run, "choose what to adjust", static_cast<int64_t>(groups.size()));
  Candidate base{"keep", choice.plan, {}, 0};
  judge.Score(&base, num_threads);
  for (const Group& group : groups) {
    std::vector<Candidate> candidates = {base};
    candidates[0].name = "keep";
    for (const auto& [name, change] : group.changes) {
      Candidate candidate{name, choice.plan, {}, 0};
      change(&candidate.plan);
      // Lenses are adjusted with all poses free: these answer at once.
      if (&group != &groups[0]) candidate.plan.free_poses = true, candidate.plan.fault = CameraFault::kNone;
      judge.Score(&candidate, num_threads);
      if (&group != &groups[0]) candidate.refusal = WhyRefused(given, base, candidate, cauchy_px, num_threads);
      candidates.push_back(std::move(candidate));
    }
    choice.plan = Decide(group.name, candidates, cauchy_px, options, &choice.decisions);
    const size_t first = choice.decisions.size() - candidates.size();
    for (size_t i = 0; i < candidates.size(); ++i)
      if (choice.decisions[first + i].chosen) base = candidates[i];
    stage.Advance();
  }
  return choice;
}

}  // namespace mvstudio::calib
