#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "avatar/run/lift/lift_take.h"
#include "cli/program/commands.h"
#include "cli/program/input_flags.h"
#include "cli/program/options.h"
#include "cli/program/output_guard.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "core/format.h"
#include "core/join.h"
#include "core/statistics.h"
#include "dataset/footage/frame_rate.h"
#include "dataset/panoptic/panoptic.h"
#include "stages/input/calib_read.h"
#include "stages/input/pose3d_input.h"
#include "stages/input/pose_changes.h"

namespace mvstudio::cli {
namespace {

using avatar::LiftComparison;
using avatar::LiftedFrame;
using avatar::LiftScore;
using nlohmann::ordered_json;
using Truth = std::map<int, dataset::Coco19Pose>;

struct TrainArguments {
  std::vector<std::string> datasets;
  std::string out;
  double holdout_share = 0.25, holdout_noise_px = 1;
  int baseline_poses = 8192;
  avatar::LiftOptions net;
  avatar::LiftSampleOptions samples;
};

struct ApplyArguments {
  stages::CalibReadOptions read;
  stages::PoseChanges changes;
  std::string pose2d, lifter, calib, camera, out, skeleton = "body25", truth, marker_unit;
  double rate_hz = 0;
  double height_m = 0, min_score = 0.2, smooth = 0;
  int stride = 1;
  bool level = true;
};

ordered_json ToJson(const LiftScore& s) {
  return {{"frames", s.frames},
          {"mpjpe_mm", FiniteOrNull(s.mpjpe_mm)},
          {"scaled_mpjpe_mm", FiniteOrNull(s.scaled_mpjpe_mm)},
          {"procrustes_mpjpe_mm", FiniteOrNull(s.procrustes_mpjpe_mm)},
          {"root_mm", FiniteOrNull(s.root_mm)},
          {"acceleration_mm", FiniteOrNull(s.acceleration_mm)},
          {"true_acceleration_mm", FiniteOrNull(s.true_acceleration_mm)}};
}

std::string ToText(const std::string& name, const LiftScore& s) {
  return Format("  %-12s joints %.1f mm, after Procrustes %.1f mm, place %.0f mm, acceleration %.1f mm (true %.1f)\n",
                name.c_str(), s.mpjpe_mm, s.procrustes_mpjpe_mm, s.root_mm, s.acceleration_mm, s.true_acceleration_mm);
}

/// The last `share` of the frames.
std::vector<int> LastFrames(const dataset::PanopticDataset& data, double share) {
  const auto count = static_cast<long>(std::lround(share * static_cast<double>(data.frames.size())));
  return {data.frames.end() - count, data.frames.end()};
}

struct TrainingData {
  std::vector<dataset::PanopticDataset> datasets;
  std::vector<std::vector<int>> held_out;
  std::vector<avatar::LiftSequence> sequences;
  int frames = 0;
};

TrainingData ReadTrainingData(const TrainArguments& arguments, CommandResult* result) {
  TrainingData data;
  for (const std::string& root : arguments.datasets) {
    data.datasets.push_back(dataset::OpenPanopticDataset(root));
    data.held_out.push_back(LastFrames(data.datasets.back(), arguments.holdout_share));
    for (avatar::LiftSequence& s : avatar::LiftSequences(data.datasets.back(), data.held_out.back())) {
      data.frames += static_cast<int>(s.middle.size());
      data.sequences.push_back(std::move(s));
    }
    result->inputs.push_back(root);
  }
  if (data.sequences.empty()) {
    throw FormatError(arguments.datasets[0], "hdPose3d_stage1_coco19",
                      "no frame shows the hips, neck, knees and ankles of a person: nothing to learn from");
  }
  return data;
}

double MeanSize(const std::vector<avatar::LiftSequence>& sequences) {
  double sum = 0, count = 0;
  for (const avatar::LiftSequence& s : sequences) {
    sum += s.size_m * static_cast<double>(s.middle.size()), count += static_cast<double>(s.middle.size());
  }
  return sum / count;
}

void AddComparison(const LiftComparison& c, const std::string& what, ordered_json* json, CommandResult* result) {
  *json = {{"lifter", ToJson(c.lifter)}, {"mean_pose", ToJson(c.mean_pose)}, {"nearest_neighbour", ToJson(c.nearest)}};
  result->text += what + ":\n" + ToText("lifter", c.lifter) + ToText("mean pose", c.mean_pose) + ToText("nearest", c.nearest);
  if (c.lifter.mpjpe_mm < c.mean_pose.mpjpe_mm && c.lifter.mpjpe_mm < c.nearest.mpjpe_mm) return;
  result->warnings.push_back({"LIFT-BELOW-BASELINE",
                              what + ": the lifter does not beat the mean pose and the nearest known pose",
                              "train longer (--steps) or with more motions"});
}

/// On all datasets together and, where there are several, on each; returns the standard deviation of a coordinate, metres.
double ScoreHeldOut(const TrainingData& data, const avatar::Lifter& lifter, const TrainArguments& arguments, uint64_t seed,
                    CommandResult* result) {
  const avatar::LiftBaselines baselines(data.sequences, arguments.samples, arguments.baseline_poses, seed);
  std::vector<const dataset::PanopticDataset*> datasets;
  for (const dataset::PanopticDataset& d : data.datasets) datasets.push_back(&d);
  const LiftComparison all = CompareOnHeldOut(lifter, baselines, datasets, data.held_out, arguments.holdout_noise_px, seed);
  AddComparison(all, "held-out frames", &result->metrics["holdout"], result);
  for (size_t i = 0; i < datasets.size() && datasets.size() > 1; ++i) {
    const LiftComparison one =
        CompareOnHeldOut(lifter, baselines, {datasets[i]}, {data.held_out[i]}, arguments.holdout_noise_px, seed);
    ordered_json& json = result->metrics["per_dataset"].emplace_back(ordered_json{{"dataset", arguments.datasets[i]}});
    AddComparison(one, arguments.datasets[i], &json["holdout"], result);
  }
  return all.sigma_m;
}

CommandResult RunTrain(const TrainArguments& arguments, CommandContext& context) {
  Validate(arguments.net);
  Validate(arguments.samples);
  if (!(arguments.holdout_share >= 0 && arguments.holdout_share <= 0.9)) throw UsageError("--holdout-share must be 0 to 0.9");
  if (!(arguments.holdout_noise_px >= 0)) throw UsageError("--holdout-noise-px must be 0 or more");
  CommandResult result;
  const OutputFiles place({arguments.out}, arguments.datasets);
  const TrainingData data = ReadTrainingData(arguments, &result);
  avatar::Lifter lifter = avatar::MakeLifter(arguments.net, context.run.seed);
  lifter.size_m = MeanSize(data.sequences);
  const auto sampler = avatar::SamplerOf(data.sequences, arguments.samples, context.run.seed);
  const avatar::LiftReport report = avatar::TrainLifter(sampler, context.run, &lifter);
  result.metrics = {
      {"people", data.sequences.size()}, {"frames", data.frames}, {"steps", report.steps_done}, {"size_m", lifter.size_m}};
  result.metrics["losses"] = ordered_json::array();
  for (const auto& [step, loss] : report.losses) result.metrics["losses"].push_back({step, loss});
  result.text = Format("lifter: %d steps on %d poses of %d people\n", report.steps_done, data.frames,
                       static_cast<int>(data.sequences.size()));
  if (arguments.holdout_share > 0) {
    lifter.sigma_m = ScoreHeldOut(data, lifter, arguments, context.run.seed, &result);
  }
  avatar::SaveLifter(lifter, arguments.out);
  result.outputs.push_back({arguments.out, "lifter"});
  if (report.status != Status::kOk) {
    result.exit = kExitIllPosed;
    result.errors.push_back({"LIFT-NONFINITE", "the loss is not finite after step " + std::to_string(report.steps_done),
                             "train again with a smaller --learning-rate"});
  }
  return result;
}

/// The surest person of a picture.
const dataset::Person2d* Surest(const std::vector<dataset::Person2d>& people) {
  const dataset::Person2d* best = nullptr;
  double most = 0;
  for (const dataset::Person2d& person : people) {
    double sum = 0;
    for (const dataset::Keypoint2d& k : person.keypoints) sum += k.score;
    if (!best || sum > most) best = &person, most = sum;
  }
  return best;
}

/// Every frame from the first to the last; those without a person have no joints.
std::map<int, avatar::LiftView> ReadViews(const ApplyArguments& arguments, const geometry::Rig& rig,
                                          const geometry::Camera& camera, CommandResult* result) {
  const geometry::Skeleton skeleton = geometry::SkeletonFrom(arguments.skeleton);
  std::vector<dataset::Pose2dTrack> tracks = {dataset::ReadPose2d(arguments.pose2d, arguments.camera, skeleton)};
  LimitFrames(arguments.changes, &tracks, result);
  ApplyChanges(arguments.changes, rig, skeleton, &tracks);
  if (tracks.empty()) throw UsageError("--without-camera " + arguments.camera + ": it is the only one here");
  const geometry::Projector projector(camera);
  std::map<int, avatar::LiftView> views;
  for (const auto& [frame, people] : tracks[0].frames) {
    avatar::LiftView& view = views[frame];
    const dataset::Person2d* found = Surest(people);
    if (!found) continue;
    dataset::Person2d person = *found;
    for (dataset::Keypoint2d& k : person.keypoints) {
      if (k.score < arguments.min_score) k.score = 0;
    }
    view = avatar::ViewOf(projector, person, skeleton);
  }
  return views;
}

Truth ReadTruth(const std::string& path, const std::string& marker_unit) {
  Truth truth;
  for (const auto& [frame, people] : stages::ReadCoco19Poses(path, marker_unit)) {
    if (!people.empty()) truth[frame] = people.begin()->second;
  }
  if (truth.empty()) throw FormatError(path, "", "--truth holds nobody");
  return truth;
}

double SizeFor(const ApplyArguments& arguments, const avatar::Lifter& lifter) {
  if (arguments.height_m < 0 || arguments.height_m > 3) throw UsageError("--height-m must be 0 to 3");
  return arguments.height_m > 0 ? avatar::kSizePerHeight * arguments.height_m : lifter.size_m;
}

/// Counts by status; what was refused becomes a warning and makes the result partial, or ill-posed when nothing is left.
void AddStatuses(const std::map<int, LiftedFrame>& frames, CommandResult* result) {
  std::map<std::string, int> counts;
  std::vector<double> rms;
  std::string first;
  for (const auto& [number, frame] : frames) {
    ++counts[std::string(ToString(frame.status))];
    if (frame.status == Status::kOk) rms.push_back(frame.rms_px);
    if (frame.status != Status::kOk && first.empty()) {
      first = "frame " + std::to_string(number) + ": " + std::string(ToString(frame.status));
    }
  }
  result->metrics["frames"] = frames.size();
  result->metrics["lifted"] = rms.size();
  result->metrics["status_counts"] = counts;
  result->metrics["median_rms_px"] = FiniteOrNull(UpperMedian(rms));
  if (rms.size() == frames.size()) return;
  const std::string text = std::to_string(frames.size() - rms.size()) + " of " + std::to_string(frames.size()) +
                           " frames could not be lifted; the first: " + first;
  const std::string hint = "TooFewViews: fewer than 6 joints of the 19 were seen; look at the 2D poses and --min-score";
  result->exit = rms.empty() ? kExitIllPosed : kExitPartial;
  (rms.empty() ? result->errors : result->warnings).push_back({"LIFT-FRAMES", text, hint});
}

CommandResult RunApply(const ApplyArguments& arguments, CommandContext&) {
  if (!(arguments.smooth >= 0 && arguments.smooth <= 100)) throw UsageError("--smooth must be 0 to 100");
  if (arguments.stride < 1) throw UsageError("--stride must be 1 or more");
  const avatar::Lifter lifter = avatar::LoadLifter(arguments.lifter);
  if (arguments.rate_hz != 0 && !dataset::IsFrameRate(arguments.rate_hz))
    throw UsageError(std::string("--frame-rate ") + dataset::kFrameRates);
  const calib::ImportedRig imported = stages::ReadCalibrationFiles({arguments.calib}, arguments.read);
  const geometry::Rig& rig = imported.rig;
  const int index = rig.Find(arguments.camera);
  if (index < 0) {
    throw UsageError("--camera " + arguments.camera + " is not in " + arguments.calib + "; it has " +
                     Join(geometry::CameraNames(rig), ", "));
  }
  const geometry::RigCamera& camera = rig.cameras[static_cast<size_t>(index)];
  const double size_m = SizeFor(arguments, lifter);
  CommandResult result;
  result.inputs = {arguments.pose2d, arguments.lifter, arguments.calib};
  stages::AddNotes(imported.notes, &result);
  const OutputFolder place(arguments.out, result.inputs, {"points.csv", "covariance.csv", "pose3d.json"});
  std::optional<Eigen::Vector3d> up;
  if (arguments.level) up = camera.cam_from_world.rotation * Eigen::Vector3d::UnitZ();
  const auto inputs = avatar::LiftInputs(ReadViews(arguments, rig, camera.camera, &result), arguments.stride, up);
  auto frames = avatar::LiftTake(lifter, inputs, size_m, PinholeOf(camera.camera).fx());
  avatar::SmoothTake(arguments.smooth, &frames);
  dataset::Pose3d pose = avatar::ToPose3d(frames, camera.cam_from_world, lifter.sigma_m);
  pose.frame_rate_hz = arguments.rate_hz != 0 ? arguments.rate_hz : stages::StepRateHz(arguments.changes);
  WritePose3d(pose, arguments.out);
  result.metrics["size_m"] = size_m;
  result.metrics["rate_hz"] = pose.frame_rate_hz > 0 ? ordered_json(pose.frame_rate_hz) : ordered_json(nullptr);
  AddStatuses(frames, &result);
  result.folder = arguments.out;
  result.outputs.push_back({arguments.out + "/points.csv", "points"});
  result.text = Format("%d of %d frames lifted\n", result.metrics["lifted"].get<int>(), static_cast<int>(frames.size()));
  if (!arguments.truth.empty()) {
    const LiftScore score =
        avatar::ScoreLift({PairsOf(frames, ReadTruth(arguments.truth, arguments.marker_unit), camera.cam_from_world)}, true);
    result.metrics["truth"] = ToJson(score);
    result.text += ToText("against truth", score);
    result.inputs.push_back(arguments.truth);
  }
  return result;
}

void RegisterTrain(CLI::App& lift, Registry& registry) {
  auto a = std::make_shared<TrainArguments>();
  CLI::App* sub = lift.add_subcommand("train", "Learn to lift from the 3D poses of datasets");
  AddOption(sub, "datasets", a->datasets, "dataset folders in Panoptic layout; images are not needed")->required();
  AddOutput(sub, "--out", a->out, OutputKind::kFile, "file for the lifter, .safetensors")->required();
  AddOption(sub, "--holdout-share", a->holdout_share,
            "share of each dataset's frames, its last ones, that is scored in all its cameras and not trained on")
      ->capture_default_str();
  AddOption(sub, "--holdout-noise-px", a->holdout_noise_px, "px; noise of the held-out 2D joints")->capture_default_str();
  AddOption(sub, "--baseline-poses", a->baseline_poses, "known poses in random views that the nearest neighbour is taken from")
      ->capture_default_str()
      ->check(CLI::Range(1, 1000000));
  AddOptions(sub, a->net);
  AddOptions(sub, a->samples);
  registry.Add(sub, "avatar lift train", [a](CommandContext& context) { return RunTrain(*a, context); });
}

void RegisterApply(CLI::App& lift, Registry& registry) {
  auto a = std::make_shared<ApplyArguments>();
  CLI::App* sub = lift.add_subcommand("apply", "2D joints of one camera -> 3D joints");
  AddOption(sub, "pose2d", a->pose2d, "folder of OpenPose JSON files, or a file with the results of a whole video")->required();
  AddOption(sub, "--lifter", a->lifter, "file of `avatar lift train`")->required();
  AddOption(sub, "--calib", a->calib, "calibration; its lens and place of the camera are used")->required();
  AddOption(sub, "--camera", a->camera, "name of the camera in --calib")->required();
  AddOutput(sub, "--out", a->out, OutputKind::kFolder, "folder for points.csv, as triangulate writes it")->required();
  AddOption(sub, "--skeleton", a->skeleton, "of the 2D joints")->capture_default_str();
  AddOption(sub, "--height-m", a->height_m, "m; height of the person, which scales distance and size; 0: as those learned from")
      ->capture_default_str();
  AddOption(sub, "--min-score", a->min_score, "0..1; joints with a lower score count as not seen")->capture_default_str();
  AddOption(sub, "--frame-rate", a->rate_hz, "frames a second, e.g. 60, stated beside the joints for those who read them");
  AddPoseMendingOptions(sub, a->read.invert, a->read.mirror);
  AddOptions(sub, a->changes);
  AddOption(sub, "--stride", a->stride, "frames between the five that are lifted together; 2 for twice the learned frame rate")
      ->capture_default_str();
  AddOption(sub, "--smooth", a->smooth, "frames; standard deviation of a Gaussian over time; 0: every frame by itself")
      ->capture_default_str();
  AddFlag(sub, "--level,!--no-level", a->level, "the calibration's z axis points up; off: the image's upper edge is up")
      ->capture_default_str();
  AddOption(sub, "--truth", a->truth,
            "3D joints to compare with: a dataset, a folder with points.csv or body3DScene_*.json, or a file of markers");
  AddOption(sub, "--marker-unit", a->marker_unit,
            "m, cm, mm, in or the length of one unit, e.g. 25mm: instead of what the file of markers states");
  registry.Add(sub, "avatar lift apply", [a](CommandContext& context) { return RunApply(*a, context); });
}

}  // namespace

void RegisterAvatarLift(CLI::App& avatar, Registry& registry) {
  CLI::App* lift = avatar.add_subcommand("lift", "3D joints from video of a single camera");
  lift->require_subcommand(1);
  RegisterTrain(*lift, registry);
  RegisterApply(*lift, registry);
}

}  // namespace mvstudio::cli
