#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>

#include "cli/program/commands.h"
#include "cli/program/input_flags.h"
#include "cli/program/options.h"
#include "cli/program/output_guard.h"
#include "core/error.h"
#include "core/format.h"
#include "stages/input/pose_input.h"
#include "stages/input/take_frames.h"
#include "stages/people/pose_truth.h"
#include "stages/study/tradeoff.h"
#include "triangulate/batch/batch.h"
#include "triangulate/take/limbs.h"
#include "triangulate/take/steps.h"

namespace mvstudio::cli {
namespace {

using nlohmann::ordered_json;
using triangulate::PointMethod;
using triangulate::TakeMethod;

struct Arguments {
  stages::PoseArguments pose;
  triangulate::TakeOptions take;
  std::vector<TakeMethod> methods = {ByPoint(PointMethod::kRobust),   ByPoint(PointMethod::kAllViews),
                                     ByPoint(PointMethod::kLost),     ByPoint(PointMethod::kLinear),
                                     ByPoint(PointMethod::kMidpoint), ByPoint(PointMethod::kDlt)};
  std::vector<std::string> precisions{"double", "float"};
  std::vector<int> views{0, 4, 3, 2}, threads{1, 2};
  std::string out, truth, marker_unit;
  bool align_truth = false;
};

/// One way to triangulate, and what came of it.
struct Trial {
  TakeMethod method;
  std::string precision = "double";
  int views = 0, threads = 1;
  double points_per_s = 0, coverage = 0, truth_mm = std::nan("");
  double limb_std_mm = 0;
  triangulate::LeftOutFigures holdout;
  std::string why_no_truth;  ///< where nothing could be compared

  std::string Name() const {
    return std::string(ToString(method)) + (precision == "float" ? " in float, " : ", ") +
           (views ? std::to_string(views) + " views" : std::string("all views")) + ", " + std::to_string(threads) +
           (threads == 1 ? " thread" : " threads");
  }
};

double Now() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

/// The shortest of three runs.
double Time(const std::function<void()>& work) {
  double seconds = std::numeric_limits<double>::infinity();
  for (int run = 0; run < 3; ++run) {
    const double start = Now();
    work();
    seconds = std::min(seconds, Now() - start);
  }
  return seconds;
}

triangulate::PointBatch ToBatch(const triangulate::PreparedRig& rig,
                                const std::vector<std::vector<triangulate::Observation>>& points) {
  const int64_t count = static_cast<int64_t>(points.size());
  triangulate::PointBatch batch = triangulate::MakeBatch(static_cast<int>(rig.cameras.size()), count);
  for (int64_t i = 0; i < count; ++i) {
    for (const triangulate::Observation& seen : points[static_cast<size_t>(i)]) {
      const size_t at = static_cast<size_t>(seen.camera_idx * count + i);
      batch.x_px[at] = seen.px.x(), batch.y_px[at] = seen.px.y(), batch.sigma_px[at] = seen.sigma_px;
    }
  }
  return batch;
}

triangulate::Point PointOf(const triangulate::BatchResult& batch, int64_t i,
                           const std::vector<triangulate::Observation>& observations) {
  triangulate::Point point;
  point.status = batch.StatusOf(i);
  point.num_observations = static_cast<int>(observations.size());
  if (point.status != Status::kOk) return point;
  const size_t at = static_cast<size_t>(i);
  point.x_in_world = {batch.x[at], batch.y[at], batch.z[at]};
  const auto entry = [&](int k) { return batch.covariance[static_cast<size_t>(k * batch.num_points + i)]; };
  point.covariance << entry(0), entry(1), entry(2), entry(1), entry(3), entry(4), entry(2), entry(4), entry(5);
  point.chi_squared = batch.chi_squared[at], point.rms_px = batch.rms_px[at];
  for (size_t k = 0; k < observations.size(); ++k) {
    if (batch.Used(observations[k].camera_idx, i)) point.used.push_back(static_cast<int>(k));
  }
  return point;
}

/// Solved by the batch's kernel; the other methods go point by point, in double.
bool HasKernel(const TakeMethod& method) {
  if (method.kind != TakeMethod::Kind::kPoint) return false;
  const PointMethod kernels[] = {PointMethod::kRobust, PointMethod::kAllViews, PointMethod::kLinear, PointMethod::kMidpoint};
  return std::find(std::begin(kernels), std::end(kernels), method.point) != std::end(kernels);
}

triangulate::BatchOptions KernelOptions(const Trial& trial) {
  triangulate::BatchOptions options;
  options.point.method = trial.method.point;
  options.single_precision = trial.precision == "float";
  return options;
}

triangulate::TakeResult ToTake(const triangulate::TakeProblem& problem, std::vector<triangulate::Point> points) {
  triangulate::TakeResult take;
  for (size_t i = 0; i < points.size(); ++i) {
    const triangulate::PointLabel& label = problem.labels[i];
    take.points.push_back({label.frame, label.person, label.joint_idx, std::move(points[i])});
  }
  return take;
}

/// Share of the joints that two cameras or more see that got a point.
double Coverage(const triangulate::TakeProblem& problem, const std::vector<triangulate::TakePoint>& points) {
  double seen = 0, solved = 0;
  for (size_t i = 0; i < points.size(); ++i) {
    if (problem.observations[i].size() < 2) continue;
    ++seen;
    solved += points[i].point.status == Status::kOk;
  }
  return seen > 0 ? solved / seen : std::nan("");
}

std::vector<triangulate::Point> SolveTimed(const triangulate::TakeProblem& problem, const triangulate::PointSolver& solve,
                                           const Trial& trial, double* seconds) {
  std::vector<triangulate::Point> points;
  if (!HasKernel(trial.method)) {
    *seconds = Time([&] { points = SolvePoints(problem, solve, trial.threads); });
    return points;
  }
  const triangulate::PointBatch batch = ToBatch(problem.rig, problem.observations);
  RunContext run;
  run.num_threads = trial.threads;
  triangulate::BatchResult solved;
  *seconds = Time([&] { solved = TriangulateBatch(problem.rig, batch, KernelOptions(trial), run); });
  for (int64_t i = 0; i < solved.num_points; ++i) {
    points.push_back(PointOf(solved, i, problem.observations[static_cast<size_t>(i)]));
  }
  return points;
}

/// The way of a trial for one point, for cameras left out.
triangulate::PointSolver OnePoint(const Arguments& arguments, const stages::PoseInput& input,
                                  const triangulate::TakeProblem& problem, const Trial& trial) {
  triangulate::PointSolver solve;
  if (HasKernel(trial.method)) {
    solve = [&problem, options = KernelOptions(trial)](const std::vector<triangulate::Observation>& seen) {
      RunContext run;
      run.num_threads = 1;
      return PointOf(TriangulateBatch(problem.rig, ToBatch(problem.rig, {seen}), options, run), 0, seen);
    };
  } else {
    solve = SolverFor(input.rig, problem, arguments.take, trial.method);
  }
  if (trial.views == 0) return solve;
  return [&problem, solve, views = trial.views](const std::vector<triangulate::Observation>& seen) {
    triangulate::Point point = solve(FewerViews(problem.rig, seen, views));
    point.used.clear();  // they index the fewer ones
    return point;
  };
}

Trial Run(const Arguments& arguments, const stages::PoseInput& input, const triangulate::TakeProblem& problem, Trial trial) {
  const triangulate::PointSolver solve = OnePoint(arguments, input, problem, trial);
  triangulate::TakeProblem thin = problem;
  for (auto& seen : thin.observations) {
    if (trial.views > 0) seen = FewerViews(problem.rig, seen, trial.views);
  }
  double seconds = 0;
  const triangulate::TakeResult take = ToTake(thin, SolveTimed(thin, solve, trial, &seconds));
  trial.points_per_s = static_cast<double>(take.points.size()) / seconds;
  trial.coverage = Coverage(problem, take.points);
  trial.limb_std_mm = 1000 * MeanLimbStd(MeasureLimbs(take.points, input.limbs));
  trial.holdout = HoldOut(problem, solve, arguments.take.holdout_points, trial.threads).all;
  if (!arguments.truth.empty()) {
    const stages::TruthComparison truth = stages::CompareWithTruth(stages::ToPose3d(take, input.skeleton), arguments.truth,
                                                                   {arguments.align_truth, arguments.marker_unit});
    if (truth.comparison.num > 0) trial.truth_mm = truth.comparison.median_mm;
    trial.why_no_truth = truth.comparison.why_none;
  }
  return trial;
}

ordered_json ToJson(const std::vector<Trial>& trials, const std::vector<bool>& on_front) {
  ordered_json table = ordered_json::array();
  for (size_t i = 0; i < trials.size(); ++i) {
    const Trial& t = trials[i];
    table.push_back({{"method", std::string(ToString(t.method))},
                     {"precision", t.precision},
                     {"views", t.views},
                     {"threads", t.threads},
                     {"points_per_s", FiniteOrNull(t.points_per_s)},
                     {"coverage", FiniteOrNull(t.coverage)},
                     {"holdout_median_px", FiniteOrNull(t.holdout.median_px)},
                     {"holdout_p90_px", FiniteOrNull(t.holdout.p90_px)},
                     {"holdout_coverage", FiniteOrNull(t.holdout.coverage)},
                     {"limb_std_mm", FiniteOrNull(t.limb_std_mm)},
                     {"truth_median_mm", FiniteOrNull(t.truth_mm)},
                     {"on_front", static_cast<bool>(on_front[i])}});
  }
  return table;
}

std::string ToText(const std::vector<Trial>& trials, const std::vector<bool>& on_front) {
  std::string text =
      "method          precision  views  threads   points/s  coverage  left-out px  (90 %)  limbs mm  truth mm\n";
  for (size_t i = 0; i < trials.size(); ++i) {
    const Trial& t = trials[i];
    text += Format("%-14s  %9s  %5s  %7d  %9.0f  %8s  %11s  %6s  %8s  %8s %s\n", std::string(ToString(t.method)).c_str(),
                   t.precision.c_str(), t.views ? std::to_string(t.views).c_str() : "all", t.threads, t.points_per_s,
                   stages::Shown(t.coverage, 3).c_str(), stages::Shown(t.holdout.median_px, 3).c_str(),
                   stages::Shown(t.holdout.p90_px, 2).c_str(), stages::Shown(t.limb_std_mm, 2).c_str(),
                   stages::Shown(t.truth_mm, 3).c_str(), on_front[i] ? "*" : "");
  }
  return text + "*: no other way is both faster and better\n";
}

void CheckArguments(const Arguments& arguments) {
  for (const TakeMethod& method : arguments.methods) {
    if (method.IsAuto()) throw UsageError("--methods compares the methods that auto chooses among; name them");
  }
  for (const std::string& precision : arguments.precisions) {
    if (precision != "double" && precision != "float") throw UsageError("--precisions: double or float, not " + precision);
  }
  for (const int views : arguments.views) {
    if (views != 0 && views < 2) throw UsageError("--views: a point needs 2 views; 0 stands for all");
  }
}

std::vector<Trial> Trials(const Arguments& arguments) {
  CheckArguments(arguments);
  std::vector<Trial> trials;
  for (const TakeMethod& method : arguments.methods) {
    for (const std::string& precision : arguments.precisions) {
      if (precision == "float" && !HasKernel(method)) continue;
      for (const int views : arguments.views) {
        for (const int threads : arguments.threads) {
          Trial& trial = trials.emplace_back();
          trial.method = method, trial.precision = precision, trial.views = views, trial.threads = std::max(threads, 1);
        }
      }
    }
  }
  return trials;
}

/// Ways that have no point, or nothing to compare with, are not compared. True: there is nothing to show.
bool AddErrors(const Arguments& arguments, const triangulate::TakeProblem& problem, const std::vector<Trial>& trials,
               CommandResult* result) {
  const auto seen_twice = [](const std::vector<triangulate::Observation>& seen) { return seen.size() > 1; };
  if (std::none_of(problem.observations.begin(), problem.observations.end(), seen_twice)) {
    result->exit = kExitIllPosed;
    result->errors.push_back({"TRI-NO-POINTS", "nothing to compare: no joint is seen by 2 cameras in one frame",
                              "frame numbers of the cameras must overlap: `mvstudio sync` finds offsets"});
    return true;
  }
  for (const Trial& trial : trials) {
    if (trial.why_no_truth.empty() || !result->errors.empty()) continue;
    result->exit = kExitQualityGate;
    result->errors.push_back(stages::NothingInCommon("truth", arguments.truth, trial.why_no_truth));
  }
  return false;
}

CommandResult RunTradeoff(const Arguments& arguments, CommandContext& context) {
  CommandResult result;
  std::vector<Trial> trials = Trials(arguments);
  const std::unique_ptr<OutputFolder> place = stages::TradeoffPlace(
      arguments.out, "triangulate", Joined(PathsIn(arguments.pose.pose2d), {arguments.pose.calib, arguments.truth}));
  const stages::PoseInput input = stages::ReadPoseInput(arguments.pose, &result);
  const triangulate::TakeProblem problem =
      PrepareTake(input.rig, input.frames, stages::BodyOf(input.skeleton), arguments.take, context.run);
  if (AddErrors(arguments, problem, {}, &result)) return result;
  ProgressStage stage(context.run, "tradeoff", static_cast<int64_t>(trials.size()));
  for (Trial& trial : trials) {
    trial = Run(arguments, input, problem, trial);
    stage.Advance(1, trial.Name());
  }
  const bool truth = !arguments.truth.empty();
  std::vector<stages::TradeoffPoint> points;
  for (const Trial& t : trials) {
    points.push_back({t.Name(), 1e6 / t.points_per_s, truth ? t.truth_mm : t.holdout.median_px});
  }
  const std::vector<bool> on_front = stages::ParetoFront(points);
  result.metrics["sigma_px"] = problem.sigma_px;
  result.metrics["trials"] = ToJson(trials, on_front);
  result.text = ToText(trials, on_front);
  AddErrors(arguments, problem, trials, &result);
  if (arguments.out.empty()) return result;
  stages::WriteTradeoffPage({"triangulate", "Triangulation: speed against accuracy", "Ways to triangulate: time against error",
                             "time for a point (microseconds)",
                             truth ? "median distance from the truth (mm)" : "median error with the camera left out (px)"},
                            points, arguments.out, &result);
  return result;
}

}  // namespace

void RegisterTradeoffTriangulate(CLI::App& tradeoff, Registry& registry) {
  const auto arguments = std::make_shared<Arguments>();
  CLI::App* sub = tradeoff.add_subcommand(
      "triangulate",
      "Method x precision x number of views x threads: points a second, left-out px, mm, coverage, and the Pareto front");
  AddPoseArguments(sub, arguments->pose);
  StartGroup(sub, "Ways");
  AddChoices(sub, "--methods", arguments->methods, "to compare")->delimiter(',')->capture_default_str();
  AddOption(sub, "--precisions", arguments->precisions, "double, float; float for robust, all-views, linear and midpoint")
      ->delimiter(',')
      ->capture_default_str();
  AddOption(sub, "--views", arguments->views, "views a point uses at most; 0: all")->delimiter(',')->capture_default_str();
  AddOption(sub, "--threads-list", arguments->threads, "numbers of threads")->delimiter(',')->capture_default_str();
  StartGroup(sub, "Truth");
  AddOption(sub, "--truth", arguments->truth, "a folder of body3DScene files, or points as `markers convert` takes them");
  AddOption(sub, "--marker-unit", arguments->marker_unit,
            "m, cm, mm, in or the length of one unit, e.g. 25mm: of a file of markers, instead of what it states");
  AddFlag(sub, "--align-truth", arguments->align_truth, "take out the best rigid motion before comparing with --truth");
  StartGroup(sub, "Detections");
  AddOption(sub, "--sigma-px", arguments->take.sigma_px, "px; standard deviation of a detection; 0 estimates it")
      ->capture_default_str();
  AddOption(sub, "--min-score", arguments->take.min_score, "0..1; detections with a lower score are left out")
      ->capture_default_str();
  AddOption(sub, "--max-persons", arguments->take.max_persons, "the best supported persons of the take are kept")
      ->capture_default_str();
  StartGroup(sub, "Output");
  AddOutput(sub, "--out", arguments->out, OutputKind::kFolder, "folder for the table and the figure");
  registry.Add(sub, "tradeoff triangulate", [arguments](CommandContext& context) { return RunTradeoff(*arguments, context); });
}

}  // namespace mvstudio::cli
