#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>

#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "cli/program/output_guard.h"
#include "core/choice/frame_choice.h"
#include "core/disk/files.h"
#include "core/disk/output.h"
#include "core/error.h"
#include "core/format.h"
#include "core/text/shell_word.h"
#include "dataset/footage/image_io.h"
#include "geometry/skeleton/skeleton_text.h"
#include "stages/frame_notice.h"
#include "stages/input/calib_read.h"
#include "stages/input/take_input.h"
#include "stages/nets/pose2d_detect.h"
#include "stages/nets/pose2d_existing.h"
#include "stages/people/pose2d_quality.h"

namespace mvstudio::cli {
namespace {

using dataset::Pose2dTrack;
using nlohmann::ordered_json;

struct Arguments {
  stages::TakeArguments take;
  std::string backend = "auto", calib, out, models, skeleton = "body25", frames;
  int trial_frames = 16, overlays = 2, every = 1;
  bool overwrite = false;
  detect::PoseOptions options;
  detect::OnnxOptions onnx;
};

/// What was detected, and by what.
struct Detected {
  std::string backend;
  geometry::Skeleton skeleton;
  std::vector<stages::CameraPoses> cameras;
  stages::PoseAgreement agreement;
};

std::vector<Pose2dTrack> TracksOf(const std::vector<stages::CameraPoses>& cameras) {
  std::vector<Pose2dTrack> tracks;
  for (const stages::CameraPoses& camera : cameras) tracks.push_back(camera.track);
  return tracks;
}

/// The backend whose key points agree best on frames spread over the take.
std::string ChooseBackend(const Arguments& arguments, const stages::DetectJob& job, const geometry::Rig& rig,
                          const RunContext& run, CommandResult* result) {
  const std::vector<std::string> names = stages::InstalledPoseBackends(arguments.models);
  if (rig.cameras.size() < 2 || job.footage.size() < 2 || names.size() < 2) return names[0];
  stages::DetectJob trial = job;
  trial.overlays = 0;
  trial.max_frames = arguments.trial_frames;
  trial.every = std::max(arguments.every, stages::FramesOf(job.footage[0]) / std::max(1, arguments.trial_frames));
  std::string best = names[0];
  double lowest = std::numeric_limits<double>::infinity();
  result->metrics["trials"] = ordered_json::array();
  for (const std::string& name : names) {
    const stages::PoseBackend backend =
        stages::OpenPoseBackend(name, arguments.models, arguments.options.quality, arguments.onnx);
    const stages::PoseAgreement agreement = stages::MeasureAgreement(
        TracksOf(stages::DetectPoses(trial, backend, run)), backend.net->skeleton(), rig, arguments.options.max_persons, run);
    result->metrics["trials"].push_back({{"backend", name},
                                         {"median_px", FiniteOrNull(agreement.median_px)},
                                         {"p90_px", FiniteOrNull(agreement.p90_px)},
                                         {"share_ok", agreement.share_ok}});
    if (agreement.median_px < lowest) lowest = agreement.median_px, best = name;
  }
  return best;
}

Detected Detect(const Arguments& arguments, const stages::DetectJob& job, const geometry::Rig& rig, const RunContext& run,
                CommandResult* result) {
  const std::string name = arguments.backend == "auto" ? ChooseBackend(arguments, job, rig, run, result) : arguments.backend;
  const stages::PoseBackend backend =
      stages::OpenPoseBackend(name, arguments.models, arguments.options.quality, arguments.onnx);
  return {name, backend.net->skeleton(), stages::DetectPoses(job, backend, run), {}};
}

void AddCamera(const stages::CameraPoses& camera, CommandResult* result) {
  double sum = 0;
  int joints = 0;
  for (const auto& [frame, people] : camera.track.frames) {
    for (const dataset::Person2d& person : people) {
      for (const dataset::Keypoint2d& joint : person.keypoints) sum += joint.score, ++joints;
    }
  }
  ordered_json json{
      {"name", camera.track.camera}, {"frames", camera.frames}, {"frames_with_people", camera.frames_with_people}};
  json["mean_score"] = joints ? sum / joints : 0;
  json["frames_per_s"] = camera.seconds > 0 ? ordered_json(camera.frames / camera.seconds) : ordered_json(nullptr);
  result->metrics["cameras"].push_back(json);
  if (!camera.failure.empty()) {
    result->exit = kExitPartial;
    result->warnings.push_back({"POSE-CAMERA", camera.track.camera + ": " + camera.failure, "the other cameras were done"});
  }
  const bool nothing = camera.failure.empty() && camera.frames == 0;
  if (nothing) {
    result->exit = kExitPartial;
    result->warnings.push_back({"POSE-CAMERA",
                                camera.track.camera + " gives nothing: " +
                                    (!camera.damage.empty()   ? camera.damage.front()
                                     : camera.numbers.empty() ? "its footage has no frame"
                                                              : "it has none of the frames that were asked for"),
                                "copy its footage again; the other cameras were done"});
    return;
  }
  for (const std::string& line : camera.damage) {
    result->exit = kExitPartial;
    result->warnings.push_back({"POSE-FRAMES", camera.track.camera + ": " + line, "the other frames were used"});
  }
  if (camera.failure.empty() && camera.frames_with_people * 10 < camera.frames) {
    result->warnings.push_back({"POSE-NOBODY",
                                camera.track.camera + ": somebody is seen in " + std::to_string(camera.frames_with_people) +
                                    " of " + std::to_string(camera.frames) + " frames",
                                "look at the overlay images; try another --backend"});
  }
}

/// Footage of another size than the calibration: key points are in the footage's pixels.
void CheckSizes(const std::vector<stages::CameraPoses>& cameras, const geometry::Rig& rig, CommandResult* result) {
  for (const stages::CameraPoses& camera : cameras) {
    const int idx = rig.Find(camera.track.camera);
    if (idx < 0 || camera.width == 0) continue;
    const geometry::Camera& lens = rig.cameras[static_cast<size_t>(idx)].camera;
    if (lens.width_px == camera.width && lens.height_px == camera.height) continue;
    result->warnings.push_back(
        {"POSE-SIZE",
         camera.track.camera + ": the footage has " + std::to_string(camera.width) + " x " + std::to_string(camera.height) +
             " pixels, the calibration " + std::to_string(lens.width_px) + " x " + std::to_string(lens.height_px),
         "keypoints are in the footage's pixels; triangulating them with this calibration costs that "
         "difference: mvstudio calib "
         "resize --camera-size " +
             ShellWord(camera.track.camera + "=" + std::to_string(camera.width) + "x" + std::to_string(camera.height)) +
             " brings its lens to them"});
  }
}

std::string OverlayPath(const std::string& out, const stages::CameraPoses& camera, int frame) {
  return out + "/overlay/" + camera.track.camera + Format("_%08d.jpg", frame);
}

void Write(const Detected& detected, AtomicFolder& folder) {
  for (const stages::CameraPoses& camera : detected.cameras) {
    if (camera.track.frames.empty()) continue;
    const std::string path = folder.work_path() + "/" + camera.track.camera;
    dataset::WriteOpenPoseFolder(camera.track, path, &detected.skeleton);
    for (const auto& [frame, picture] : camera.overlays) {
      MakeFolder(folder.work_path() + "/overlay");
      dataset::WriteImage(picture, OverlayPath(folder.work_path(), camera, frame), 90);
    }
  }
  WriteFileAtomic(folder.work_path() + "/skeleton.json", SkeletonToJson(detected.skeleton) + "\n");
  folder.Commit();
}

std::string Summary(const Detected& detected, const std::string& out) {
  int frames = 0, with_people = 0;
  double seconds = 0;
  for (const stages::CameraPoses& camera : detected.cameras)
    frames += camera.frames, with_people += camera.frames_with_people, seconds += camera.seconds;
  std::string text =
      Format("%s: people in %d of %d images, %.2f s an image and thread; skeleton %s, in %s", detected.backend.c_str(),
             with_people, frames, frames ? seconds / frames : 0, detected.skeleton.name.c_str(), out.c_str());
  if (detected.agreement.json.empty() || !std::isfinite(detected.agreement.median_px)) return text;
  return text + Format("\none camera left out: median %.2f px, p90 %.2f px; %.1f %% of the joints triangulated",
                       detected.agreement.median_px, detected.agreement.p90_px, 100 * detected.agreement.share_ok);
}

geometry::Rig ReadRig(const std::string& path, CommandResult* result) {
  if (path.empty()) return {};
  result->inputs.push_back(path);
  const calib::ImportedRig imported = stages::ReadCalibrationFiles({path}, {});
  stages::AddNotes(imported.notes, result);
  return imported.rig;
}

/// All went wrong: the first camera's reason.
void CheckAnything(const Detected& detected, CommandResult* result) {
  const auto failed = [](const stages::CameraPoses& c) { return !c.failure.empty(); };
  const auto& cameras = detected.cameras;
  if (std::all_of(cameras.begin(), cameras.end(), failed))
    throw FormatError(cameras.empty() ? "" : cameras[0].failure, "", "no camera's footage could be used");
  if (std::all_of(cameras.begin(), cameras.end(), [](const stages::CameraPoses& c) { return c.frames == 0; }))
    throw FormatError(cameras[0].track.camera, "", "no camera's footage gives a single frame");
  const auto seen = [](const stages::CameraPoses& c) { return c.frames_with_people > 0; };
  if (std::any_of(cameras.begin(), cameras.end(), seen)) return;
  result->exit = kExitQualityGate;
  result->errors.push_back(
      {"POSE-NOBODY", "nobody was found in any image", "look at the overlay images; try another --backend"});
}

/// Keypoints of which no camera's are explained by the others' are no result.
void CheckAgreement(const stages::PoseAgreement& agreement, CommandResult* result) {
  if (agreement.share_ok > 0 || result->exit == kExitQualityGate) return;
  result->exit = kExitQualityGate;
  result->errors.push_back({"POSE-NO-AGREEMENT", "not one joint could be triangulated: the cameras' keypoints agree on nothing",
                            "is the calibration of these cameras, and was the footage taken at the same time?"});
}

/// Leaves out what was not asked for, and says what is not there. Throws what KnownFrames does.
void LimitToFrames(const std::vector<int>& asked, std::vector<stages::CameraPoses>* cameras, CommandResult* result) {
  std::vector<int> there;
  for (stages::CameraPoses& camera : *cameras) {
    if (camera.numbers.empty()) {
      for (const auto& [frame, people] : camera.track.frames) camera.numbers.push_back(frame);
    }
    there.insert(there.end(), camera.numbers.begin(), camera.numbers.end());
  }
  const auto failed = [](const stages::CameraPoses& c) { return !c.failure.empty(); };
  if (asked.empty() || std::all_of(cameras->begin(), cameras->end(), failed)) return;
  const FrameChoice choice = KnownFrames("--frames", asked, std::move(there), "the footage");
  stages::TellFrames(choice.beyond, result);
  for (stages::CameraPoses& camera : *cameras) {
    auto& frames = camera.track.frames;
    const size_t before = frames.size();
    for (auto it = frames.begin(); it != frames.end();)
      it = std::binary_search(choice.frames.begin(), choice.frames.end(), it->first) ? std::next(it) : frames.erase(it);
    if (frames.size() == before) continue;
    const auto seen = [](const auto& frame) { return !frame.second.empty(); };
    camera.frames = static_cast<int>(frames.size());
    camera.frames_with_people = static_cast<int>(std::count_if(frames.begin(), frames.end(), seen));
  }
}

CommandResult Pose2d(const Arguments& arguments, const RunContext& run) {
  CommandResult result;
  const bool existing = arguments.backend.rfind("openpose:", 0) == 0;
  const stages::TakeInput take = stages::ReadTakeInput(arguments.take, &result);
  if (take.footage.empty() && !existing) throw UsageError("no footage: give --video or --images for each camera, or --session");
  const geometry::Rig rig = ReadRig(arguments.calib.empty() ? take.calibration : arguments.calib, &result);
  const std::string out = arguments.out.empty() ? take.Folder("pose2d") : arguments.out;
  if (out.empty()) throw UsageError("--out is needed without --session");
  const std::string given = existing ? arguments.backend.substr(arguments.backend.find(':') + 1) : "";
  AtomicFolder folder(out, arguments.overwrite, Joined(PathsOf(take.footage), {given, arguments.calib, arguments.skeleton}));
  std::vector<int> frames;
  if (!arguments.frames.empty()) frames = ParseRanges("--frames", arguments.frames);
  Detected detected;
  if (existing) {
    detected.backend = arguments.backend;
    detected.skeleton = geometry::SkeletonFrom(arguments.skeleton);
    if (geometry::IsSkeletonFile(arguments.skeleton)) result.inputs.push_back(arguments.skeleton);
    detected.cameras = stages::ReadExistingPoses(arguments.backend.substr(9), take.footage, detected.skeleton, &result);
  } else {
    detected =
        Detect(arguments, {take.footage, arguments.options, arguments.overlays, arguments.every, 0, frames}, rig, run, &result);
  }
  LimitToFrames(frames, &detected.cameras, &result);
  result.metrics["backend"] = detected.backend;
  result.metrics["skeleton"] = detected.skeleton.name;
  result.metrics["cameras"] = ordered_json::array();
  for (const stages::CameraPoses& camera : detected.cameras) AddCamera(camera, &result);
  CheckAnything(detected, &result);
  CheckSizes(detected.cameras, rig, &result);
  detected.agreement =
      stages::MeasureAgreement(TracksOf(detected.cameras), detected.skeleton, rig, arguments.options.max_persons, run);
  if (!detected.agreement.json.empty()) {
    result.metrics["agreement"] = detected.agreement.json;
    CheckAgreement(detected.agreement, &result);
  }
  Write(detected, folder);
  result.folder = out;
  for (const stages::CameraPoses& camera : detected.cameras) {
    if (!camera.track.frames.empty()) result.outputs.push_back({out + "/" + camera.track.camera, "pose2d"});
    for (const auto& [frame, picture] : camera.overlays) result.outputs.push_back({OverlayPath(out, camera, frame), "overlay"});
  }
  result.text = Summary(detected, out);
  return result;
}

}  // namespace

void RegisterPose2d(CLI::App& app, Registry& registry) {
  auto* sub = app.add_subcommand("pose2d", "Detect 2D keypoints of people; one OpenPose JSON file per camera and frame");
  const auto arguments = std::make_shared<Arguments>();
  arguments->take.with_timeline = false;  // poses are numbered as the footage is; triangulate turns them into instants
  AddOptions(sub, arguments->take);
  AddOutput(sub, "--out", arguments->out, OutputKind::kFolder,
            "folder: CAMERA/%012d_keypoints.json and overlay/ (default with --session: its pose2d/TAKE)");
  AddOption(sub, "--backend", arguments->backend,
            "posenet, movenet or blazepose (with feet; mvstudio models fetch), onnx:FILE (heat maps), openpose:FOLDER "
            "(FOLDER/CAMERA holds "
            "JSON files that are checked and "
            "renumbered), auto: the installed net whose keypoints agree best across cameras (needs --calib)")
      ->capture_default_str();
  AddOption(sub, "--calib", arguments->calib, "calibration: reports how well the cameras agree");
  AddOption(sub, "--models", arguments->models, "folder of the weights; default: as models fetch");
  AddOption(sub, "--skeleton", arguments->skeleton, "openpose: the skeleton of the existing files, a name or a file FILE.toml")
      ->capture_default_str();
  AddOption(sub, "--trial-frames", arguments->trial_frames, "auto: frames on which the nets are compared")
      ->capture_default_str()
      ->check(CLI::Range(4, 10000));
  AddOption(sub, "--overlays", arguments->overlays, "images of each camera to draw the keypoints on")
      ->capture_default_str()
      ->check(CLI::Range(0, 1000));
  AddOption(sub, "--frames", arguments->frames, "80-99 or 1,4,7-9: frames of the footage; all unless given");
  AddOption(sub, "--every", arguments->every, "use every n-th frame of the footage; the others have no keypoints")
      ->capture_default_str()
      ->check(CLI::Range(1, 1000000));
  AddFlag(sub, "--overwrite", arguments->overwrite, "replace the output folder");
  AddOptions(sub, arguments->options);
  AddOptions(sub, arguments->onnx);
  registry.Add(sub, "pose2d", [arguments](CommandContext& context) { return Pose2d(*arguments, context.run); });
}

}  // namespace mvstudio::cli
