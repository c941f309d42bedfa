#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <tuple>

#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "cli/program/redact.h"
#include "cli/program/stage.h"
#include "core/disk/files.h"
#include "core/disk/manifest.h"
#include "core/disk/output.h"
#include "core/disk/place.h"
#include "core/error.h"
#include "core/format.h"
#include "core/log.h"
#include "core/statistics.h"
#include "core/units.h"
#include "dataset/pose/pose3d.h"
#include "geometry/rig/alignment.h"
#include "geometry/rig/rig_io.h"

namespace mvstudio::cli {
namespace {

using Json = nlohmann::ordered_json;
using Words = std::vector<std::string>;

struct DemoOptions {
  std::string out = "demo-out";
  bool overwrite = false;
  bool quick = false;
  int cameras = 8;
  std::string size = "640x480";
  std::string lens = "brown5";
  double noise_px = 1.0;
  std::string board = "charuco:7x5:140mm:105mm";
  int board_frames = 60;
  int take_frames = 100;
  int avatar_size = 128;
  int steps = 600;
};

template <class Visitor>
void VisitFields(Visitor&& visit, DemoOptions& o) {
  visit("out", o.out, "folder of the session, the results and the report");
  visit("overwrite", o.overwrite, "replace what an earlier demo left in --out");
  visit("quick", o.quick, "a small studio and a short training: ends within a minute, shows no quality");
  visit("cameras", o.cameras, "cameras of the synthetic studio");
  visit("size", o.size, "px; size of the images");
  visit("lens", o.lens, "lens model the images are rendered through");
  visit("noise-px", o.noise_px, "px; noise of the 2D joints, per coordinate");
  visit("board", o.board, "calibration board of the synthetic studio");
  visit("board-frames", o.board_frames, "frames of board footage");
  visit("take-frames", o.take_frames, "frames of the person's take; the last fifth is held out");
  visit("avatar-size", o.avatar_size, "px; size of the avatar's images");
  visit("steps", o.steps, "training steps of the avatar");
}

void Shrink(DemoOptions& o) { o.cameras = 5, o.board_frames = 30, o.take_frames = 20, o.avatar_size = 64, o.steps = 60; }

/// A stage that gave no result; ends the demo with that stage's exit code and reason.
struct StageFailure {
  CommandResult result;
};

/// A number of the demo against the bound it must keep.
struct Check {
  std::string name, unit;
  double value, bound;
  bool at_least;  ///< the value must be >= bound; otherwise <=
  bool Pass() const { return at_least ? value >= bound : value <= bound; }
};

struct TruthComparison {
  geometry::RigDifference rig;
  double joints_median_mm = NAN, joints_mean_mm = NAN, predicted_sigma_median_mm = NAN;
  double coverage68 = NAN, coverage95 = NAN;  ///< share of joints inside the predicted error ellipsoids
  int num_joints = 0;
};

double Share(const std::vector<double>& values, double limit) {
  if (values.empty()) return NAN;
  return static_cast<double>(std::count_if(values.begin(), values.end(), [&](double v) { return v <= limit; })) /
         static_cast<double>(values.size());
}

/// Joints are brought into the truth's world by the alignment of the two rigs alone, never by one fitted to the joints.
TruthComparison CompareRunWithTruth(const std::string& session, const std::string& run) {
  TruthComparison result;
  result.rig = geometry::CompareRigs(geometry::ReadRig(run + "/calibration.json"),
                                     geometry::ReadRig(session + "/truth/calibration.json"));
  const geometry::Rigid3& truth_from_rig = result.rig.reference_from_rig;
  const Eigen::Matrix3d rotation = truth_from_rig.rotation.toRotationMatrix();
  std::map<std::tuple<int, int, std::string>, Eigen::Vector3d> truth;
  for (const auto& row : dataset::ReadPose3d(session + "/truth/pose3d").rows) {
    if (row.status == Status::kOk) truth[{row.frame, row.person, row.joint}] = row.x_in_world;
  }
  std::vector<double> errors_mm, sigmas_mm, squared_distances;
  for (const auto& row : dataset::ReadPose3d(run + "/pose3d").rows) {
    const auto expected = truth.find({row.frame, row.person, row.joint});
    if (row.status != Status::kOk || expected == truth.end()) continue;
    const Eigen::Vector3d error = truth_from_rig * row.x_in_world - expected->second;
    errors_mm.push_back(1000 * error.norm());
    sigmas_mm.push_back(1000 * row.sigma_m);
    if (row.covariance) {
      const Eigen::Matrix3d covariance = rotation * *row.covariance * rotation.transpose();
      squared_distances.push_back(error.dot(covariance.ldlt().solve(error)));
    }
  }
  result.num_joints = static_cast<int>(errors_mm.size());
  result.joints_median_mm = UpperMedian(errors_mm);
  for (double e : errors_mm)
    result.joints_mean_mm = (std::isnan(result.joints_mean_mm) ? 0 : result.joints_mean_mm) + e / errors_mm.size();
  result.predicted_sigma_median_mm = UpperMedian(sigmas_mm);
  // Quantiles of the chi-square distribution with three degrees of freedom.
  result.coverage68 = Share(squared_distances, 3.5059);
  result.coverage95 = Share(squared_distances, 7.8147);
  return result;
}

Json TruthToJson(const TruthComparison& t) {
  return {{"rig_rotation_deg", RadToDeg(t.rig.max_rotation_rad)},
          {"rig_translation_mm", 1000 * t.rig.max_translation_m},
          {"focal_percent", 100 * t.rig.max_focal_relative},
          {"joints_median_mm", t.joints_median_mm},
          {"joints_mean_mm", t.joints_mean_mm},
          {"joints_predicted_sigma_mm", t.predicted_sigma_median_mm},
          {"joints_coverage68", t.coverage68},
          {"joints_coverage95", t.coverage95},
          {"joints", t.num_joints}};
}

double Number(const Json& object, const std::string& pointer) {
  const Json::json_pointer at(pointer);
  return object.contains(at) && object[at].is_number() ? object[at].get<double>() : NAN;
}

std::vector<Check> Checks(const TruthComparison& t, const Json& eval) {
  const double ssim = Number(eval, "/holdout/ssim"), psnr = Number(eval, "/holdout/psnr_db");
  return {
      {"rig rotation, worst camera", "deg", RadToDeg(t.rig.max_rotation_rad), 0.05, false},
      {"rig translation, worst camera", "mm", 1000 * t.rig.max_translation_m, 2, false},
      {"focal length, worst camera", "%", 100 * t.rig.max_focal_relative, 0.2, false},
      {"3D joints, median error", "mm", t.joints_median_mm, 4.5, false},
      {"joints inside the predicted 68 % ellipsoid, at least", "", t.coverage68, 0.58, true},
      {"joints inside the predicted 68 % ellipsoid, at most", "", t.coverage68, 0.78, false},
      {"joints inside the predicted 95 % ellipsoid, at least", "", t.coverage95, 0.90, true},
      {"held-out SSIM above the mean image", "", ssim, Number(eval, "/baselines/mean_image/ssim"), true},
      {"held-out SSIM above the nearest pose", "", ssim, Number(eval, "/baselines/nearest_pose/ssim"), true},
      {"held-out PSNR above the mean image", "dB", psnr, Number(eval, "/baselines/mean_image/psnr_db"), true},
      {"held-out PSNR above the nearest pose", "dB", psnr, Number(eval, "/baselines/nearest_pose/psnr_db"), true},
  };
}

/// The demo as the command lines a user would type; each runs in this process.
class Demo {
 public:
  Demo(const DemoOptions& options, CommandContext& context)
      : o_(options), context_(context), session_(options.out + "/session") {}

  CommandResult Run() {
    Stage(SynthWords());
    cameras_ = geometry::CameraNames(geometry::ReadRig(session_ + "/truth/calibration.json"));
    Stage(CalibrateWords());
    Stage(TriangulateWords());
    truth_ = CompareRunWithTruth(session_, o_.out);
    Stage(BuildWords());
    Stage({"dataset", "verify", o_.out + "/dataset", "--keep", o_.out});
    Stage(TrainWords());
    eval_ = Stage({"avatar", "eval", o_.out + "/avatar", "--overwrite"});
    CommandResult result = Summary();
    // The report reads saved results, so the demo's own must be there before it.
    WriteFileAtomic(o_.out + "/demo.result.json", RedactedJson(Json{{"schema", "mvstudio.result/1"},
                                                                    {"command", "demo"},
                                                                    {"version", MVSTUDIO_VERSION},
                                                                    {"status", result.exit == 0 ? "ok" : "fail"},
                                                                    {"exit", result.exit},
                                                                    {"metrics", result.metrics},
                                                                    {"outputs", Json::array()},
                                                                    {"warnings", Json::array()},
                                                                    {"errors", Json::array()},
                                                                    {"argv", context_.argv}})
                                                      .dump(1));
    Stage({"report", o_.out, "--out", o_.out + "/report.html"});
    return result;
  }

 private:
  Json Stage(const Words& words) {
    std::string line = "mvstudio";
    for (const std::string& word : words) line += " " + word;
    Log(LogLevel::kInfo, line);
    const LineOutcome outcome = RunStage(words, context_);
    stages_.push_back({{"command", line}, {"exit", outcome.result.exit}, {"wall_s", outcome.json["timing"]["wall_s"]}});
    const int exit = outcome.result.exit;
    for (const Notice& warning : outcome.result.warnings) warnings_.push_back(warning);
    if (exit != kExitOk && exit != kExitQualityGate && exit != kExitPartial) {
      CommandResult failed;
      failed.exit = exit;
      failed.errors = outcome.result.errors;
      failed.warnings.push_back({"DEMO-STAGE", "the demo ended at: " + line, "run that command alone to look closer"});
      throw StageFailure{failed};
    }
    return outcome.json["metrics"];
  }

  Words SynthWords() const {
    return {"synth",          "--out",
            session_,         "--overwrite",
            "--cameras",      std::to_string(o_.cameras),
            "--size",         o_.size,
            "--lens",         o_.lens,
            "--noise-px",     std::to_string(o_.noise_px),
            "--board",        o_.board,
            "--board-frames", std::to_string(o_.board_frames),
            "--take-frames",  std::to_string(o_.take_frames)};
  }
  void AddPerCamera(Words& words, const std::string& flag, const std::string& folder, const std::string& extension) const {
    for (const std::string& camera : cameras_) {
      words.push_back(flag);
      words.push_back(camera + "=" + session_ + "/" + folder + "/" + camera + extension);
    }
  }
  Words CalibrateWords() const {
    Words words = {"calibrate", "--board", o_.board, "--world", "board:0", "--out", o_.out};
    AddPerCamera(words, "--camera", "raw/board", ".mp4");
    return words;
  }
  Words TriangulateWords() const {
    Words words = {"triangulate", "--calib", o_.out + "/calibration.json", "--skeleton", "body25", "--out", o_.out + "/pose3d"};
    AddPerCamera(words, "--pose2d", "pose2d/take1", "");
    AddPerCamera(words, "--video", "raw/take1", ".mp4");
    return words;
  }
  Words BuildWords() const {
    Words words = {
        "dataset",           "build",      "--calib", o_.out + "/calibration.json", "--pose3d", o_.out + "/pose3d", "--out",
        o_.out + "/dataset", "--overwrite"};
    AddPerCamera(words, "--video", "raw/take1", ".mp4");
    AddPerCamera(words, "--plate", "raw/plate", ".png");
    return words;
  }
  Words TrainWords() const {
    const int first_held_out = o_.take_frames - o_.take_frames / 5;
    return {"avatar",
            "train",
            o_.out + "/dataset",
            "--method",
            "tna",
            "--holdout-cameras",
            cameras_[1],
            "--holdout-frames",
            std::to_string(first_held_out) + "-" + std::to_string(o_.take_frames - 1),
            "--size",
            std::to_string(o_.avatar_size),
            "--steps",
            std::to_string(o_.steps),
            "--out",
            o_.out + "/avatar",
            "--overwrite"};
  }

  CommandResult Summary() const {
    CommandResult result;
    result.warnings = warnings_;
    result.metrics["quick"] = o_.quick;
    result.metrics["truth"] = TruthToJson(truth_);
    result.metrics["avatar"] = {{"holdout", eval_.value("holdout", Json::object())},
                                {"baselines", eval_.value("baselines", Json::object())}};
    result.metrics["stages"] = stages_;
    result.metrics["checks"] = Json::array();
    for (const Check& check : Checks(truth_, eval_)) {
      result.metrics["checks"].push_back({{"name", check.name},
                                          {"value", check.value},
                                          {"bound", check.bound},
                                          {"unit", check.unit},
                                          {"at_least", check.at_least},
                                          {"pass", check.Pass()}});
      result.text += Format("%-6s %-55s %9.4f  %s %g %s\n", check.Pass() ? "ok" : "MISSED", check.name.c_str(), check.value,
                            check.at_least ? ">=" : "<=", check.bound, check.unit.c_str());
      if (!check.Pass() && !o_.quick) result.exit = kExitQualityGate;
    }
    result.outputs = {{o_.out + "/report.html", "report"}, {o_.out + "/report.json", "report"}};
    result.text += "Report: " + PathOnDisk(o_.out + "/report.html");
    return result;
  }

  const DemoOptions& o_;
  CommandContext& context_;
  const std::string session_;
  std::vector<std::string> cameras_;
  TruthComparison truth_;
  Json eval_, stages_ = Json::array();
  std::vector<Notice> warnings_;
};

CommandResult RunDemo(DemoOptions options, CommandContext& context) {
  namespace fs = std::filesystem;
  if (options.quick) Shrink(options);
  RequireSafeOutput(options.out, {}, true);
  const OutputLock lock(options.out);
  if (fs::exists(options.out) && !fs::is_empty(options.out)) {
    if (!options.overwrite) throw UsageError(options.out + ": exists already; choose another --out or pass --overwrite");
    RemoveOurs({options.out});
  }
  MakeFolder(options.out);
  try {
    return Demo(options, context).Run();
  } catch (const StageFailure& failure) {
    return failure.result;
  }
}

}  // namespace

void RegisterDemo(CLI::App& app, Registry& registry) {
  auto options = std::make_shared<DemoOptions>();
  CLI::App* sub = app.add_subcommand("demo", "The whole pipeline on the built-in synthetic studio, ending in a report");
  AddOptions(sub, *options);
  NameOutput(sub->get_option("--out"), OutputKind::kFolder);
  registry.Add(sub, "demo", [options](CommandContext& context) { return RunDemo(*options, context); });
}

}  // namespace mvstudio::cli
