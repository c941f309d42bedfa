#include "stages/demo/run.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "core/disk/files.h"
#include "core/disk/lock.h"
#include "core/disk/manifest.h"
#include "core/disk/output.h"
#include "core/disk/place.h"
#include "core/error.h"
#include "core/log.h"
#include "core/units.h"

namespace mvstudio::stages {
namespace {

constexpr char kTake[] = "take1";  ///< the studio's only one with a person

void Shrink(DemoOptions* o) { o->cameras = 5, o->board_frames = 30, o->take_frames = 20, o->avatar_size = 64, o->steps = 60; }

CommandLine SynthLine(const DemoOptions& o) {
  return {{"synth"},
          {{"out", {o.out}},
           {"overwrite", {}},
           {"cameras", {std::to_string(o.cameras)}},
           {"size", {o.size}},
           {"lens", {o.lens}},
           {"noise-px", {std::to_string(o.noise_px)}},
           {"board", {o.board}},
           {"board-frames", {std::to_string(o.board_frames)}},
           {"take-frames", {std::to_string(o.take_frames)}}}};
}

/// What the stages of the demo are told, in the session's own file: the world of the board, the last fifth of the take and the
/// second camera held out, a small network.
void WriteSettings(const DemoOptions& o) {
  dataset::Session session = dataset::ReadSession(o.out);
  const int first_held_out = o.take_frames - o.take_frames / 5;
  session.settings["calibrate"] = {{"world", {"board:0"}}};
  session.settings["mask"] = {{"backend", {"background"}}};
  session.settings["split"] = {{"holdout-cameras", {session.cameras.at(1).name}},
                               {"holdout-frames", {std::to_string(first_held_out) + "-" + std::to_string(o.take_frames - 1)}}};
  session.settings["avatar"] = {
      {"method", {"tna"}}, {"size", {std::to_string(o.avatar_size)}}, {"steps", {std::to_string(o.steps)}}};
  WriteFileAtomic(o.out + "/mvstudio.toml", dataset::SessionText(session));
}

double NumberAt(const nlohmann::ordered_json& object, const std::string& pointer) {
  const nlohmann::ordered_json::json_pointer at(pointer);
  return object.contains(at) && object[at].is_number() ? object[at].get<double>() : NAN;
}

/// mm; of 8 cameras, and of fewer as the error of a mean grows.
double JointBound(int cameras) { return 4.5 * std::sqrt(8.0 / std::min(cameras, 8)); }

std::vector<DemoCheck> ChecksOf(const StudioComparison& t, const nlohmann::ordered_json& scores, int cameras) {
  const double ssim = NumberAt(scores, "/holdout/ssim"), psnr = NumberAt(scores, "/holdout/psnr_db");
  return {
      {"rig rotation, worst camera", "deg", RadToDeg(t.rig.max_rotation_rad), 0.05, false},
      {"rig translation, worst camera", "mm", 1000 * t.rig.max_translation_m, 2, false},
      {"focal length, worst camera", "%", 100 * t.rig.max_focal_relative, 0.2, false},
      {"3D joints, median error", "mm", t.joints_median_mm, JointBound(cameras), false},
      {"joints inside the predicted 68 % ellipsoid, at least", "", t.coverage68, 0.58, true},
      {"joints inside the predicted 68 % ellipsoid, at most", "", t.coverage68, 0.78, false},
      {"joints inside the predicted 95 % ellipsoid, at least", "", t.coverage95, 0.90, true},
      {"held-out SSIM above the mean image", "", ssim, NumberAt(scores, "/baselines/mean_image/ssim"), true},
      {"held-out SSIM above the nearest pose", "", ssim, NumberAt(scores, "/baselines/nearest_pose/ssim"), true},
      {"held-out PSNR above the mean image", "dB", psnr, NumberAt(scores, "/baselines/mean_image/psnr_db"), true},
      {"held-out PSNR above the nearest pose", "dB", psnr, NumberAt(scores, "/baselines/nearest_pose/psnr_db"), true},
  };
}

class DemoRun {
 public:
  DemoRun(const DemoOptions& options, const DemoTools& tools) : tools_(tools) { report_.options = options; }

  DemoReport Run() {
    const DemoOptions& o = report_.options;
    if (!MakeStudio()) return std::move(report_);
    WriteSettings(o);
    if (!DoStages(StageKind::kEval)) return std::move(report_);
    report_.truth = CompareStudio(o.out, o.out + "/calib/calibration.json", o.out + "/pose3d/" + kTake);
    report_.checks = ChecksOf(*report_.truth, report_.scores, o.cameras);
    tools_.keep(report_);
    DoStages(StageKind::kReport);
    return std::move(report_);
  }

 private:
  bool MakeStudio() {
    const CommandLine line = SynthLine(report_.options);
    Log(LogLevel::kInfo, line.Text());
    StageRow row;
    row.stage = "synth", row.command = line.Text(), row.state = RowState::kDone;
    const CallOutcome made = tools_.pipeline.call(line);
    row.seconds = made.seconds, row.exit = made.result.exit;
    Append(made.result.warnings, &report_.warnings);
    if (row.exit != kExitOk) {
      row.state = RowState::kFailed;
      report_.exit = row.exit, report_.errors = made.result.errors;
    }
    report_.rows.push_back(row);
    return row.exit == kExitOk;
  }

  /// As far as `to`; a gate that fails stops nothing, since the demo's own checks judge.
  bool DoStages(StageKind to) {
    PipelineOptions options;
    options.session = report_.options.out, options.to = to;
    PipelineTools tools = tools_.pipeline;
    tools.call = [this](const CommandLine& line) {
      CallOutcome outcome = tools_.pipeline.call(line);
      if (outcome.result.exit == kExitQualityGate) {
        Append(outcome.result.errors, &outcome.result.warnings);
        outcome.result.exit = kExitOk;
      }
      if (line.command.front() == "avatar" && line.command.at(1) == "eval") report_.scores = outcome.result.metrics;
      return outcome;
    };
    const PipelineReport done = RunPipeline(options, tools);
    for (const StageRow& row : done.rows)
      if (row.state != RowState::kNotAsked && row.state != RowState::kLeftOut && row.state != RowState::kUpToDate)
        report_.rows.push_back(row);
    Append(done.warnings, &report_.warnings);
    report_.errors = done.errors, report_.exit = done.exit;
    return done.exit == kExitOk;
  }

  const DemoTools& tools_;
  DemoReport report_;
};

}  // namespace

DemoReport RunDemo(DemoOptions options, const DemoTools& tools) {
  namespace fs = std::filesystem;
  if (options.quick) Shrink(&options);
  RequireSafeOutput(options.out, {}, true);
  const OutputLock lock(options.out);
  if (fs::exists(options.out) && !fs::is_empty(options.out)) {
    if (!options.overwrite)
      throw UsageError(options.out + ": exists already; choose another option 'out' or pass option 'overwrite'");
    RemoveOurs({options.out});
  }
  return DemoRun(options, tools).Run();
}

}  // namespace mvstudio::stages
