#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <set>

#include "app/calib/calibration_use.h"
#include "app/input/pose_input.h"
#include "app/input/project_input.h"
#include "app/input/session_input.h"
#include "app/input/take_frames.h"
#include "app/people/filter_check.h"
#include "app/people/human_shape.h"
#include "app/people/joint_views.h"
#include "app/people/likely_cause.h"
#include "app/people/marker_export.h"
#include "app/people/triangulate_metrics.h"
#include "cli/people/points_out.h"
#include "cli/people/project_options.h"
#include "cli/people/take_images.h"
#include "cli/people/take_timing.h"
#include "cli/program/arguments.h"
#include "cli/program/commands.h"
#include "cli/program/input_flags.h"
#include "cli/program/options.h"
#include "cli/program/output_guard.h"
#include "core/error.h"
#include "core/format.h"
#include "dataset/pose/pose3d.h"
#include "triangulate/skeleton/refine.h"
#include "triangulate/take/cause.h"
#include "triangulate/take/steps.h"
#include "triangulate/take/stream.h"

namespace mvstudio::cli {
namespace {

using nlohmann::ordered_json;

struct Arguments {
  TimingArguments timing;
  app::PoseArguments pose;
  ImageArguments images;  ///< for the report
  std::string project, out;
  std::set<std::string> given;  ///< options that were typed, of those that a project may state
  dataset::ProjectSettings of_project;
  ComparisonArguments comparison;
  int chunk_frames = 0;
  bool refine = false;
  triangulate::TakeOptions options;
  triangulate::SkeletonRefineOptions refine_options;
  app::MarkerOptions markers;
  bool had_points = false;  ///< those of an earlier run are in the folder
};

std::string LeftOutText(const ordered_json& holdout) {
  if (holdout["num"] == 0) return "cannot be measured, no joint is seen by three cameras";
  if (holdout["median_px"].is_number()) return Format("median %.2f px", holdout["median_px"].get<double>());
  return Format("the others predict %.0f %% of its detections", 100 * holdout["coverage"].get<double>());
}

std::string Summary(const CommandResult& result) {
  const ordered_json& m = result.metrics;
  const auto number = [](const ordered_json& value) { return value.is_number() ? value.get<double>() : std::nan(""); };
  const int done = m["num_points"].get<int>(), tried = m["num_joints_tried"].get<int>();
  std::string text = Format("%d of %d joints triangulated", done, tried);
  if (done > 0)
    text +=
        Format(", reprojection RMS median %.3f px, sigma %.3f px, median sigma %s, %.0f points/s", number(m["median_rms_px"]),
               number(m["sigma_px"]), app::LengthText(number(m["median_sigma_mm"]) / 1e3).c_str(), number(m["points_per_s"]));
  text += Format("\nmethod %s; one camera left out: ", m["method"].get<std::string>().c_str()) + LeftOutText(m["holdout"]);
  if (!m["limb_std_mm"].is_null()) text += "; bone lengths vary by " + app::LengthText(number(m["limb_std_mm"]) / 1e3);
  for (const char* key : {"trc", "truth"}) {
    if (!m.contains(key)) continue;
    text += ComparisonText(key, "", m[key]);
  }
  return text;
}

/// Why the sigmas do not hold the calibration's uncertainty; empty: they do, as far as it is known.
std::string WhyWithoutCovariance(const triangulate::TakeOptions& options, const triangulate::TakeMethod& method) {
  if (!options.calibration_covariance) return "--calibration-covariance is off";
  if (options.ignore_distortion) return "it belongs to lenses that --ignore-distortion leaves out";
  return method.IsExhaustiveDlt() ? "exhaustive-dlt states no covariance" : "";
}

/// What is done with the take once its single points are there: joints of each person together where that predicts left-out
/// cameras better, and what such cameras say of the filter.
void RefineTake(const Arguments& arguments, const app::PoseInput& input, const RunContext& run, triangulate::TakeResult* take,
                CommandResult* result) {
  const bool filters = arguments.markers.filter != "none" || arguments.markers.fill_frames > 0;
  if (!(arguments.refine || filters) || take->method.IsExhaustiveDlt()) return;
  triangulate::TakeOptions options = arguments.options;
  options.select_views |= options.method.IsAuto();
  triangulate::TakeProblem problem;
  problem.rig = triangulate::Prepare(input.rig, options.ignore_distortion);
  const triangulate::PointSolver solve = SolverFor(input.rig, problem, options, take->method);
  if (filters) AddFilterCheck(CheckFilter(problem.rig, *take, solve, input.skeleton, arguments.markers, run), result);
  if (!arguments.refine) return;
  if (input.skeleton.bones.empty()) {
    result->warnings.push_back({"TRI-NO-BONES",
                                "the joints have no bones: --refine has no lengths to hold, smoothness alone is tried",
                                "name the bones in a file, --skeleton FILE.toml (docs/formats.md)"});
  }
  triangulate::SkeletonRefineResult refined =
      RefineSkeleton(problem.rig, *take, input.skeleton.bones, solve, arguments.refine_options, run);
  take->points = std::move(refined.points);
  app::AddRefinementMetrics(refined.report, &result->metrics);
  result->text += app::RefinementText(refined.report);
}

/// Solves the take and writes its points; what was settled for all of it comes back.
triangulate::TakeResult SolveWhole(const Arguments& arguments, const app::PoseInput& input, const RunContext& run,
                                   app::PointStatistics* statistics, CommandResult* result) {
  triangulate::TakeResult take =
      triangulate::TriangulateTake(input.rig, input.frames, app::BodyOf(input.skeleton), arguments.options, run);
  RefineTake(arguments, input, run, &take, result);
  statistics->Add(take);
  statistics->AddFrames(input.frames, arguments.options);
  dataset::Pose3d pose = app::ToPose3d(take, input.skeleton);
  pose.covariance_note = app::CovarianceUse(input.rig, input.cameras, WhyWithoutCovariance(arguments.options, take.method));
  pose.world = app::WorldText(input.rig);
  pose.frame_rate_hz = arguments.markers.rate_hz;
  WriteProjectParts(arguments.of_project, input.rig, arguments.project, arguments.out, &pose, result);
  dataset::WritePose3d(pose, arguments.out);
  return take;
}

/// As many frames as a chunk has, in runs spread over the take.
std::vector<triangulate::DetectedFrame> Sample(const app::PoseParts& parts, size_t chunk) {
  constexpr size_t kRuns = 8;
  const size_t length = (chunk + kRuns - 1) / kRuns, count = parts.num_frames();
  CommandResult ignored;  // skipped files are listed when their chunk is read
  if (chunk >= count) return parts.Read(0, count, &ignored);
  std::vector<triangulate::DetectedFrame> sample;
  for (size_t run = 0, next = 0; run < kRuns && next < count; ++run) {
    const size_t begin = std::max(next, run * count / kRuns);
    next = begin + length;
    for (triangulate::DetectedFrame& frame : parts.Read(begin, next, &ignored)) sample.push_back(std::move(frame));
  }
  return sample;
}

/// The same chunk by chunk: noise and method from frames spread over the take.
triangulate::TakeResult SolveChunks(const Arguments& arguments, const app::PoseParts& parts, const RunContext& run,
                                    app::PointStatistics* statistics, CommandResult* result) {
  const app::PoseInput& input = parts.input();
  const triangulate::TakeBody body = app::BodyOf(input.skeleton);
  const size_t chunk = static_cast<size_t>(arguments.chunk_frames);
  triangulate::TakeResult settled;
  triangulate::TakeStream stream(input.rig, body,
                                 SettleOptions(input.rig, Sample(parts, chunk), body, arguments.options, run, &settled));
  size_t begin = 0;
  const auto next = [&](std::vector<dataset::JointRow>* rows) {
    if (begin >= parts.num_frames()) return false;
    const auto frames = parts.Read(begin, begin + chunk, result);
    const triangulate::TakeResult part = stream.Push(frames, run);
    statistics->Add(part);
    statistics->AddFrames(frames, arguments.options);
    *rows = app::ToPose3d(part, input.skeleton).rows;
    begin += chunk;
    return true;
  };
  dataset::Pose3d head = app::ToPose3d({}, input.skeleton);
  head.covariance_note = app::CovarianceUse(input.rig, input.cameras, WhyWithoutCovariance(arguments.options, settled.method));
  head.world = app::WorldText(input.rig);
  head.frame_rate_hz = arguments.markers.rate_hz;
  dataset::WritePose3d(head, next, arguments.out);
  return settled;
}

using GiveFrames = std::function<std::vector<triangulate::DetectedFrame>()>;

/// The cameras as the take is solved with them.
geometry::Rig RigOf(const triangulate::TakeOptions& options, const app::PoseInput& input) {
  geometry::Rig rig = input.rig;
  if (!options.ignore_distortion) return rig;
  for (geometry::RigCamera& camera : rig.cameras) camera.camera = PinholeOf(camera.camera), camera.params_covariance.reset();
  return rig;
}

/// When the take is lost or does not fit: why. Else whether its cameras are synchronous. `sample` gives frames of it. True when
/// a cause was clear.
bool SayWhy(const Arguments& arguments, const app::PoseInput& input, const triangulate::TakeResult& take,
            const GiveFrames& sample, const RunContext& run, CommandResult* result) {
  const geometry::Rig rig = RigOf(arguments.options, input);
  triangulate::CauseOptions options;
  options.min_score = arguments.options.min_score, options.max_persons = arguments.options.max_persons;
  const bool timed = !arguments.timing.sync.empty();
  const triangulate::TakeBody body = app::BodyOf(input.skeleton);
  if (result->errors.empty() || result->errors.back().code == "TRI-NO-COMMON") {
    const bool apart = std::any_of(take.cameras.begin(), take.cameras.end(), [](const triangulate::CameraDiagnosis& camera) {
      return 2 * camera.num_rejected > camera.num_detections;
    });
    if (!apart) return app::AddTiming(CheckTiming(rig, sample(), options, run), timed, result);
    return app::AddCameraCause(RankCauses(rig, sample(), body, options, run), timed, result);
  }
  Notice& error = result->errors.back();
  if (error.code == "TRI-SKELETON") return true;  // a cause already
  const triangulate::CauseReport report = RankCauses(rig, sample(), body, options, run);
  error.hint = app::AddLikelyCause(report, "TRI-CAUSE", error.hint, result);
  return !report.message.empty();
}

void CheckViews(const triangulate::TakeOptions& options, const app::PoseInput& input) {
  const int cameras = static_cast<int>(input.cameras.size());
  if (options.min_views <= cameras) return;
  throw UsageError(Format("--min-views %d: only %d cameras have 2D joints, so that no point can have as many views",
                          options.min_views, cameras));
}

std::string PointsPath(const Arguments& arguments) { return (std::filesystem::path(arguments.out) / "points.csv").string(); }

/// One error ends a command: what else is wrong is a warning.
void KeepOneError(CommandResult* result) {
  std::vector<Notice>& errors = result->errors;
  if (errors.size() < 2) return;
  Append({errors.begin(), errors.end() - 1}, &result->warnings);
  errors.erase(errors.begin(), errors.end() - 1);
}

/// What is said of a take however it was read.
void Conclude(const Arguments& arguments, const app::PoseInput& input, const triangulate::TakeResult& take,
              const app::PointStatistics& statistics, const GiveFrames& sample, const RunContext& run, CommandResult* result) {
  statistics.AddTo(input.skeleton, &result->metrics);
  app::AddTakeMetrics(take, input.skeleton, &result->metrics);
  statistics.WarnOfAbsence(input, result);
  statistics.WarnOfPersons(arguments.options.max_persons, result);
  if (statistics.num_ok() > 0) AddComparisons(arguments.comparison, arguments.out, result);
  app::CheckLimbs(take, input, result);
  app::CheckUp(take, input, result);
  const bool known = statistics.CheckLoss(arguments.options, result);
  if (result->errors.empty()) app::CheckConsistency(take, input.rig, result);
  const bool lost = !result->errors.empty();
  // Of a lost take the cameras' own figures are of chance.
  if (!known && !SayWhy(arguments, input, take, sample, run, result) && !lost) app::AddCameraWarnings(take, result);
  KeepOneError(result);
  if (arguments.had_points && KeepsOlder(PointsPath(arguments), result)) return;
  for (const char* name : {"points.csv", "covariance.csv", "pose3d.json"}) {
    result->outputs.push_back(
        {(std::filesystem::path(arguments.out) / name).string(), name == std::string("points.csv") ? "points" : ""});
  }
  result->text = Summary(*result) + "\n" + result->text;
  app::ReportCovarianceUse(input.rig, input.cameras, WhyWithoutCovariance(arguments.options, take.method), result);
  if (result->metrics.contains("calibration_offsets")) {
    const ordered_json& offsets = result->metrics["calibration_offsets"];
    result->text += std::string("calibration's time offsets: ") + (offsets["applied"].get<bool>() ? "applied" : "not applied") +
                    ", " + offsets["reason"].get<std::string>() + "\n";
  }
}

std::string MarkerFolder(const Arguments& arguments) { return (std::filesystem::path(arguments.out) / "markers").string(); }

void CheckArguments(const Arguments& arguments) {
  if (arguments.chunk_frames < 0) throw UsageError("--chunk-frames must not be negative");
  if (arguments.chunk_frames > 0 && (arguments.refine || !arguments.timing.sync.empty())) {
    throw UsageError("--refine and --sync need the whole take: leave --chunk-frames out");
  }
  if (arguments.chunk_frames > 0 && !arguments.timing.session.session.empty()) {
    throw UsageError(
        "--session needs the whole take for the timing of its cameras: leave --chunk-frames out, or give --pose2d");
  }
  // A wrong path must not cost the run.
  if (arguments.chunk_frames > 0 && !arguments.images.Paths().empty())
    throw UsageError("--video and --images need the whole take: leave --chunk-frames out");
  const dataset::ProjectSettings& project = arguments.of_project;
  if (arguments.chunk_frames > 0 && (!project.axes.empty() || !project.reference_point.empty() || !project.angles.empty()))
    throw UsageError("axes, reference_point and [angles] of the project need the whole take: leave --chunk-frames out");
  CheckFootage(arguments.images);
  CheckComparison(arguments.comparison);
}

std::vector<std::string> InputsOf(const Arguments& arguments) {
  const app::PoseArguments& pose = arguments.pose;
  const ComparisonArguments& comparison = arguments.comparison;
  return Joined(Joined(PathsIn(pose.pose2d), {pose.points2d, pose.calib, comparison.trc, comparison.truth}),
                arguments.images.Paths());
}

std::vector<std::string> FilesOf(const Arguments& arguments) {
  const dataset::ProjectSettings& project = arguments.of_project;
  std::vector<std::string> files = {"points.csv", "covariance.csv", "pose3d.json", app::kJointViewsFolder};
  if (!project.axes.empty() || !project.reference_point.empty()) files.push_back("calibration.json");
  if (!project.angles.empty()) files.push_back("angles.csv");
  return files;
}

CommandResult Run(Arguments arguments, CommandContext& context) {
  CommandResult result;
  if (!arguments.project.empty()) {
    arguments.of_project = app::FillFromProject(arguments.project, arguments.timing.session, &arguments.pose, &result);
    ApplyProject(arguments.of_project, arguments.given, &arguments.options, &arguments.markers, &result);
  }
  const auto found = arguments.project.empty() ? app::FindTake(arguments.timing.session, &result) : std::nullopt;
  if (found) {
    const bool own = !arguments.pose.pose2d.empty();
    app::FillPoses(*found, arguments.timing.session, &arguments.pose);
    if (!own) app::LeaveOutUncalibrated(&arguments.pose, &result);
    if (arguments.out.empty()) arguments.out = dataset::TakeFolder(found->session, "pose3d", found->take.name);
  }
  if (arguments.pose.calib.empty()) throw UsageError("--calib is required, or a --session that has a calibration");
  if (arguments.out.empty()) throw UsageError("--out is required, or a --session to write to");
  CheckArguments(arguments);
  if (found && !arguments.pose.changes.rate.empty())
    throw UsageError("--rate is for takes outside sessions; a session's clocks state their rates");
  FillMarkerOptions(found, FootageRateHz(arguments.images), arguments.pose.changes, &arguments.markers, &result);
  const OutputFolder place(arguments.out, InputsOf(arguments), FilesOf(arguments));
  result.folder = arguments.out;
  arguments.had_points = std::filesystem::exists(PointsPath(arguments));
  std::unique_ptr<AtomicFolder> markers;
  if (!arguments.markers.to.empty()) markers = std::make_unique<AtomicFolder>(MarkerFolder(arguments), true);
  if (arguments.chunk_frames > 0) {
    const app::PoseParts parts(arguments.pose, &result);
    CheckViews(arguments.options, parts.input());
    app::ReportOffsetsUnused(parts.input().rig, "--chunk-frames reads the take in parts", &result);
    app::PointStatistics statistics(static_cast<int>(parts.input().skeleton.joints.size()), parts.input().limbs);
    const triangulate::TakeResult take = SolveChunks(arguments, parts, context.run, &statistics, &result);
    const auto sample = [&] { return Sample(parts, static_cast<size_t>(arguments.chunk_frames)); };
    Conclude(arguments, parts.input(), take, statistics, sample, context.run, &result);
  } else {
    app::PoseInput input = app::ReadPoseInput(arguments.pose, &result);
    CheckCameras(arguments.images, input.rig, arguments.pose.calib);
    arguments.timing.calib = arguments.pose.calib;
    CheckViews(arguments.options, input);
    const FrameNumbering numbering = ApplyTiming(found, arguments.timing, arguments.options, context.run, &input, &result);
    app::PointStatistics statistics(static_cast<int>(input.skeleton.joints.size()), input.limbs);
    const triangulate::TakeResult take = SolveWhole(arguments, input, context.run, &statistics, &result);
    Conclude(
        arguments, input, take, statistics, [&] { return input.frames; }, context.run, &result);
    if (statistics.num_ok() > 0) {
      AddJointViews(RigOf(arguments.options, input), take, input.skeleton,
                    ImagesOf(found, arguments.timing, arguments.images, numbering), arguments.out, &result);
    }
  }
  if (markers) {
    WriteMarkerFolder({arguments.out, MarkerFolder(arguments), arguments.markers, arguments.comparison}, markers.get(),
                      &result);
  } else if (arguments.had_points && !result.folder.empty()) {
    DropOldMarkers(MarkerFolder(arguments), &result);
  }
  return result;
}

}  // namespace

void RegisterTriangulate(CLI::App& app, Registry& registry) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* sub = app.add_subcommand("triangulate", "2D joints of several cameras -> 3D joints");
  AddPoseArguments(sub, arguments->pose);
  sub->get_option("--calib")->required(false);
  AddSessionArguments(sub, arguments->timing.session, "calibration, 2D poses and the timing of the cameras", "people");
  AddImageArguments(sub, arguments->images);
  StartGroup(sub, "Session");
  AddOption(sub, "--project", arguments->project,
            "folder of an anipose, caliscope or Pose2Sim project instead: calibration and 2D points come from it; --take names "
            "one of "
            "its takes");
  StartGroup(sub, "Output");
  AddOutput(sub, "--out", arguments->out, OutputKind::kFolder,
            "folder for points.csv, covariance.csv, pose3d.json; SESSION/pose3d/TAKE unless given");
  StartGroup(sub, "Points");
  AddOptions(sub, arguments->options);
  StartGroup(sub, "Timing");
  AddOption(sub, "--sync", arguments->timing.sync, "sync.json of `mvstudio sync`: time offsets of the cameras");
  AddChoice(sub, "--calibration-offsets", arguments->timing.calibration_offsets,
            "time offsets that the calibration states, where the take has no timing of its own: auto (when left-out cameras "
            "confirm them), on or off")
      ->capture_default_str()
      ->check(OneOf({"auto", "on", "off"}));
  StartGroup(sub, "Joints together");
  AddFlag(sub, "--refine", arguments->refine,
          "refine the joints of each person together: smoothness and bone lengths, each only where it predicts left-out "
          "cameras better; not with --chunk-frames");
  AddOptions(sub, arguments->refine_options);
  StartGroup(sub, "Points");
  AddOption(sub, "--chunk-frames", arguments->chunk_frames,
            "for takes longer than memory: frames of --pose2d processed at a time (a table is held whole); noise and method "
            "come from "
            "frames spread over the take; 0: all at once")
      ->capture_default_str();
  StartGroup(sub, "Marker files");
  AddOptions(sub, arguments->markers);
  StartGroup(sub, "Comparison");
  AddOption(sub, "--trc", arguments->comparison.trc,
            "compare with the markers of this .trc or .c3d file (its frame 1 is our frame 0; y up unless a .c3d says z)");
  AddOption(sub, "--truth", arguments->comparison.truth,
            "compare with a folder of body3DScene files, points of mvstudio, or 3D joints as `markers convert` takes them");
  AddOption(sub, "--marker-unit", arguments->comparison.marker_unit,
            "m, cm, mm, in or the length of one unit, e.g. 25mm: instead of what the file of markers states");
  AddFlag(sub, "--align-truth", arguments->comparison.align_truth,
          "take out the best rigid motion before comparing with --truth");
  registry.Add(sub, "triangulate", [arguments, sub](CommandContext& context) {
    for (const char* option : {"--min-score", "--min-views", "--frame-rate", "--filter", "--fill", "--to"}) {
      if (sub->count(option) > 0) arguments->given.insert(option);
    }
    return Run(*arguments, context);
  });
}

}  // namespace mvstudio::cli
