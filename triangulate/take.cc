#include "triangulate/take.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include "core/check.h"
#include "core/parallel.h"
#include "triangulate/calibration_covariance.h"
#include "triangulate/exhaustive_dlt.h"
#include "triangulate/noise.h"

namespace mvstudio::triangulate {
namespace {

constexpr char kExhaustiveDlt[] = "exhaustive-dlt";

PointMethod MethodByName(const std::string& name) {
  if (name == "auto" || name == "robust" || name == kExhaustiveDlt) return PointMethod::kRobust;
  if (name == "all-views") return PointMethod::kAllViews;
  if (name == "linear") return PointMethod::kLinear;
  if (name == "midpoint") return PointMethod::kMidpoint;
  throw UsageError("--method " + name + " is unknown; choose auto, all-views, linear, midpoint or exhaustive-dlt");
}

PointOptions ToPointOptions(const TakeOptions& o) {
  PointOptions options;
  options.method = MethodByName(o.method);
  options.max_residual_sigmas = o.max_residual_sigmas;
  options.min_parallax_sigmas = o.min_parallax_sigmas;
  options.max_distance_m = o.max_distance_m;
  options.min_views = o.min_views;
  return options;
}

AssociationOptions ToAssociationOptions(const TakeOptions& o) {
  AssociationOptions options;
  options.max_error_px = o.association_error_px;
  options.min_score = o.min_score;
  options.max_persons = o.max_persons;
  return options;
}

/// What the cameras saw of one joint; sigmas are relative to that of a detection with score 1.
std::vector<Observation> Observe(const DetectedFrame& frame, const std::vector<int>& choice, int joint_idx,
                                 const TakeOptions& options) {
  std::vector<Observation> observations;
  for (size_t c = 0; c < choice.size(); ++c) {
    if (choice[c] < 0) continue;
    const Keypoint& key = frame.people[c][choice[c]][joint_idx];
    if (!(key.score > 0) || key.score < options.min_score) continue;
    const double score = std::min(key.score, 1.0);
    observations.push_back({static_cast<int>(c), key.px, std::pow(score, -options.score_power), key.score});
  }
  return observations;
}

double MeanDiagonalPx(const geometry::Rig& rig) {
  double sum = 0;
  for (const geometry::RigCamera& camera : rig.cameras) sum += std::hypot(camera.camera.width_px, camera.camera.height_px);
  return sum / static_cast<double>(rig.cameras.size());
}

void ResolveSigma(const geometry::Rig& rig, const PreparedRig& prepared, const TakeOptions& options,
                  const PointOptions& point_options, int num_threads, std::vector<std::vector<Observation>>* observations,
                  double* sigma_px) {
  *sigma_px = options.sigma_px;
  if (options.method == kExhaustiveDlt) return;
  if (options.sigma_px == 0) {
    *sigma_px = EstimateNoiseScale(prepared, *observations, point_options, 0.005 * MeanDiagonalPx(rig), 1.0, num_threads);
  }
  for (auto& each : *observations) {
    for (Observation& observation : each) observation.sigma_px *= *sigma_px;
  }
}

void CheckFrames(const geometry::Rig& rig, const std::vector<DetectedFrame>& frames, int num_joints) {
  for (const DetectedFrame& frame : frames) {
    MVS_CHECK(frame.people.size() == rig.cameras.size(),
              "frame " << frame.frame << " lists " << frame.people.size() << " cameras");
    for (const auto& people : frame.people) {
      for (const DetectedPerson& person : people) {
        MVS_CHECK(static_cast<int>(person.size()) == num_joints, "frame " << frame.frame << ": " << person.size() << " joints");
      }
    }
  }
}

/// Everything that is to be triangulated: one set of observations for each of the result's points.
struct Problems {
  std::vector<TakePoint> points;
  std::vector<std::vector<Observation>> observations;
  int num_persons = 0;
};

Problems Collect(const std::vector<DetectedFrame>& frames, const std::vector<std::vector<std::vector<int>>>& assignment,
                 int num_joints, const TakeOptions& options) {
  Problems problems;
  for (size_t f = 0; f < frames.size(); ++f) {
    for (size_t p = 0; p < assignment[f].size(); ++p) {
      for (int j = 0; j < num_joints; ++j) {
        problems.observations.push_back(Observe(frames[f], assignment[f][p], j, options));
        problems.points.push_back({frames[f].frame, static_cast<int>(p), j, {}});
      }
    }
    problems.num_persons = std::max(problems.num_persons, static_cast<int>(assignment[f].size()));
  }
  return problems;
}

/// Calls `solve(i)` for every point, in blocks that are worth a thread's while.
void ForEachPoint(size_t num_points, const RunContext& run, const std::function<Point(int64_t)>& solve,
                  std::vector<TakePoint>* points) {
  constexpr int64_t kBlock = 64;
  const int64_t count = static_cast<int64_t>(num_points);
  ParallelFor((count + kBlock - 1) / kBlock, run.num_threads, [&](int64_t block) {
    for (int64_t i = block * kBlock; i < std::min(count, (block + 1) * kBlock); ++i) (*points)[i].point = solve(i);
  });
}

std::vector<CameraDiagnosis> Diagnose(const PreparedRig& prepared, const Problems& problems) {
  std::vector<DiagnosedPoint> diagnosed;
  for (size_t i = 0; i < problems.points.size(); ++i) {
    diagnosed.push_back({problems.points[i].frame, &problems.points[i].point, &problems.observations[i]});
  }
  return DiagnoseCameras(prepared, diagnosed);
}

/// How a point is solved, by a method's name.
PointSolver SolverFor(const geometry::Rig& rig, const PreparedRig& prepared, const TakeOptions& options,
                      const std::string& method) {
  if (method == kExhaustiveDlt) {
    const ExhaustiveDltOptions dlt{options.max_error_px, options.min_score, 2};
    return [&rig, dlt](const std::vector<Observation>& seen) { return TriangulateExhaustiveDlt(rig, seen, dlt); };
  }
  PointOptions point = ToPointOptions(options);
  point.method = MethodByName(method);
  const bool with_calibration = options.calibration_covariance;
  return [&prepared, point, with_calibration](const std::vector<Observation>& seen) {
    Point solved = TriangulatePoint(prepared, seen, point);
    if (with_calibration) AddCalibrationCovariance(prepared, seen, &solved);
    return solved;
  };
}

std::vector<PointLabel> Labels(const Problems& problems) {
  std::vector<PointLabel> labels;
  for (const TakePoint& point : problems.points) labels.push_back({point.frame, point.person, point.joint_idx});
  return labels;
}

/// All candidates choose among the views: whether some are wrong is not to be guessed from a sample of the take.
MethodChoice Choose(const geometry::Rig& rig, const PreparedRig& prepared, const TakeOptions& options, const Problems& problems,
                    int num_threads) {
  std::vector<MethodCandidate> candidates;
  double cost = 3;
  for (const char* name : {"robust"}) {
    candidates.push_back({name, cost--, SolverFor(rig, prepared, options, name)});
  }
  MethodChoiceOptions choice;
  choice.max_points = options.holdout_points;
  return ChooseMethod(prepared, problems.observations, Labels(problems), candidates, choice, num_threads);
}

/// Every k-th point that several cameras see, with what the others say of each of its detections.
LeftOutSummary HoldOut(const PreparedRig& prepared, const Problems& problems, const PointSolver& solve, int max_points,
                       int num_threads) {
  std::vector<std::vector<Observation>> points;
  std::vector<PointLabel> labels;
  const std::vector<PointLabel> all = Labels(problems);
  const size_t stride = std::max<size_t>(1, all.size() / static_cast<size_t>(std::max(max_points, 1)));
  for (size_t i = 0; max_points > 0 && i < all.size(); i += stride) {
    points.push_back(problems.observations[i]);
    labels.push_back(all[i]);
  }
  return SummarizeLeftOut(prepared, LeaveOneCameraOut(prepared, points, solve, num_threads), labels);
}

}  // namespace

void CheckOptions(const geometry::Rig& rig, const TakeOptions& o) {
  MethodByName(o.method);
  const auto require = [](bool holds, const char* message) {
    if (!holds) throw UsageError(message);
  };
  require(o.sigma_px >= 0 && std::isfinite(o.sigma_px), "--sigma-px must be a positive number, or 0 to estimate it");
  require(o.min_score >= 0 && o.min_score <= 1, "--min-score must lie in 0..1");
  require(o.score_power >= 0 && o.score_power <= 4, "--score-power must lie in 0..4");
  require(o.max_residual_sigmas > 0, "--max-residual-sigmas must be positive");
  require(o.min_parallax_sigmas > 0, "--min-parallax-sigmas must be positive");
  require(o.max_distance_m >= 0, "--max-distance-m must not be negative");
  require(o.min_views >= 2, "--min-views must be at least 2");
  require(o.max_persons >= 1, "--max-persons must be at least 1");
  require(o.max_error_px > 0, "--max-error-px must be positive");
  require(o.holdout_points >= 0, "--holdout-points must not be negative");
  require(o.method != kExhaustiveDlt || rig.cameras.size() <= 20, "--method exhaustive-dlt takes at most 20 cameras; use auto");
}

TakeResult TriangulateTake(const geometry::Rig& rig, const std::vector<DetectedFrame>& frames, int num_joints,
                           const TakeOptions& options, const RunContext& run) {
  CheckOptions(rig, options);
  CheckFrames(rig, frames, num_joints);
  ProgressStage stage(run, "triangulate", 4);
  const PreparedRig prepared = Prepare(rig, options.ignore_distortion || options.method == kExhaustiveDlt);
  Problems problems = Collect(frames, AssociateTake(prepared, frames, ToAssociationOptions(options), run), num_joints, options);
  stage.Advance();

  TakeResult result;
  ResolveSigma(rig, prepared, options, ToPointOptions(options), run.num_threads, &problems.observations, &result.sigma_px);
  stage.Advance();

  result.method = options.method;
  if (options.method == "auto") {
    result.choice = Choose(rig, prepared, options, problems, run.num_threads);
    result.method = result.choice.scores[result.choice.chosen].name;
  }
  const PointSolver solve = SolverFor(rig, prepared, options, result.method);
  result.holdout = HoldOut(prepared, problems, solve, options.holdout_points, run.num_threads);
  stage.Advance();

  ForEachPoint(problems.points.size(), run, [&](int64_t i) { return solve(problems.observations[static_cast<size_t>(i)]); },
               &problems.points);
  result.cameras = Diagnose(prepared, problems);
  result.num_persons = problems.num_persons;
  result.points = std::move(problems.points);
  result.observations = std::move(problems.observations);
  stage.Advance();
  return result;
}

}  // namespace mvstudio::triangulate
