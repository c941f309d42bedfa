#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <map>
#include <set>

#include "cli/commands.h"
#include "cli/pose_input.h"
#include "cli/triangulate_take.h"
#include "core/error.h"
#include "core/files.h"
#include "dataset/panoptic.h"
#include "dataset/pose3d_compare.h"
#include "dataset/pose3d_trc.h"
#include "triangulate/limbs.h"

namespace mvstudio::cli {
namespace {

using nlohmann::ordered_json;

struct Arguments {
  PoseArguments pose;
  std::string out, trc, truth;
  bool align_truth = false;
  triangulate::TakeOptions options;
};

double Median(std::vector<double> values) {
  if (values.empty()) return std::nan("");
  std::sort(values.begin(), values.end());
  return 0.5 * (values[(values.size() - 1) / 2] + values[values.size() / 2]);
}

ordered_json StatusCounts(const triangulate::TakeResult& take) {
  std::map<Status, int> counts;
  for (const auto& entry : take.points) ++counts[entry.point.status];
  ordered_json json = ordered_json::object();
  for (const auto& [status, count] : counts) json[std::string(ToString(status))] = count;
  return json;
}

ordered_json JointMetrics(const triangulate::TakeResult& take, const body::Skeleton& skeleton) {
  ordered_json list = ordered_json::array();
  for (size_t j = 0; j < skeleton.joints.size(); ++j) {
    std::vector<double> sigmas_mm, rms_px;
    for (const auto& entry : take.points) {
      if (entry.joint_idx != static_cast<int>(j) || entry.point.status != Status::kOk) continue;
      sigmas_mm.push_back(1000 * std::sqrt(entry.point.covariance.trace() / 3));
      rms_px.push_back(entry.point.rms_px);
    }
    list.push_back(
        {{"joint", skeleton.joints[j]}, {"num", rms_px.size()}, {"sigma_mm", Median(sigmas_mm)}, {"rms_px", Median(rms_px)}});
  }
  return list;
}

ordered_json ToJson(const Eigen::Vector2d& v) { return ordered_json::array({v.x(), v.y()}); }

ordered_json CameraMetrics(const triangulate::TakeResult& take) {
  ordered_json list = ordered_json::array();
  for (const triangulate::CameraDiagnosis& camera : take.cameras) {
    list.push_back({{"name", camera.name},
                    {"mean_residual_px", ToJson(camera.mean_residual_px)},
                    {"sigma_residual_px", ToJson(camera.sigma_residual_px)},
                    {"mean_left_out_residual_px", ToJson(camera.mean_left_out_residual_px)},
                    {"image_scale", ToJson(camera.image_scale)},
                    {"num_detections", camera.num_detections},
                    {"num_rejected", camera.num_rejected},
                    {"off", camera.off},
                    {"scaled", camera.scaled}});
  }
  return list;
}

ordered_json Finite(double value) { return std::isfinite(value) ? ordered_json(value) : ordered_json(nullptr); }

ordered_json ToJson(const triangulate::LeftOutFigures& f) {
  return {{"num", f.num_samples},
          {"coverage", Finite(f.coverage)},
          {"median_px", Finite(f.median_px)},
          {"median_error_px", Finite(f.median_error_px)},
          {"p90_px", Finite(f.p90_px)},
          {"predicted_mean_px", Finite(f.predicted_mean_px)},
          {"median_sigmas", Finite(f.median_sigmas)}};
}

/// What the other cameras say of each camera's detections.
ordered_json HoldoutMetrics(const triangulate::TakeResult& take, const body::Skeleton& skeleton) {
  ordered_json json = ToJson(take.holdout.all);
  json["cameras"] = json["joints"] = ordered_json::array();
  for (size_t c = 0; c < take.holdout.cameras.size(); ++c) {
    ordered_json entry = {{"name", take.cameras[c].name}};
    entry.update(ToJson(take.holdout.cameras[c]));
    json["cameras"].push_back(entry);
  }
  for (size_t j = 0; j < take.holdout.joints.size(); ++j) {
    ordered_json entry = {{"joint", skeleton.joints[j]}};
    entry.update(ToJson(take.holdout.joints[j]));
    json["joints"].push_back(entry);
  }
  return json;
}

ordered_json MethodMetrics(const triangulate::MethodChoice& choice) {
  ordered_json list = ordered_json::array();
  for (size_t m = 0; m < choice.scores.size(); ++m) {
    const triangulate::MethodScore& score = choice.scores[m];
    list.push_back({{"method", score.name},
                    {"holdout_median_px", Finite(score.figures.median_px)},
                    {"holdout_p90_px", Finite(score.figures.p90_px)},
                    {"coverage", Finite(score.figures.coverage)},
                    {"justified", score.justified},
                    {"chosen", m == choice.chosen}});
  }
  return list;
}

ordered_json LimbMetrics(const triangulate::TakeResult& take, const PoseInput& input) {
  ordered_json list = ordered_json::array();
  for (const triangulate::LimbLength& limb : MeasureLimbs(take.points, input.limbs)) {
    const auto [a, b] = input.limbs[static_cast<size_t>(limb.limb)];
    list.push_back({{"person", limb.person},
                    {"limb", input.skeleton.joints[static_cast<size_t>(a)] + "-" + input.skeleton.joints[static_cast<size_t>(b)]},
                    {"num_frames", limb.num_frames},
                    {"mean_mm", 1000 * limb.mean_m},
                    {"std_mm", 1000 * limb.std_m}});
  }
  return list;
}

int AddMetrics(const triangulate::TakeResult& take, const PoseInput& input, double seconds, CommandResult* result) {
  std::vector<double> rms_px, sigmas_mm;
  for (const auto& entry : take.points) {
    if (entry.point.status != Status::kOk) continue;
    rms_px.push_back(entry.point.rms_px);
    sigmas_mm.push_back(1000 * std::sqrt(entry.point.covariance.trace() / 3));
  }
  double sum = 0;
  for (const double rms : rms_px) sum += rms;
  const double count = static_cast<double>(rms_px.size());
  ordered_json& metrics = result->metrics;
  metrics["num_points"] = rms_px.size();
  metrics["num_joints_tried"] = take.points.size();
  metrics["num_persons"] = take.num_persons;
  metrics["status_counts"] = StatusCounts(take);
  metrics["mean_rms_px"] = sum / count;
  metrics["median_rms_px"] = Median(rms_px);
  metrics["median_sigma_mm"] = Median(sigmas_mm);
  metrics["sigma_px"] = take.sigma_px;
  metrics["method"] = take.method;
  if (!take.choice.scores.empty()) {
    metrics["method_reason"] = take.choice.reason;
    metrics["methods"] = MethodMetrics(take.choice);
  }
  metrics["holdout"] = HoldoutMetrics(take, input.skeleton);
  metrics["limb_std_mm"] = Finite(1000 * MeanLimbStd(MeasureLimbs(take.points, input.limbs)));
  metrics["limbs"] = LimbMetrics(take, input);
  metrics["cameras"] = CameraMetrics(take);
  metrics["joints"] = JointMetrics(take, input.skeleton);
  metrics["points_per_s"] = count / seconds;
  return static_cast<int>(rms_px.size());
}

void AddCameraWarnings(const triangulate::TakeResult& take, const std::vector<dataset::Pose2dTrack>& tracks,
                       CommandResult* result) {
  for (const triangulate::CameraDiagnosis& camera : take.cameras) {
    if (camera.off) {
      result->warnings.push_back(
          {"TRI-CAMERA-OFF", camera.message,
           "recalibrate this camera, or check that its pictures have the calibrated size and were not cropped"});
    } else if (camera.scaled) {
      result->warnings.push_back({"TRI-CAMERA-SCALED", camera.message, "check that its pictures have the calibrated size"});
    }
  }
  std::set<int> frames;
  for (const auto& track : tracks) {
    for (const auto& [frame, people] : track.frames) frames.insert(frame);
  }
  for (const auto& track : tracks) {
    const size_t with_people = static_cast<size_t>(
        std::count_if(track.frames.begin(), track.frames.end(), [](const auto& entry) { return !entry.second.empty(); }));
    if (2 * with_people >= frames.size()) continue;
    result->warnings.push_back(
        {"TRI-FEW-DETECTIONS",
         track.camera + ": people in " + std::to_string(with_people) + " of " + std::to_string(frames.size()) + " frames only",
         "check the detector's output for this camera and that all cameras count frames from the same instant"});
  }
}

/// Detections that scatter by a noticeable part of the picture do not belong to this calibration.
void CheckConsistency(const triangulate::TakeResult& take, const geometry::Rig& rig, CommandResult* result) {
  constexpr double kMaxSigmaOfDiagonal = 0.015;
  double diagonal_px = 0;
  for (const geometry::RigCamera& camera : rig.cameras)
    diagonal_px += std::hypot(camera.camera.width_px, camera.camera.height_px);
  diagonal_px /= static_cast<double>(rig.cameras.size());
  if (take.sigma_px <= kMaxSigmaOfDiagonal * diagonal_px) return;
  char text[200];
  std::snprintf(text, sizeof text, "views disagree: sigma %.1f px is %.1f %% of the picture's diagonal", take.sigma_px,
                100 * take.sigma_px / diagonal_px);
  result->exit = kExitQualityGate;
  result->errors.push_back({"TRI-INCONSISTENT", text,
                            "check that each folder belongs to its camera, that all cameras count frames from the same "
                            "instant, and the calibration"});
}

ordered_json ToJson(const dataset::Pose3dComparison& comparison) {
  ordered_json json = {{"median_mm", comparison.median_mm}, {"mean_mm", comparison.mean_mm}, {"p95_mm", comparison.p95_mm},
                       {"max_mm", comparison.max_mm},       {"num", comparison.num},         {"aligned", comparison.aligned}};
  if (comparison.num_covariance > 0) {
    json["coverage68"] = comparison.coverage68;
    json["coverage95"] = comparison.coverage95;
  }
  return json;
}

std::map<int, std::map<int, dataset::Coco19Pose>> ReadScenes(const std::vector<std::string>& files) {
  std::map<int, std::map<int, dataset::Coco19Pose>> scenes;
  for (const std::string& file : files) {
    const std::string digits = std::filesystem::path(file).stem().string().substr(std::string("body3DScene_").size());
    if (digits.empty() || digits.size() > 9 || digits.find_first_not_of("0123456789") != std::string::npos) {
      throw FormatError(file, "", "the file name is not body3DScene_%08d.json");
    }
    scenes[std::stoi(digits)] = dataset::ReadBody3dScene(file);
  }
  return scenes;
}

/// A folder of body3DScene files, a folder with points.csv, or a table by itself.
dataset::Pose3dComparison CompareWithTruth(const dataset::Pose3d& pose, const std::string& truth, bool align) {
  namespace fs = std::filesystem;
  const fs::path path(truth);
  const std::vector<std::string> scenes = Glob((path / "body3DScene_*.json").string());
  if (!scenes.empty()) return ComparePose3d(ToCoco19Table(pose), dataset::ToTable(ReadScenes(scenes)), align);
  const fs::path table = fs::is_directory(path) ? path / "points.csv" : path;
  if (!fs::exists(table))
    throw IoError(truth, "--truth is neither a points.csv nor a folder with body3DScene_*.json or points.csv");
  const dataset::JointTable reference = dataset::ToTable(dataset::ReadPointsCsv(table.string()));
  const fs::path header = table.parent_path() / "pose3d.json";
  const bool coco19 =
      pose.skeleton != "coco19" && fs::exists(header) && dataset::ReadPose3d(table.parent_path().string()).skeleton == "coco19";
  return ComparePose3d(coco19 ? ToCoco19Table(pose) : dataset::ToTable(pose.rows), reference, align);
}

void AddComparisons(const Arguments& arguments, const dataset::Pose3d& pose, CommandResult* result) {
  if (!arguments.trc.empty()) {
    const dataset::JointTable reference = dataset::ToTable(dataset::ReadTrc(arguments.trc).rows);
    result->metrics["trc"] = ToJson(ComparePose3d(dataset::ToTable(pose.rows), reference));
    result->inputs.push_back(arguments.trc);
  }
  if (!arguments.truth.empty()) {
    result->metrics["truth"] = ToJson(CompareWithTruth(pose, arguments.truth, arguments.align_truth));
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

CommandResult Run(const Arguments& arguments, CommandContext& context) {
  CommandResult result;
  result.folder = arguments.out;
  const PoseInput input = ReadPoseInput(arguments.pose, &result);
  const body::Skeleton& skeleton = input.skeleton;

  const auto start = std::chrono::steady_clock::now();
  const triangulate::TakeResult take =
      triangulate::TriangulateTake(input.rig, input.frames, static_cast<int>(skeleton.joints.size()), arguments.options, context.run);
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();

  const dataset::Pose3d pose = ToPose3d(take, skeleton);
  const int num_ok = AddMetrics(take, input, seconds, &result);
  AddCameraWarnings(take, input.tracks, &result);
  AddComparisons(arguments, pose, &result);
  CheckConsistency(take, input.rig, &result);
  if (num_ok == 0) {
    result.exit = kExitIllPosed;
    result.errors.push_back(
        {"TRI-NO-POINTS", "no joint could be triangulated; see status_counts",
         "check that calibration and poses belong to the same cameras and that all cameras count frames alike"});
  }
  dataset::WritePose3d(pose, arguments.out);
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
  sub->add_option("--trc", arguments->trc, "compare with the markers of this .trc file (y up, its frame 1 is our frame 0)");
  sub->add_option("--truth", arguments->truth, "compare with a folder of body3DScene files or a points.csv");
  sub->add_flag("--align-truth", arguments->align_truth, "take out the best rigid motion before comparing with --truth");
  registry.Add(sub, "triangulate", [arguments](CommandContext& context) { return Run(*arguments, context); });
}

}  // namespace mvstudio::cli
