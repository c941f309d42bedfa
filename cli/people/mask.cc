#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>

#include "cli/program/commands.h"
#include "cli/program/input_flags.h"
#include "cli/program/options.h"
#include "cli/program/output_guard.h"
#include "core/disk/files.h"
#include "core/disk/output.h"
#include "core/error.h"
#include "core/format.h"
#include "core/join.h"
#include "dataset/footage/image_io.h"
#include "stages/nets/mask_input.h"

namespace mvstudio::cli {
namespace {

using nlohmann::ordered_json;

std::string Percent(double share) { return Format("%.1f %%", 100 * share); }

ordered_json TrialMetrics(const stages::MaskTrial& trial) {
  ordered_json json = {{"backend", trial.name}, {"status", std::string(ToString(trial.status))}};
  if (!trial.failed_camera.empty()) json["failed_camera"] = trial.failed_camera;
  json["disagreement_with_hull"] = FiniteOrNull(trial.disagreement);
  json["joints_supported"] = FiniteOrNull(trial.joints_supported);
  return json;
}

std::string WhyText(const stages::MaskTrial& trial) {
  if (!trial.failed_camera.empty())
    return trial.name + " cannot tell people from background (camera " + trial.failed_camera + ")";
  std::string text = trial.name;
  if (std::isfinite(trial.disagreement)) text += " disagrees with the visual hull by " + Percent(trial.disagreement);
  if (std::isfinite(trial.joints_supported)) {
    text += std::string(std::isfinite(trial.disagreement) ? ", its" : "'s") + " colours support " +
            Percent(trial.joints_supported) + " of the joints";
  }
  return text;
}

/// The first of the best: colour alone is cheaper and sharper than a net unless that is better by its figures.
size_t Choose(const std::vector<stages::MaskTrial>& trials) {
  constexpr double kClearly = 0.005;
  size_t best = 0;
  for (size_t i = 1; i < trials.size(); ++i) {
    if (trials[i].score() < trials[best].score() - kClearly) best = i;
  }
  return best;
}

/// The backend and what it learned; the reason goes into the metrics.
stages::MaskTrial ChooseBackend(const stages::MaskJob& job, const std::vector<stages::MaskBackend>& backends, size_t* chosen,
                                CommandResult* result, const RunContext& run) {
  std::vector<stages::MaskTrial> trials;
  for (const stages::MaskBackend& backend : backends)
    trials.push_back(stages::TryBackend(job, backend, backends.size() > 1, run));
  *chosen = Choose(trials);
  stages::MaskTrial& best = trials[*chosen];
  if (!best.failed_camera.empty()) return std::move(best);
  const std::string why = Join(trials, "; ", WhyText);
  result->metrics["backend"] = best.name;
  if (trials.size() > 1) {
    result->metrics["backend_reason"] = why;
    result->metrics["trials"] = ordered_json::array();
    for (const stages::MaskTrial& trial : trials) result->metrics["trials"].push_back(TrialMetrics(trial));
    result->text += "backend " + best.name + ": " + why + "\n";
  }
  return std::move(best);
}

ordered_json CameraMetrics(const stages::MaskCamera& camera, const stages::MaskCameraResult& r,
                           const dataset::HullSummary& hull, size_t c) {
  const double joints = r.take.joints > 0 ? r.take.joints : std::nan("");
  const dataset::HullAgreement a = hull.Mean(c);
  const bool compared = hull.instants > 0;
  return {{"name", camera.footage.camera},
          {"pictures", r.take.pictures},
          {"empty", r.take.empty},
          {"background_known", r.background_known},
          {"mean_area_fraction", r.take.mean_area_fraction},
          {"flicker", r.take.flicker.Share()},
          {"joints_on_mask", FiniteOrNull(r.take.joints_on_mask / joints)},
          {"joints_supported", FiniteOrNull(r.take.joints_supported / joints)},
          {"mask_outside_hull", FiniteOrNull(compared ? a.outside : std::nan(""))},
          {"hull_outside_mask", FiniteOrNull(compared ? a.missing : std::nan(""))},
          {"hull_blame", FiniteOrNull(compared ? a.blame : std::nan(""))},
          {"ms_per_picture", r.take.ms_per_picture}};
}

void Warn(const stages::MaskJob& job, const stages::MaskRunResult& masks, CommandResult* result) {
  for (const size_t c : masks.disagreeing) {
    const dataset::HullAgreement a = masks.hull.Mean(c);
    result->warnings.push_back(
        {"MSK-HULL",
         "camera " + job.cameras[c].footage.camera + " disagrees with the others: " + Percent(a.outside) +
             " of its masks lie outside the visual hull, " + Percent(a.missing) + " of the others' hull is not in its masks",
         "look at its masks; check its calibration and its time offset"});
  }
  for (size_t c = 0; c < job.cameras.size(); ++c) {
    const stages::MaskCameraResult& r = masks.cameras[c];
    const std::string name = "camera " + job.cameras[c].footage.camera + ": ";
    for (const std::string& line : job.cameras[c].samples.damage) {
      if (result->exit == kExitOk) result->exit = kExitPartial;
      result->warnings.push_back({"MSK-FRAMES", name + line, "copy its footage again; the other frames have masks"});
    }
    if (r.take.empty > 0) {
      result->warnings.push_back(
          {"MSK-EMPTY", name + std::to_string(r.take.empty) + " of " + std::to_string(r.take.pictures) + " masks are empty",
           "is anybody in view? otherwise give joints or another --backend"});
    }
    if (r.background_known < 0.9) {
      result->warnings.push_back({"MSK-BACKGROUND",
                                  name + "the background was seen on only " + Percent(r.background_known) +
                                      " of the image; colours of the surroundings are used elsewhere",
                                  "give a clean plate, or footage in which people move"});
    }
    if (r.take.joints > 0 && r.take.joints_supported < 0.8 * r.take.joints) {
      result->warnings.push_back({"MSK-JOINTS",
                                  name + "only " + Percent(r.take.joints_supported / double(r.take.joints)) +
                                      " of the joints lie where the image shows a person by its colours",
                                  "check the calibration and the time offset of this camera"});
    }
  }
}

void AddTruth(const stages::MaskArguments& arguments, const std::string& folder, CommandResult* result) {
  if (arguments.truth.empty()) return;
  ordered_json list = ordered_json::array();
  double sum = 0, worst = 1;
  int pictures = 0;
  std::string worst_picture;
  for (const auto& [camera, path] : arguments.truth) {
    stages::TruthScore score = stages::CompareWithTruth(path, folder, camera);
    if (!score.worst_picture.empty()) score.worst_picture = arguments.out + score.worst_picture.substr(folder.size());
    const double n = std::max(1, score.pictures);
    if (score.from_one) {
      result->warnings.push_back({"MSK-TRUTH",
                                  "camera " + camera +
                                      ": exact masks are numbered 1 to N and the N frames 0 to N - 1: exact mask "
                                      "1 was compared with frame 0",
                                  "number exact masks as frames, from 0, and nothing is said"});
    }
    if (score.pictures == 0) {
      result->warnings.push_back({"MSK-TRUTH",
                                  "camera " + camera + ": no mask of " + path + " has the number of one of its frames",
                                  "names must end in the frame's number"});
    }
    list.push_back({{"name", camera},
                    {"pictures", score.pictures},
                    {"missing", score.missing},
                    {"mean_iou", score.iou_sum / n},
                    {"worst_iou", score.worst},
                    {"worst_picture", score.worst_picture},
                    {"too_much_px", score.too_much_px / n},
                    {"too_little_px", score.too_little_px / n}});
    sum += score.iou_sum, pictures += score.pictures;
    if (score.pictures > 0 && score.worst <= worst) worst = score.worst, worst_picture = score.worst_picture;
  }
  if (pictures == 0) {
    result->exit = kExitQualityGate;
    result->errors.push_back(
        {"MSK-TRUTH", "not one mask was compared with an exact one", "--truth CAMERA=FOLDER, named by frame"});
    return;
  }
  result->metrics["truth"] = {{"pictures", pictures},
                              {"mean_iou", FiniteOrNull(pictures ? sum / pictures : std::nan(""))},
                              {"worst_iou", worst},
                              {"worst_picture", worst_picture}};
  result->metrics["truth_cameras"] = list;
  result->text += Format("against exact masks: mean IoU %.4f over %d images, worst %.4f (%s)\n",
                         pictures ? sum / pictures : 0.0, pictures, worst, worst_picture.c_str());
}

/// Joints that were given and guided no mask of a camera, or of any.
void WarnOfJoints(const stages::MaskArguments& arguments, const stages::MaskJob& job, const stages::MaskRunResult& masks,
                  CommandResult* result) {
  const bool posed = !arguments.pose3d.empty();
  if (!posed && arguments.pose2d.empty()) return;
  std::vector<std::string> without;
  for (size_t c = 0; c < job.cameras.size(); ++c) {
    if (masks.cameras[c].take.joints == 0) without.push_back(job.cameras[c].footage.camera);
  }
  if (without.empty()) return;
  const std::string given = posed ? "--pose3d" : "--pose2d", names = Join(without, ", ");
  const char* hint = "frame numbers of joints and footage must be the same, and the calibration that of these cameras";
  if (without.size() < job.cameras.size()) {
    result->warnings.push_back({"MSK-NO-JOINTS", "no joint of " + given + " lies in an image of " + names, hint});
    return;
  }
  std::string frames;
  if (!job.poses.empty())
    frames = Format(" (joints are of frames %d to %d)", job.poses.begin()->first, job.poses.rbegin()->first);
  result->exit = kExitQualityGate;
  result->errors.push_back(
      {"MSK-NO-JOINTS", "no joint of " + given + frames + " lies in an image of the footage: they guided no mask", hint});
}

/// Sheets, figures and warnings into the result; `folder` is where the masks are now.
void Report(const stages::MaskArguments& arguments, const stages::MaskJob& job, const stages::MaskRunResult& masks,
            const std::string& folder, CommandResult* result) {
  double area = 0, flicker = 0, ms = 0;
  int pictures = 0;
  ordered_json per_camera = ordered_json::array();
  for (size_t c = 0; c < job.cameras.size(); ++c) {
    const stages::MaskCameraResult& r = masks.cameras[c];
    const std::string& name = job.cameras[c].footage.camera;
    pictures += r.take.pictures;
    area += r.take.mean_area_fraction, flicker += r.take.flicker.Share(), ms += r.take.ms_per_picture;
    per_camera.push_back(CameraMetrics(job.cameras[c], r, masks.hull, c));
    result->text +=
        Format("  %s: %d masks, person on %.1f %%, flicker %.4f %%, %.0f ms an image\n", name.c_str(), r.take.pictures,
               100 * r.take.mean_area_fraction, 100 * r.take.flicker.Share(), r.take.ms_per_picture);
    if (r.sheet.empty()) continue;
    dataset::WriteImage(r.sheet, folder + "/" + name + ".sheet.png");
    result->outputs.push_back({arguments.out + "/" + name + ".sheet.png", "overlay"});
  }
  const double n = static_cast<double>(job.cameras.size());
  result->metrics["cameras"] = job.cameras.size();
  result->metrics["pictures"] = pictures;
  result->metrics["mean_area_fraction"] = area / n;
  result->metrics["flicker"] = flicker / n;
  result->metrics["ms_per_picture"] = ms / n;
  result->metrics["hull_instants"] = masks.hull.instants;
  if (masks.hull.instants > 0) {
    result->metrics["disagreement_with_hull"] = masks.hull.Disagreement();
    result->text += "disagreement with the visual hull: " + Percent(masks.hull.Disagreement()) + "\n";
  }
  ordered_json named = ordered_json::array();
  for (const size_t c : masks.disagreeing) named.push_back(job.cameras[c].footage.camera);
  result->metrics["disagreeing_cameras"] = named;
  result->metrics["per_camera"] = per_camera;
  Warn(job, masks, result);
  const auto is_empty = [](const stages::MaskCameraResult& r) { return r.take.empty == r.take.pictures; };
  if (std::all_of(masks.cameras.begin(), masks.cameras.end(), is_empty)) {
    result->exit = kExitQualityGate;
    result->errors.push_back({"MSK-NOBODY", "every mask of every camera is empty: nobody was found",
                              "is anybody in view? otherwise give joints, a clean --plate, or another --backend"});
  }
  WarnOfJoints(arguments, job, masks, result);
  AddTruth(arguments, folder, result);
}

/// What the session gives where no flag does.
void FillFromSession(const stages::TakeInput& take, stages::MaskArguments* arguments) {
  if (arguments->out.empty()) arguments->out = take.Folder("masks");
  if (arguments->out.empty()) throw UsageError("--out is needed without --session");
  const std::string joints = take.Folder("pose3d");
  const bool given = !arguments->pose3d.empty() || !arguments->pose2d.empty();
  if (!given && !joints.empty() && std::filesystem::exists(joints + "/points.csv")) arguments->pose3d = joints;
}

CommandResult RunMask(stages::MaskArguments arguments, CommandContext& context) {
  const auto start = std::chrono::steady_clock::now();
  CommandResult result;
  stages::TakeInput take = stages::ReadTakeInput(arguments.take, &result);
  stages::LeaveOutUncalibrated(arguments.calib.empty() ? take.calibration : arguments.calib, &take, &result);
  FillFromSession(take, &arguments);
  AtomicFolder folder(arguments.out, arguments.run.overwrite,
                      Joined(Joined(PathsOf(take.footage), PathsIn(arguments.pose2d)), {arguments.pose3d, arguments.calib}));
  const std::vector<stages::MaskBackend> backends = stages::MaskBackends(arguments, &result);
  const stages::MaskJob job = stages::ReadMaskJob(arguments, take, &result, context.run);
  size_t chosen = 0;
  const stages::MaskTrial trial = ChooseBackend(job, backends, &chosen, &result, context.run);
  if (!trial.failed_camera.empty()) {
    result.exit = kExitIllPosed;
    result.errors.push_back({"MSK-NOBODY",
                             "camera " + trial.failed_camera +
                                 ": nothing separates people from background: no joints, no motion and, where a net was tried, "
                                 "no person found by it",
                             "give joints (--pose2d, or --calib and --pose3d), a clean --plate, or --backend selfie"});
    return result;
  }
  const stages::MaskRunResult masks = stages::RunMasks(job, backends[chosen], trial.models, folder.work_path(), context.run);
  Report(arguments, job, masks, folder.work_path(), &result);
  folder.Commit();
  result.metrics["wall_s"] = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  result.outputs.insert(result.outputs.begin(), {arguments.out, "masks"});
  result.folder = arguments.out;
  return result;
}

}  // namespace

void RegisterMask(CLI::App& app, Registry& registry) {
  auto arguments = std::make_shared<stages::MaskArguments>();
  CLI::App* sub = app.add_subcommand("mask", "Foreground masks of people, with their quality");
  AddOptions(sub, arguments->take);
  StartGroup(sub, "Calibration and joints");
  AddOption(sub, "--calib", arguments->calib,
            "calibration file: ours, Panoptic's, or any that calib convert reads; masks are compared across cameras");
  AddPoseMendingOptions(sub, arguments->read.invert, arguments->read.mirror);
  AddOption(
      sub, "--pose3d", arguments->pose3d,
      "3D joints that guide the masks: a folder with points.csv or body3DScene_*.json, a dataset, or a file of markers; the "
      "session's pose3d/TAKE where it is there");
  AddOption(sub, "--marker-unit", arguments->marker_unit,
            "m, cm, mm, in or the length of one unit, e.g. 25mm: instead of what the file of markers states");
  AddChoices(sub, "--pose2d", arguments->pose2d, "CAMERA=FOLDER of OpenPose JSON files, instead of --pose3d");
  AddOption(sub, "--skeleton", arguments->skeleton, "of the 2D joints, a name or a file FILE.toml")->capture_default_str();
  AddOptions(sub, arguments->changes);
  StartGroup(sub, "Output");
  AddOutput(sub, "--out", arguments->out, OutputKind::kFolder, "new folder; the session's masks/TAKE unless given");
  AddOptions(sub, arguments->run);
  StartGroup(sub, "Backend");
  AddOption(sub, "--backend", arguments->backend,
            "background (what the images show without people), selfie (a small net), onnx:FILE, or auto: the one whose "
            "masks agree best with the visual hull and the joints")
      ->capture_default_str();
  AddChoices(sub, "--truth", arguments->truth, "CAMERA=FOLDER of exact masks to compare with");
  AddOptions(sub, arguments->onnx);
  StartGroup(sub, "Background");
  AddOptions(sub, arguments->mask);
  StartGroup(sub, "Visual hull");
  AddOptions(sub, arguments->hull);
  registry.Add(sub, "mask", [arguments](CommandContext& context) { return RunMask(*arguments, context); });
}

}  // namespace mvstudio::cli
