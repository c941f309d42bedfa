#include "triangulate/take/steps.h"

#include <algorithm>
#include <cmath>

#include "core/check.h"
#include "core/parallel.h"
#include "triangulate/point/calibration_covariance.h"
#include "triangulate/point/exhaustive_dlt.h"
#include "triangulate/point/noise.h"
#include "triangulate/take/cause.h"

namespace mvstudio::triangulate {
namespace {

PointOptions ToPointOptions(const TakeOptions& o, const TakeMethod& method) {
  PointOptions options;
  options.method = method.point;
  options.select_views = o.select_views;
  options.max_residual_sigmas = o.max_residual_sigmas;
  options.min_parallax_sigmas = o.min_parallax_sigmas;
  options.max_distance_m = o.max_distance_m;
  options.min_views = o.min_views;
  return options;
}

AssociationOptions ToAssociationOptions(const TakeOptions& o, const MirrorGroups& mirror) {
  AssociationOptions options;
  for (const auto& group : mirror) options.mirror.insert(options.mirror.end(), group.begin(), group.end());
  options.max_error_px = o.association_error_px;
  options.min_score = o.min_score;
  options.max_persons = o.max_persons;
  return options;
}

bool Counts(const Keypoint& key, const TakeOptions& options) { return key.score > 0 && !(key.score < options.min_score); }

/// What the cameras saw of one joint; `sigma_px` of a detection with score 1.
std::vector<Observation> Observe(const DetectedFrame& frame, const std::vector<int>& choice, int joint_idx,
                                 const TakeOptions& options, double sigma_px) {
  std::vector<Observation> observations;
  for (size_t c = 0; c < choice.size(); ++c) {
    if (choice[c] < 0) continue;
    const Keypoint& key = frame.people[c][choice[c]][joint_idx];
    if (!Counts(key, options)) continue;
    const double score = std::min(key.score, 1.0);
    observations.push_back({static_cast<int>(c), key.px, std::pow(score, -options.score_power) * sigma_px, key.score});
  }
  return observations;
}

double MeanDiagonalPx(const geometry::Rig& rig) {
  double sum = 0;
  for (const geometry::RigCamera& camera : rig.cameras) sum += std::hypot(camera.camera.width_px, camera.camera.height_px);
  return sum / static_cast<double>(rig.cameras.size());
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

/// Indices of observations, each the farthest from those before it, the first the farthest from all.
std::vector<size_t> SpreadOut(const PreparedRig& rig, const std::vector<Observation>& observations, size_t count) {
  const auto center = [&](size_t i) { return rig.cameras[static_cast<size_t>(observations[i].camera_idx)].center_in_local; };
  std::vector<size_t> chosen;
  while (chosen.size() < std::min(count, observations.size())) {
    double farthest = -1;
    size_t best = 0;
    for (size_t i = 0; i < observations.size(); ++i) {
      double distance = chosen.empty() ? center(i).norm() : std::numeric_limits<double>::infinity();
      for (const size_t k : chosen) distance = std::min(distance, i == k ? -1 : (center(i) - center(k)).norm());
      if (distance > farthest) farthest = distance, best = i;
    }
    if (farthest < 0) break;
    chosen.push_back(best);
  }
  std::sort(chosen.begin(), chosen.end());
  return chosen;
}

/// Whether what is left of a sample grows by swapping sides back: a camera that is off draws the others' sides along.
bool FitsWorse(const geometry::Rig& rig, const std::vector<DetectedFrame>& given, const std::vector<DetectedFrame>& swapped,
               const TakeOptions& o, const RunContext& run) {
  constexpr double kGrows = 1.05;
  CauseOptions options;
  options.min_score = o.min_score, options.max_persons = o.max_persons;
  return FitAsGiven(rig, swapped, options, run).residual_px > kGrows * FitAsGiven(rig, given, options, run).residual_px;
}

SideReport NothingSwapped(const SideReport& report) {
  SideReport none;
  for (const CameraSides& camera : report.cameras) none.cameras.push_back({camera.name, 0, 0, 0, {}, {}});
  none.sigma_px = report.sigma_px;
  return none;
}

}  // namespace

void CheckOptions(const geometry::Rig& rig, const TakeOptions& o) {
  const auto require = [](bool holds, const char* message) {
    if (!holds) throw UsageError(message);
  };
  require(o.sigma_px >= 0 && std::isfinite(o.sigma_px), "option 'sigma-px' must be a positive number, or 0 to estimate it");
  require(o.min_score >= 0 && o.min_score <= 1, "option 'min-score' must lie in 0..1");
  require(o.score_power >= 0 && o.score_power <= 4, "option 'score-power' must lie in 0..4");
  require(o.max_residual_sigmas > 0, "option 'max-residual-sigmas' must be positive");
  require(o.min_parallax_sigmas > 0, "option 'min-parallax-sigmas' must be positive");
  require(o.max_distance_m >= 0, "option 'max-distance-m' must not be negative");
  require(o.min_views >= 2, "option 'min-views' must be at least 2");
  require(o.max_persons >= 1, "option 'max-persons' must be at least 1");
  require(o.max_error_px > 0, "option 'max-error-px' must be positive");
  require(o.holdout_points >= 0, "option 'holdout-points' must not be negative");
  require(!o.method.IsExhaustiveDlt() || rig.cameras.size() <= 20,
          "option 'method' exhaustive-dlt takes at most 20 cameras; use auto");
}

TakePeople::TakePeople(const geometry::Rig& rig, const std::vector<DetectedFrame>& frames, const TakeBody& body,
                       const TakeOptions& options, const RunContext& run, TakeProblem* problem)
    : options_(options), num_joints_(static_cast<size_t>(body.num_joints)), given_(&frames) {
  CheckOptions(rig, options);
  CheckFrames(rig, frames, body.num_joints);
  problem->rig = Prepare(rig, options.ignore_distortion || options.method.IsExhaustiveDlt());
  TakeAssociation people = AssociatePeople(problem->rig, frames, ToAssociationOptions(options, body.mirror), run);
  problem->num_ghosts = people.num_ghosts;
  assignment_ = std::move(people.assignment);
  first_.assign(1, 0);
  for (const auto& persons : assignment_) {
    problem->num_persons = std::max(problem->num_persons, static_cast<int>(persons.size()));
    first_.push_back(first_.back() + persons.size() * num_joints_);
  }
  FindSides(rig, body, run, problem);
  EstimateSigma(rig, run.num_threads, problem);
}

void TakePeople::FindSides(const geometry::Rig& rig, const TakeBody& body, const RunContext& run, TakeProblem* problem) {
  if (!options_.fix_sides || body.mirror.empty() || options_.method.IsExhaustiveDlt()) return;
  SideOptions sides;
  sides.min_score = options_.min_score;
  const std::vector<SwappedView> swaps =
      FindSwaps(problem->rig, assignment_, body.mirror, sides, run, *given_, &problem->sides);
  if (swaps.empty()) return;
  swapped_ = *given_;
  SwapSides(swaps, body.mirror, &swapped_);
  if (!FitsWorse(rig, *given_, swapped_, options_, run)) return;
  problem->sides = NothingSwapped(problem->sides);
  swapped_ = {};
}

void TakePeople::EstimateSigma(const geometry::Rig& rig, int num_threads, TakeProblem* problem) const {
  constexpr size_t kMaxPoints = 600;
  problem->sigma_px = options_.sigma_px;
  if (options_.method.IsExhaustiveDlt() || options_.sigma_px != 0) return;
  problem->sigma_px = 1;
  Collect(Spread(2, kMaxPoints), problem);
  problem->sigma_px = EstimateNoiseScale(problem->rig, problem->observations, ToPointOptions(options_, options_.method),
                                         0.005 * MeanDiagonalPx(rig), 1.0, num_threads, static_cast<int>(kMaxPoints));
}

void TakePeople::Append(size_t frame, size_t person, int joint_idx, TakeProblem* problem) const {
  const DetectedFrame& of = frames()[frame];
  const double sigma_px = options_.method.IsExhaustiveDlt() ? 1 : problem->sigma_px;
  problem->observations.push_back(Observe(of, assignment_[frame][person], joint_idx, options_, sigma_px));
  problem->labels.push_back({of.frame, static_cast<int>(person), joint_idx});
}

void TakePeople::Collect(size_t begin, size_t end, TakeProblem* problem) const {
  problem->observations.clear(), problem->labels.clear();
  for (size_t f = begin; f < end; ++f) {
    for (size_t p = 0; p < assignment_[f].size(); ++p) {
      for (size_t j = 0; j < num_joints_; ++j) Append(f, p, static_cast<int>(j), problem);
    }
  }
}

void TakePeople::Collect(const std::vector<size_t>& points, TakeProblem* problem) const {
  problem->observations.clear(), problem->labels.clear();
  for (const size_t i : points) {
    const size_t f = static_cast<size_t>(std::upper_bound(first_.begin(), first_.end(), i) - first_.begin()) - 1;
    const size_t in_frame = i - first_[f];
    Append(f, in_frame / num_joints_, static_cast<int>(in_frame % num_joints_), problem);
  }
}

std::vector<size_t> TakePeople::Spread(size_t min_views, size_t max_points) const {
  std::vector<uint32_t> usable;
  for (size_t f = 0; f < assignment_.size(); ++f) {
    for (size_t i = first_[f]; i < first_[f + 1]; ++i) {
      const std::vector<int>& choice = assignment_[f][(i - first_[f]) / num_joints_];
      size_t views = 0;
      for (size_t c = 0; c < choice.size(); ++c) {
        views += choice[c] >= 0 && Counts(frames()[f].people[c][choice[c]][(i - first_[f]) % num_joints_], options_);
      }
      if (views >= min_views) usable.push_back(static_cast<uint32_t>(i));
    }
  }
  const size_t count = std::min(usable.size(), max_points);
  std::vector<size_t> spread;
  for (size_t k = 0; k < count; ++k) spread.push_back(usable[k * usable.size() / count]);
  return spread;
}

TakeProblem PrepareTake(const geometry::Rig& rig, const std::vector<DetectedFrame>& detected, const TakeBody& body,
                        const TakeOptions& options, const RunContext& run) {
  TakeProblem problem;
  const TakePeople people(rig, detected, body, options, run, &problem);
  people.Collect(0, people.num_frames(), &problem);
  return problem;
}

PointSolver SolverFor(const geometry::Rig& rig, const TakeProblem& problem, const TakeOptions& options,
                      const TakeMethod& method) {
  if (method.IsExhaustiveDlt()) {
    const ExhaustiveDltOptions dlt{options.max_error_px, options.min_score, 2};
    return [&rig, dlt](const std::vector<Observation>& seen) { return TriangulateExhaustiveDlt(rig, seen, dlt); };
  }
  const PointOptions point = ToPointOptions(options, method);
  const bool with_calibration = options.calibration_covariance;
  return [&problem, point, with_calibration](const std::vector<Observation>& seen) {
    Point solved = TriangulatePoint(problem.rig, seen, point);
    if (with_calibration) AddCalibrationCovariance(problem.rig, seen, &solved);
    return solved;
  };
}

std::vector<Observation> FewerViews(const PreparedRig& rig, const std::vector<Observation>& observations, int max_views) {
  std::vector<Observation> fewer;
  for (const size_t i : SpreadOut(rig, observations, static_cast<size_t>(max_views))) fewer.push_back(observations[i]);
  return fewer;
}

std::vector<Point> SolvePoints(const TakeProblem& problem, const PointSolver& solve, int num_threads) {
  constexpr int64_t kBlock = 64;  // worth a thread's while
  const int64_t count = static_cast<int64_t>(problem.observations.size());
  std::vector<Point> points(problem.observations.size());
  ParallelFor((count + kBlock - 1) / kBlock, num_threads, [&](int64_t block) {
    for (int64_t i = block * kBlock; i < std::min(count, (block + 1) * kBlock); ++i) {
      points[static_cast<size_t>(i)] = solve(problem.observations[static_cast<size_t>(i)]);
    }
  });
  return points;
}

LeftOutSummary HoldOut(const TakeProblem& problem, const PointSolver& solve, int max_points, int num_threads) {
  std::vector<std::vector<Observation>> points;
  std::vector<PointLabel> labels;
  const size_t stride = std::max<size_t>(1, problem.labels.size() / static_cast<size_t>(std::max(max_points, 1)));
  for (size_t i = 0; max_points > 0 && i < problem.labels.size(); i += stride) {
    points.push_back(problem.observations[i]);
    labels.push_back(problem.labels[i]);
  }
  return SummarizeLeftOut(problem.rig, LeaveOneCameraOut(problem.rig, points, solve, num_threads), labels);
}

}  // namespace mvstudio::triangulate
