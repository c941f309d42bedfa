#include "stages/triangulate/run.h"

#include <cmath>
#include <filesystem>
#include <memory>

#include "core/disk/output.h"
#include "core/error.h"
#include "core/format.h"
#include "stages/triangulate/budget.h"
#include "stages/triangulate/report_images.h"
#include "stages/triangulate/solve.h"
#include "stages/triangulate/timing.h"

namespace mvstudio::stages {
namespace {

/// What project or session say, in place of the options that were not given.
std::optional<FoundTake> SettleInput(TriangulateReport* report) {
  TriangulateOptions& options = report->options;
  if (!options.project.empty()) {
    report->project = UseProject(FillFromProject(options.project, options.session, &options.pose, &report->notes),
                                 options.given, &options.points, &options.markers, &report->notes);
    return std::nullopt;
  }
  std::optional<FoundTake> found = FindTake(options.session, &report->notes);
  if (!found) return found;
  const bool own = !options.pose.pose2d.empty();
  FillPoses(*found, options.session, &options.pose);
  if (!own) LeaveOutUncalibrated(&options.pose, &report->notes);
  if (options.out.empty()) options.out = dataset::TakeFolder(found->session, "pose3d", found->take.name);
  return found;
}

/// What needs the whole take.
void CheckChunks(const TriangulateOptions& options, const std::optional<ProjectUse>& project) {
  if (options.chunk_frames < 0) throw UsageError("option 'chunk-frames' must not be negative");
  if (options.chunk_frames == 0) return;
  if (options.budget.Asked())
    throw UsageError("option 'budget' and option 'target' need the whole take: leave option 'chunk-frames' out");
  if (options.refine || !options.sync.empty())
    throw UsageError("option 'refine' and option 'sync' need the whole take: leave option 'chunk-frames' out");
  if (!options.session.session.empty()) {
    throw UsageError(
        "option 'session' needs the whole take for the timing of its cameras: leave option 'chunk-frames' out, or give option "
        "'pose2d'");
  }
  if (!FootagePaths(options).empty())
    throw UsageError("option 'video' and option 'images' need the whole take: leave option 'chunk-frames' out");
  if (project && !ProjectFiles(project->input.settings).empty())
    throw UsageError("axes, reference_point and [angles] of the project need the whole take: leave option 'chunk-frames' out");
}

void CheckOptions(const TriangulateOptions& options, const std::optional<ProjectUse>& project, bool in_session) {
  if (options.pose.calib.empty())
    throw UsageError("option 'calib' is required, or a session that has a calibration (option 'session')");
  if (options.out.empty()) throw UsageError("option 'out' is required, or a session to write to (option 'session')");
  CheckChunks(options, project);
  (void)options.budget.BudgetSeconds();  // what they cannot be must not cost the run
  const std::optional<ErrorTarget> target = options.budget.Target();
  if (target && target->unit != ErrorUnit::kPx && target->unit != ErrorUnit::kMm)
    throw UsageError("option 'target' " + options.budget.target + ": joints have errors in px or mm");
  CheckFootage(options);
  CheckReferences(options);  // a wrong path must not cost the run
  if (in_session && !options.pose.changes.rate.empty())
    throw UsageError("option 'rate' is for takes outside sessions; a session's clocks state their rates");
}

void CheckViews(const triangulate::TakeOptions& options, const PoseInput& input) {
  const int cameras = static_cast<int>(input.cameras.size());
  if (options.min_views <= cameras) return;
  throw UsageError(Format("option 'min-views' %d: only %d cameras have 2D joints, so that no point can have as many views",
                          options.min_views, cameras));
}

std::vector<std::string> InputsOfTake(const TriangulateOptions& options) {
  std::vector<std::string> paths;
  for (const NamedPath& camera : options.pose.pose2d) paths.push_back(camera.path);
  paths.insert(paths.end(), {options.pose.points2d, options.pose.calib, options.trc, options.truth});
  const std::vector<std::string> footage = FootagePaths(options);
  paths.insert(paths.end(), footage.begin(), footage.end());
  return paths;
}

std::vector<std::string> FilesOfTake(const std::optional<ProjectUse>& project) {
  std::vector<std::string> files = {"points.csv", "covariance.csv", "pose3d.json", kJointViewsFolder};
  if (!project) return files;
  for (const std::string& file : ProjectFiles(project->input.settings)) files.push_back(file);
  return files;
}

void KeepInput(const PoseInput& input, TriangulateReport* report) {
  CheckViews(report->options.points, input);
  report->rig = input.rig, report->cameras = input.cameras, report->skeleton = input.skeleton;
}

PointStatistics StatisticsFor(const PoseInput& input) { return {static_cast<int>(input.skeleton.joints.size()), input.limbs}; }

void TriangulateChunks(const RunContext& run, TriangulateReport* report) {
  const PoseParts parts(report->options.pose, &report->notes);
  KeepInput(parts.input(), report);
  report->offsets = OffsetsUnused(report->rig, "option 'chunk-frames' reads the take in parts");
  PointStatistics statistics = StatisticsFor(parts.input());
  SolveChunks(parts, run, &statistics, report);
  const auto sample = [&] { return SampleOf(parts, static_cast<size_t>(report->options.chunk_frames)); };
  JudgeTake(parts.input(), statistics, sample, run, report);
}

/// What images are drawn of: the beginning, and what is kept of the rest.
const triangulate::TakeResult& DrawnPoints(TriangulateReport* report) {
  triangulate::TakeResult& drawn = report->beginning;
  if (drawn.points.empty()) return report->take;
  const int last = drawn.points.back().frame;
  for (size_t i = 0; i < report->take.points.size(); ++i) {
    if (report->take.points[i].frame <= last) continue;
    drawn.points.push_back(report->take.points[i]), drawn.observations.push_back(report->take.observations[i]);
  }
  return drawn;
}

void TriangulateAtOnce(const std::optional<FoundTake>& found, double started_s, const RunContext& run,
                       TriangulateReport* report) {
  const TriangulateOptions& options = report->options;
  PoseInput input = ReadPoseInput(options.pose, &report->notes);
  CheckFootageCameras(options, input.rig);
  KeepInput(input, report);
  const TakeTiming timing = ApplyTiming(found, options, run, &input, &report->notes);
  report->offsets = timing.offsets;
  input.tracks.clear();  // the frames hold them
  if (options.budget.Asked()) ChooseWithinBudget(input, started_s, run, report);
  PointStatistics statistics = StatisticsFor(input);
  SolveWhole(input, run, &statistics, report);
  JudgeTake(
      input, statistics, [&] { return std::move(input.frames); }, run, report);
  if (report->points.num_points == 0) return;
  report->views =
      WriteJointViews(SolvedRig(*report), DrawnPoints(report), input.skeleton, ImagesOf(found, options, timing), options.out);
}

}  // namespace

std::string TriangulateReport::MarkerFolder() const { return (std::filesystem::path(options.out) / "markers").string(); }

std::string TriangulateReport::WhyWithoutCovariance() const {
  if (!options.points.calibration_covariance) return "option 'calibration-covariance' is off";
  if (options.points.ignore_distortion) return "it belongs to lenses that option 'ignore-distortion' leaves out";
  return take.method.IsExhaustiveDlt() ? "exhaustive-dlt states no covariance" : "";
}

bool TriangulateReport::NothingInCommon() const {
  for (const ReferenceComparison& comparison : comparisons) {
    if (comparison.points.comparison.num == 0) return true;
  }
  return false;
}

double TriangulateReport::MeanDiagonalPx() const {
  double sum_px = 0;
  for (const geometry::RigCamera& camera : rig.cameras) sum_px += std::hypot(camera.camera.width_px, camera.camera.height_px);
  return sum_px / static_cast<double>(rig.cameras.size());
}

TriangulateReport RunTriangulate(TriangulateOptions options, const RunContext& run) {
  TriangulateReport report;
  report.options = std::move(options);
  const double started_s = report.options.budget.NowSeconds();
  const std::optional<FoundTake> found = SettleInput(&report);
  CheckOptions(report.options, report.project, found.has_value());
  if (!found) {
    report.options.pose.footage = report.options.video;
    report.options.pose.footage.insert(report.options.pose.footage.end(), report.options.images.begin(),
                                       report.options.images.end());
  }
  FillMarkerOptions(found, FootageRateHz(report.options), report.options.pose.changes, &report.options.markers, &report.notes);
  const std::string& out = report.options.out;
  const OutputFolder place(out, InputsOfTake(report.options), FilesOfTake(report.project));
  const bool had_points = std::filesystem::exists(std::filesystem::path(out) / "points.csv");
  std::unique_ptr<AtomicFolder> markers;
  if (!report.options.markers.to.empty()) markers = std::make_unique<AtomicFolder>(report.MarkerFolder(), true);
  if (report.options.chunk_frames > 0) {
    TriangulateChunks(run, &report);
  } else {
    TriangulateAtOnce(found, started_s, run, &report);
  }
  report.kept_older = had_points && report.loss.kind == Loss::Kind::kAll;
  if (markers && report.points.num_points > 0) {
    report.markers = WriteMarkerFolder(report.options, report.MarkerFolder(), markers.get(), &report.comparisons);
  } else if (!markers && had_points && !report.kept_older) {
    report.old_markers = DropOldMarkers(report.MarkerFolder());
  }
  if (report.budget) KeepOutcome(started_s, &report);
  return report;
}

}  // namespace mvstudio::stages
