#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>

#include "cli/commands.h"
#include "cli/pose_input.h"
#include "cli/pose_truth.h"
#include "cli/triangulate_metrics.h"
#include "cli/triangulate_take.h"
#include "core/error.h"
#include "dataset/pose3d.h"
#include "dataset/pose3d_compare.h"
#include "dataset/pose3d_trc.h"
#include "triangulate/stream.h"

namespace mvstudio::cli {
namespace {

using nlohmann::ordered_json;

struct Arguments {
  PoseArguments pose;
  std::string out, trc, truth;
  bool align_truth = false;
  int chunk_frames = 0;
  triangulate::TakeOptions options;
};

void AddComparisons(const Arguments& arguments, CommandResult* result) {
  if (arguments.trc.empty() && arguments.truth.empty()) return;
  const dataset::Pose3d pose = dataset::ReadPose3d(arguments.out);
  if (!arguments.trc.empty()) {
    const dataset::JointTable reference = dataset::ToTable(dataset::ReadTrc(arguments.trc).rows);
    result->metrics["trc"] = ComparisonToJson(ComparePose3d(dataset::ToTable(pose.rows), reference));
    result->inputs.push_back(arguments.trc);
  }
  if (!arguments.truth.empty()) {
    result->metrics["truth"] = ComparisonToJson(CompareWithTruth(pose, arguments.truth, arguments.align_truth));
    result->inputs.push_back(arguments.truth);
  }
}

std::string Summary(const CommandResult& result) {
  const ordered_json& m = result.metrics;
  const auto number = [](const ordered_json& value) { return value.is_number() ? value.get<double>() : std::nan(""); };
  char line[300];
  std::snprintf(
      line, sizeof line,
      "%d of %d joints triangulated, reprojection RMS median %.3f px, sigma %.3f px, median sigma %.2f mm, %.0f points/s",
      m["num_points"].get<int>(), m["num_joints_tried"].get<int>(), number(m["median_rms_px"]), number(m["sigma_px"]),
      number(m["median_sigma_mm"]), number(m["points_per_s"]));
  std::string text = line;
  std::snprintf(line, sizeof line, "\nmethod %s; one camera left out: median %.2f px; limb lengths vary by %.1f mm",
                m["method"].get<std::string>().c_str(), number(m["holdout"]["median_px"]), number(m["limb_std_mm"]));
  text += line;
  for (const char* key : {"trc", "truth"}) {
    if (!m.contains(key)) continue;
    std::snprintf(line, sizeof line, "\nagainst %s: median %.2f mm, p95 %.2f mm, %d joints", key, number(m[key]["median_mm"]),
                  number(m[key]["p95_mm"]), m[key]["num"].get<int>());
    text += line;
  }
  return text;
}

/// Solves the take and writes its points; what was settled for all of it comes back.
triangulate::TakeResult SolveWhole(const Arguments& arguments, const PoseInput& input, const RunContext& run,
                                   PointStatistics* statistics) {
  triangulate::TakeResult take = triangulate::TriangulateTake(
      input.rig, input.frames, BodyOf(input.skeleton), arguments.options, run);
  statistics->Add(take);
  dataset::WritePose3d(ToPose3d(take, input.skeleton), arguments.out);
  return take;
}

/// The same chunk by chunk: noise and method from frames spread over the take.
triangulate::TakeResult SolveChunks(const Arguments& arguments, const PoseInput& input, const RunContext& run,
                                    PointStatistics* statistics) {
  const triangulate::TakeBody body = BodyOf(input.skeleton);
  const size_t chunk = static_cast<size_t>(arguments.chunk_frames);
  std::vector<triangulate::DetectedFrame> sample;
  const size_t stride = std::max<size_t>(1, input.frames.size() / chunk);
  for (size_t f = 0; f < input.frames.size(); f += stride) sample.push_back(input.frames[f]);
  triangulate::TakeResult settled;
  triangulate::TakeStream stream(input.rig, body,
                                 SettleOptions(input.rig, sample, body, arguments.options, run, &settled));
  size_t begin = 0;
  const auto next = [&](std::vector<dataset::JointRow>* rows) {
    if (begin >= input.frames.size()) return false;
    const size_t end = std::min(begin + chunk, input.frames.size());
    const triangulate::TakeResult part = stream.Push(
        {input.frames.begin() + static_cast<std::ptrdiff_t>(begin), input.frames.begin() + static_cast<std::ptrdiff_t>(end)},
        run);
    statistics->Add(part);
    *rows = ToPose3d(part, input.skeleton).rows;
    begin = end;
    return true;
  };
  dataset::WritePose3d(input.skeleton.name, next, arguments.out);
  return settled;
}

CommandResult Run(const Arguments& arguments, CommandContext& context) {
  CommandResult result;
  result.folder = arguments.out;
  if (arguments.chunk_frames < 0) throw UsageError("--chunk-frames must not be negative");
  if (!arguments.trc.empty()) dataset::ReadTrc(arguments.trc);  // a wrong path must not cost the run
  if (!arguments.truth.empty() && !std::filesystem::exists(arguments.truth))
    throw IoError(arguments.truth, "--truth does not exist");
  const PoseInput input = ReadPoseInput(arguments.pose, &result);
  PointStatistics statistics(static_cast<int>(input.skeleton.joints.size()), input.limbs);
  const auto start = std::chrono::steady_clock::now();
  const triangulate::TakeResult take =
      (arguments.chunk_frames > 0 ? SolveChunks : SolveWhole)(arguments, input, context.run, &statistics);
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  statistics.AddTo(input.skeleton, &result.metrics);
  AddTakeMetrics(take, input.skeleton, &result.metrics);
  result.metrics["points_per_s"] = statistics.num_ok() / seconds;
  AddCameraWarnings(take, input.tracks, &result);
  AddComparisons(arguments, &result);
  CheckConsistency(take, input.rig, &result);
  if (statistics.num_ok() == 0) {
    result.exit = kExitIllPosed;
    result.errors.push_back(
        {"TRI-NO-POINTS", "no joint could be triangulated; see status_counts",
         "check that calibration and poses belong to the same cameras and that all cameras count frames alike"});
  }
  for (const char* name : {"points.csv", "covariance.csv", "pose3d.json"}) {
    result.outputs.push_back(
        {(std::filesystem::path(arguments.out) / name).string(), name == std::string("points.csv") ? "points" : ""});
  }
  result.text = Summary(result);
  return result;
}

}  // namespace

void RegisterTriangulate(CLI::App& app, Registry& registry) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* sub = app.add_subcommand("triangulate", "2D joints of several cameras -> 3D joints");
  AddPoseArguments(sub, arguments->pose);
  sub->add_option("--out", arguments->out, "folder for points.csv, covariance.csv, pose3d.json")->required();
  AddOptions(sub, arguments->options);
  sub->add_option(
         "--chunk-frames", arguments->chunk_frames,
         "for takes longer than memory: so many frames at a time; noise and method come from frames spread over the take; 0: "
         "all at once")
      ->capture_default_str();
  sub->add_option("--trc", arguments->trc, "compare with the markers of this .trc file (y up, its frame 1 is our frame 0)");
  sub->add_option("--truth", arguments->truth, "compare with a folder of body3DScene files or a points.csv");
  sub->add_flag("--align-truth", arguments->align_truth, "take out the best rigid motion before comparing with --truth");
  registry.Add(sub, "triangulate", [arguments](CommandContext& context) { return Run(*arguments, context); });
}

}  // namespace mvstudio::cli
