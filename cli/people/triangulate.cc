#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>

#include "app/calib/calibration_use.h"
#include "app/input/pose_input.h"
#include "app/input/project_input.h"
#include "app/input/session_input.h"
#include "app/input/take_frames.h"
#include "app/input/take_input.h"
#include "app/people/filter_check.h"
#include "app/people/human_shape.h"
#include "app/people/likely_cause.h"
#include "app/people/marker_export.h"
#include "app/people/triangulate_metrics.h"
#include "cli/people/points_out.h"
#include "cli/program/commands.h"
#include "cli/program/input_flags.h"
#include "cli/program/options.h"
#include "cli/program/output_guard.h"
#include "core/error.h"
#include "core/format.h"
#include "dataset/pose/pose3d.h"
#include "dataset/session/timeline_source.h"
#include "dataset/time/sync_file.h"
#include "triangulate/skeleton/refine.h"
#include "triangulate/sync/sync.h"
#include "triangulate/take/cause.h"
#include "triangulate/take/steps.h"
#include "triangulate/take/stream.h"

namespace mvstudio::cli {
namespace {

using nlohmann::ordered_json;

struct Arguments {
  app::SessionArguments session;
  app::PoseArguments pose;
  std::string project, out;
  ComparisonArguments comparison;
  int chunk_frames = 0;
  std::string sync;
  AutoOnOff calibration_offsets = AutoOnOff::kAuto;
  bool refine = false;
  triangulate::TakeOptions options;
  triangulate::SkeletonRefineOptions refine_options;
  app::MarkerOptions markers;
  bool had_points = false;  ///< those of an earlier run are in the folder
};

std::string Summary(const CommandResult& result) {
  const ordered_json& m = result.metrics;
  const auto number = [](const ordered_json& value) { return value.is_number() ? value.get<double>() : std::nan(""); };
  std::string text = Format(
      "%d of %d joints triangulated, reprojection RMS median %.3f px, sigma %.3f px, median sigma %.2f mm, %.0f points/s",
      m["num_points"].get<int>(), m["num_joints_tried"].get<int>(), number(m["median_rms_px"]), number(m["sigma_px"]),
      number(m["median_sigma_mm"]), number(m["points_per_s"]));
  text += Format("\nmethod %s; one camera left out: median %.2f px", m["method"].get<std::string>().c_str(),
                 number(m["holdout"]["median_px"]));
  if (!m["limb_std_mm"].is_null()) text += Format("; bone lengths vary by %.1f mm", number(m["limb_std_mm"]));
  for (const char* key : {"trc", "truth"}) {
    if (!m.contains(key)) continue;
    text += ComparisonText(key, "", m[key]);
  }
  return text;
}

/// The detections as the reference camera would have numbered their frames.
void ApplySync(const std::string& path, app::PoseInput* input, CommandResult* result) {
  const std::vector<double> offsets = dataset::OffsetsOf(dataset::ReadSync(path), geometry::CameraNames(input->rig));
  result->inputs.push_back(path);
  for (const std::string& camera : input->cameras) {
    if (std::isfinite(offsets[static_cast<size_t>(input->rig.Find(camera))])) continue;
    result->warnings.push_back({"TRI-NO-OFFSET", camera + ": " + path + " has no time offset for it, it is left out",
                                "run `mvstudio sync` again with more motion, or set its offset_frames in the file"});
  }
  input->frames = triangulate::ApplyOffsets(input->frames, offsets);
}

/// Frame numbers become instants, as everything later counts them. Offsets of a sync file are kept to a fraction of a frame;
/// else each camera's nearest frame is taken. False when nothing of the session says how the cameras' clocks relate.
bool ApplySession(const app::FoundTake& found, const Arguments& arguments, app::PoseInput* input, CommandResult* result) {
  const auto timeline = app::TimelineOf(found.session, found.take, arguments.session.allow_outside, true, result);
  const std::string sync = dataset::SyncPathOf(found.session, found.take, arguments.session.allow_outside);
  if (!arguments.sync.empty() || (timeline && timeline->clock == dataset::TimelineClock::kOffsets && !sync.empty())) {
    app::RenumberByClock(found, arguments.session, input);
    input->frames = app::ToFrames(input->tracks, input->rig, arguments.pose.calib);
    ApplySync(arguments.sync.empty() ? sync : arguments.sync, input, result);
    return true;
  }
  if (!timeline) return false;
  if (app::RenumberByTimeline(*timeline, input)) input->frames = app::ToFrames(input->tracks, input->rig, arguments.pose.calib);
  return timeline->clock != dataset::TimelineClock::kStart;
}

/// Frames of all cameras that belong together: by what the take states, else by what the calibration does.
void ApplyTiming(const std::optional<app::FoundTake>& found, const Arguments& arguments, const RunContext& run,
                 app::PoseInput* input, CommandResult* result) {
  bool stated = !arguments.sync.empty();
  if (found) {
    stated = ApplySession(*found, arguments, input, result);
  } else if (stated) {
    ApplySync(arguments.sync, input, result);
  }
  if (stated) return app::ReportOffsetsUnused(input->rig, "the take states its own timing", result);
  app::ApplyCalibrationOffsets(arguments.calibration_offsets, arguments.options, run, input, result);
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
  dataset::WritePose3d(head, next, arguments.out);
  return settled;
}

using GiveFrames = std::function<std::vector<triangulate::DetectedFrame>()>;

/// When the take is lost or does not fit: why. `sample` gives frames of it.
void SayWhy(const Arguments& arguments, const app::PoseInput& input, const GiveFrames& sample, const RunContext& run,
            CommandResult* result) {
  if (result->errors.empty()) return;
  geometry::Rig rig = input.rig;
  if (arguments.options.ignore_distortion) {
    for (geometry::RigCamera& camera : rig.cameras) camera.camera = PinholeOf(camera.camera), camera.params_covariance.reset();
  }
  triangulate::CauseOptions options;
  options.min_score = arguments.options.min_score, options.max_persons = arguments.options.max_persons;
  Notice& error = result->errors.back();
  error.hint = app::AddLikelyCause(RankCauses(rig, sample(), app::BodyOf(input.skeleton), options, run), "TRI-CAUSE",
                                   error.hint, result);
}

std::string PointsPath(const Arguments& arguments) { return (std::filesystem::path(arguments.out) / "points.csv").string(); }

/// What is said of a take however it was read.
void Conclude(const Arguments& arguments, const app::PoseInput& input, const triangulate::TakeResult& take,
              const app::PointStatistics& statistics, const GiveFrames& sample, const RunContext& run, CommandResult* result) {
  statistics.AddTo(input.skeleton, &result->metrics);
  app::AddTakeMetrics(take, input.skeleton, &result->metrics);
  app::AddCameraWarnings(take, result);
  statistics.WarnOfAbsence(input, result);
  statistics.WarnOfPersons(arguments.options.max_persons, result);
  if (statistics.num_ok() > 0) AddComparisons(arguments.comparison, arguments.out, result);
  app::CheckConsistency(take, input.rig, result);
  app::CheckLimbs(take, input, result);
  app::CheckUp(take, input, result);
  app::CheckLoss(statistics, result);
  if (statistics.num_ok() == 0) {
    result->exit = kExitIllPosed;
    result->errors.push_back(
        {"TRI-NO-POINTS", "no joint could be triangulated; see status_counts",
         "check that calibration and poses belong to the same cameras and that all cameras count frames alike"});
  }
  SayWhy(arguments, input, sample, run, result);
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
  if (arguments.chunk_frames > 0 && (arguments.refine || !arguments.sync.empty())) {
    throw UsageError("--refine and --sync need the whole take: leave --chunk-frames out");
  }
  if (arguments.chunk_frames > 0 && !arguments.session.session.empty()) {
    throw UsageError(
        "--session needs the whole take for the timing of its cameras: leave --chunk-frames out, or give --pose2d");
  }
  CheckComparison(arguments.comparison);
}

/// Where marker files are asked for: the rate of the session unless given.
void FillMarkerOptions(const std::optional<app::FoundTake>& found, app::MarkerOptions* options) {
  if (options->to.empty()) {
    if (options->fill_frames != 0 || options->filter != "none" || options->opensim) {
      throw UsageError("--filter, --fill and --opensim are for marker files: name them, e.g. --to trc");
    }
    return;
  }
  if (found && options->rate_hz <= 0) options->rate_hz = found->take.fps_hz.value_or(found->session.fps_hz.value_or(0));
  CheckMarkerOptions(*options);
}

CommandResult Run(Arguments arguments, CommandContext& context) {
  CommandResult result;
  if (!arguments.project.empty()) app::FillFromProject(arguments.project, arguments.session, &arguments.pose, &result);
  const auto found = arguments.project.empty() ? app::FindTake(arguments.session, &result) : std::nullopt;
  if (found) {
    app::FillPoses(*found, arguments.session, &arguments.pose);
    if (arguments.out.empty()) arguments.out = dataset::TakeFolder(found->session, "pose3d", found->take.name);
  }
  if (arguments.pose.calib.empty()) throw UsageError("--calib is required, or a --session that has a calibration");
  if (arguments.out.empty()) throw UsageError("--out is required, or a --session to write to");
  CheckArguments(arguments);
  FillMarkerOptions(found, &arguments.markers);
  const auto& pose = arguments.pose;
  const OutputFolder place(
      arguments.out,
      Joined(PathsIn(pose.pose2d), {pose.points2d, pose.calib, arguments.comparison.trc, arguments.comparison.truth}),
      {"points.csv", "covariance.csv", "pose3d.json"});
  result.folder = arguments.out;
  arguments.had_points = std::filesystem::exists(PointsPath(arguments));
  std::unique_ptr<AtomicFolder> markers;
  if (!arguments.markers.to.empty()) markers = std::make_unique<AtomicFolder>(MarkerFolder(arguments), true);
  if (arguments.chunk_frames > 0) {
    const app::PoseParts parts(arguments.pose, &result);
    app::ReportOffsetsUnused(parts.input().rig, "--chunk-frames reads the take in parts", &result);
    app::PointStatistics statistics(static_cast<int>(parts.input().skeleton.joints.size()), parts.input().limbs);
    const triangulate::TakeResult take = SolveChunks(arguments, parts, context.run, &statistics, &result);
    const auto sample = [&] { return Sample(parts, static_cast<size_t>(arguments.chunk_frames)); };
    Conclude(arguments, parts.input(), take, statistics, sample, context.run, &result);
  } else {
    app::PoseInput input = app::ReadPoseInput(arguments.pose, &result);
    ApplyTiming(found, arguments, context.run, &input, &result);
    app::PointStatistics statistics(static_cast<int>(input.skeleton.joints.size()), input.limbs);
    const triangulate::TakeResult take = SolveWhole(arguments, input, context.run, &statistics, &result);
    Conclude(
        arguments, input, take, statistics, [&] { return input.frames; }, context.run, &result);
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
  AddSessionArguments(sub, arguments->session, "calibration, 2D poses and the timing of the cameras", "people");
  AddOption(sub, "--project", arguments->project,
            "folder of an anipose or caliscope project instead: calibration and 2D points come from it; --take names one of "
            "its takes");
  AddOption(sub, "--out", arguments->out,
            "folder for points.csv, covariance.csv, pose3d.json; SESSION/pose3d/TAKE unless given");
  AddOptions(sub, arguments->options);
  AddOption(sub, "--sync", arguments->sync, "sync.json of `mvstudio sync`: time offsets of the cameras");
  AddChoice(sub, "--calibration-offsets", arguments->calibration_offsets,
            "time offsets that the calibration states, where the take has no timing of its own: auto (when left-out cameras "
            "confirm them), on or off")
      ->capture_default_str()
      ->check(CLI::IsMember({"auto", "on", "off"}));
  AddFlag(sub, "--refine", arguments->refine,
          "refine the joints of each person together: smoothness and bone lengths, each only where it predicts left-out "
          "cameras better; not with --chunk-frames");
  AddOptions(sub, arguments->refine_options);
  AddOption(
      sub, "--chunk-frames", arguments->chunk_frames,
      "for takes longer than memory: frames processed at a time; noise and method come from frames spread over the take; 0: "
      "all at once")
      ->capture_default_str();
  AddOptions(sub, arguments->markers);
  AddOption(sub, "--trc", arguments->comparison.trc,
            "compare with the markers of this .trc or .c3d file (its frame 1 is our frame 0; y up unless a .c3d says z)");
  AddOption(sub, "--truth", arguments->comparison.truth,
            "compare with a folder of body3DScene files, a points.csv, or markers (.trc, .c3d)");
  AddOption(sub, "--marker-unit", arguments->comparison.marker_unit,
            "m, cm, mm or in: instead of the unit that the .trc or .c3d states");
  AddFlag(sub, "--align-truth", arguments->comparison.align_truth,
          "take out the best rigid motion before comparing with --truth");
  registry.Add(sub, "triangulate", [arguments](CommandContext& context) { return Run(*arguments, context); });
}

}  // namespace mvstudio::cli
