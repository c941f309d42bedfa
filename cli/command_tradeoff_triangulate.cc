#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <memory>

#include "cli/pose_input.h"
#include "cli/pose_truth.h"
#include "cli/tradeoff.h"
#include "cli/triangulate_take.h"
#include "core/error.h"
#include "triangulate/limbs.h"
#include "triangulate/take_steps.h"

namespace mvstudio::cli {
namespace {

using nlohmann::ordered_json;

struct Arguments {
  PoseArguments pose;
  triangulate::TakeOptions take;
  std::vector<std::string> methods{"robust", "all-views", "lost", "linear", "midpoint", "dlt"};
  std::vector<int> views{0, 4, 3, 2}, threads{1, 2};
  std::string out, truth;
  bool align_truth = false;
};

/// One way to triangulate, and what came of it.
struct Trial {
  std::string method;
  int views = 0, threads = 1;
  double points_per_s = 0, coverage = 0, truth_mm = std::nan("");
  double limb_std_mm = 0;
  triangulate::LeftOutFigures holdout;

  std::string Name() const {
    return method + ", " + (views ? std::to_string(views) + " views" : std::string("all views")) + ", " +
           std::to_string(threads) + (threads == 1 ? " thread" : " threads");
  }
};

double Now() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

/// The shortest of three runs; the points of the last.
std::vector<triangulate::Point> Time(const triangulate::TakeProblem& problem, const triangulate::PointSolver& solve,
                                     int threads, double* seconds) {
  std::vector<triangulate::Point> points;
  *seconds = std::numeric_limits<double>::infinity();
  for (int run = 0; run < 3; ++run) {
    const double start = Now();
    points = SolvePoints(problem, solve, threads);
    *seconds = std::min(*seconds, Now() - start);
  }
  return points;
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
  return solved / seen;
}

Trial Run(const Arguments& arguments, const PoseInput& input, const triangulate::TakeProblem& problem, Trial trial) {
  triangulate::PointSolver solve = SolverFor(input.rig, problem, arguments.take, trial.method);
  if (trial.views > 0) solve = WithFewerViews(problem.rig, solve, trial.views);
  double seconds = 0;
  const triangulate::TakeResult take = ToTake(problem, Time(problem, solve, trial.threads, &seconds));
  trial.points_per_s = static_cast<double>(take.points.size()) / seconds;
  trial.coverage = Coverage(problem, take.points);
  trial.limb_std_mm = 1000 * MeanLimbStd(MeasureLimbs(take.points, input.limbs));
  trial.holdout = HoldOut(problem, solve, arguments.take.holdout_points, trial.threads).all;
  if (!arguments.truth.empty()) {
    trial.truth_mm = CompareWithTruth(ToPose3d(take, input.skeleton), arguments.truth, arguments.align_truth).median_mm;
  }
  return trial;
}

ordered_json ToJson(const std::vector<Trial>& trials, const std::vector<bool>& on_front) {
  ordered_json table = ordered_json::array();
  for (size_t i = 0; i < trials.size(); ++i) {
    const Trial& t = trials[i];
    table.push_back({{"method", t.method},
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
  char line[300];
  std::string text = "method         views  threads   points/s  coverage  left-out px  (90 %)  limbs mm  truth mm\n";
  for (size_t i = 0; i < trials.size(); ++i) {
    const Trial& t = trials[i];
    std::snprintf(line, sizeof line, "%-14s %5s  %7d  %9.0f  %8.3f  %11.3f  %6.2f  %8.2f  %8.3f %s\n", t.method.c_str(),
                  t.views ? std::to_string(t.views).c_str() : "all", t.threads, t.points_per_s, t.coverage, t.holdout.median_px,
                  t.holdout.p90_px, t.limb_std_mm, t.truth_mm, on_front[i] ? "*" : "");
    text += line;
  }
  return text + "*: no other way is both faster and better\n";
}

std::vector<Trial> Trials(const Arguments& arguments) {
  std::vector<Trial> trials;
  for (const std::string& method : arguments.methods) {
    if (method == "auto") throw UsageError("--methods compares the methods that auto chooses among; name them");
    for (const int views : arguments.views) {
      if (views != 0 && views < 2) throw UsageError("--views: a point needs 2 views; 0 stands for all");
      for (const int threads : arguments.threads) {
        Trial trial;
        trial.method = method, trial.views = views, trial.threads = std::max(threads, 1);
        trials.push_back(trial);
      }
    }
  }
  return trials;
}

CommandResult RunTradeoff(const Arguments& arguments, CommandContext& context) {
  CommandResult result;
  std::vector<Trial> trials = Trials(arguments);
  const PoseInput input = ReadPoseInput(arguments.pose, &result);
  const triangulate::TakeProblem problem =
      PrepareTake(input.rig, input.frames, BodyOf(input.skeleton), arguments.take, context.run);
  ProgressStage stage(context.run, "tradeoff", static_cast<int64_t>(trials.size()));
  for (Trial& trial : trials) {
    trial = Run(arguments, input, problem, trial);
    stage.Advance(1, trial.Name());
  }
  const bool truth = !arguments.truth.empty();
  std::vector<TradeoffPoint> points;
  for (const Trial& t : trials) {
    points.push_back({t.Name(), 1e6 / t.points_per_s, truth ? t.truth_mm : t.holdout.median_px});
  }
  const std::vector<bool> on_front = ParetoFront(points);
  result.metrics["sigma_px"] = problem.sigma_px;
  result.metrics["trials"] = ToJson(trials, on_front);
  result.text = ToText(trials, on_front);
  if (arguments.out.empty()) return result;
  WriteTradeoffPage({"triangulate", "Triangulation: speed against accuracy", "Ways to triangulate: time against error",
                     "time for a point (microseconds)",
                     truth ? "median distance from the truth (mm)" : "median error with the camera left out (px)"},
                    points, arguments.out, &result);
  return result;
}

}  // namespace

void RegisterTradeoffTriangulate(CLI::App& tradeoff, Registry& registry) {
  const auto arguments = std::make_shared<Arguments>();
  CLI::App* sub = tradeoff.add_subcommand(
      "triangulate", "Method x number of views x threads: points a second, left-out px, mm, coverage, and the Pareto front");
  AddPoseArguments(sub, arguments->pose);
  sub->add_option("--methods", arguments->methods, "to compare")->delimiter(',')->capture_default_str();
  sub->add_option("--views", arguments->views, "views a point uses at most; 0: all")->delimiter(',')->capture_default_str();
  sub->add_option("--threads-list", arguments->threads, "numbers of threads")->delimiter(',')->capture_default_str();
  sub->add_option("--truth", arguments->truth, "a folder of body3DScene files or a points.csv");
  sub->add_flag("--align-truth", arguments->align_truth, "take out the best rigid motion before comparing with --truth");
  sub->add_option("--sigma-px", arguments->take.sigma_px, "px; standard deviation of a detection; 0 estimates it")
      ->capture_default_str();
  sub->add_option("--min-score", arguments->take.min_score, "0..1; detections with a lower score are left out")
      ->capture_default_str();
  sub->add_option("--max-persons", arguments->take.max_persons, "the best supported persons of the take are kept")
      ->capture_default_str();
  sub->add_option("--out", arguments->out, "folder for the table and the figure");
  registry.Add(sub, "tradeoff triangulate", [arguments](CommandContext& context) { return RunTradeoff(*arguments, context); });
}

}  // namespace mvstudio::cli
