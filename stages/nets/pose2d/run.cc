#include "stages/nets/pose2d/run.h"

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <limits>

#include "core/choice/frame_choice.h"
#include "core/disk/files.h"
#include "core/disk/output.h"
#include "core/error.h"
#include "core/format.h"
#include "core/join.h"
#include "dataset/footage/image_io.h"
#include "geometry/rig/rig_io.h"
#include "geometry/skeleton/skeleton_text.h"
#include "stages/frame_notice.h"
#include "stages/input/calib_read.h"
#include "stages/nets/pose2d/budget.h"
#include "stages/nets/pose2d/existing.h"
#include "stages/words.h"

namespace mvstudio::stages {
namespace {

constexpr char kExistingPoses[] = "openpose:";

/// The folder of keypoints that are there; empty: they are to be detected.
std::string ExistingFolder(const Pose2dOptions& options) {
  const bool existing = options.backend.rfind(kExistingPoses, 0) == 0;
  return existing ? options.backend.substr(sizeof(kExistingPoses) - 1) : "";
}

std::vector<dataset::Pose2dTrack> PoseTracks(const std::vector<CameraPoses>& cameras) {
  std::vector<dataset::Pose2dTrack> tracks;
  for (const CameraPoses& camera : cameras) tracks.push_back(camera.track);
  return tracks;
}

PoseBackend OpenNet(const std::string& name, const Pose2dOptions& options) {
  return OpenPoseBackend(name, options.models, options.pose.quality, options.onnx);
}

/// The backend whose keypoints agree best on frames spread over the take.
std::string ChoosePoseBackend(const Pose2dOptions& options, const DetectJob& job, const geometry::Rig& rig,
                              const RunContext& run, std::vector<Pose2dTrial>* trials) {
  const std::vector<std::string> names = InstalledPoseBackends(options.models);
  if (rig.cameras.size() < 2 || job.footage.size() < 2 || names.size() < 2) return names[0];
  DetectJob trial = job;
  trial.overlays = 0;
  trial.cache.kind = CachePlace::Kind::kOff;  // a few frames are not worth reading all footage for its digest
  trial.max_frames = options.trial_frames;
  trial.every = std::max(options.every, FramesOf(job.footage[0]) / std::max(1, options.trial_frames));
  std::string best = names[0];
  double lowest = std::numeric_limits<double>::infinity();
  for (const std::string& name : names) {
    const PoseBackend backend = OpenNet(name, options);
    const std::vector<CameraPoses> cameras = DetectPoses(trial, backend, run);
    trials->push_back(
        {name, MeasureAgreement(PoseTracks(cameras), backend.net->skeleton(), rig, options.pose.max_persons, run)});
    const double median_px = trials->back().agreement.median_px;
    if (median_px < lowest) lowest = median_px, best = name;
  }
  return best;
}

void DetectAll(Pose2dOptions options, DetectJob job, const geometry::Rig& rig, double started_s, const RunContext& run,
               Pose2dReport* report) {
  if (options.budget.Asked()) {
    report->budget = ChooseNet(job, rig, started_s, run, &options);
    job.options = options.pose, job.every = options.every;
  }
  report->backend = options.backend == "auto" ? ChoosePoseBackend(options, job, rig, run, &report->trials) : options.backend;
  const PoseBackend backend = OpenNet(report->backend, options);
  report->skeleton = backend.net->skeleton();
  report->cameras = DetectPoses(job, backend, run);
}

void ReadAll(const Pose2dOptions& options, const TakeInput& take, Pose2dReport* report) {
  report->backend = options.backend;
  report->skeleton = geometry::SkeletonFrom(options.skeleton);
  if (geometry::IsSkeletonFile(options.skeleton)) report->notes.inputs.push_back(options.skeleton);
  report->cameras = ReadExistingPoses(ExistingFolder(options), take.footage, report->skeleton, &report->notes);
}

bool HasFailed(const CameraPoses& camera) { return !camera.failure.empty(); }

/// Leaves out what was not asked for, and says what is not there. Throws what KnownFrames does.
void LimitPoses(const std::vector<int>& asked, std::vector<CameraPoses>* cameras, InputNotes* notes) {
  std::vector<int> there;
  for (CameraPoses& camera : *cameras) {
    if (camera.numbers.empty()) {
      for (const auto& [frame, people] : camera.track.frames) camera.numbers.push_back(frame);
    }
    there.insert(there.end(), camera.numbers.begin(), camera.numbers.end());
  }
  if (asked.empty() || std::all_of(cameras->begin(), cameras->end(), HasFailed)) return;
  const FrameChoice choice = KnownFrames("option 'frames'", asked, std::move(there), "the footage");
  NoteFrames(choice.beyond, notes);
  for (CameraPoses& camera : *cameras) {
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

/// All went wrong: the first camera's reason.
void RequireFrames(const std::vector<CameraPoses>& cameras) {
  if (std::all_of(cameras.begin(), cameras.end(), HasFailed))
    throw FormatError(cameras.empty() ? "" : cameras[0].failure, "", "no camera's footage could be used");
  if (std::all_of(cameras.begin(), cameras.end(), [](const CameraPoses& c) { return c.frames == 0; }))
    throw FormatError(cameras[0].track.camera, "", "no camera's footage gives a single frame");
}

/// Footage of another size than the calibration: keypoints are in the footage's pixels.
std::vector<Pose2dOtherSize> OtherSizes(const std::vector<CameraPoses>& cameras, const geometry::Rig& rig) {
  std::vector<Pose2dOtherSize> sizes;
  for (const CameraPoses& camera : cameras) {
    const int idx = rig.Find(camera.track.camera);
    if (idx < 0 || camera.width == 0) continue;
    const geometry::Camera& lens = rig.cameras[static_cast<size_t>(idx)].camera;
    if (lens.width_px == camera.width && lens.height_px == camera.height) continue;
    sizes.push_back({camera.track.camera, camera.width, camera.height, lens.width_px, lens.height_px});
  }
  return sizes;
}

/// What came of the budget, beside what came of earlier ones in the folder that is replaced.
void KeepBudget(double started_s, AtomicFolder* folder, Pose2dReport* report) {
  BudgetReport& budget = *report->budget;
  budget.actual_error = report->agreement.measured ? report->agreement.median_px : std::nan("");
  budget.actual_s = budget.asked.NowSeconds() - started_s;
  const std::string earlier = report->out + "/" + kPredictionsFile;
  if (std::filesystem::exists(earlier)) WriteFileAtomic(folder->work_path() + "/" + kPredictionsFile, ReadFile(earlier));
  KeepPrediction(budget, folder->work_path());
}

void WritePoses(double started_s, AtomicFolder* folder, Pose2dReport* written) {
  const Pose2dReport& report = *written;
  for (const CameraPoses& camera : report.cameras) {
    if (camera.track.frames.empty()) continue;
    dataset::WriteOpenPoseFolder(camera.track, folder->work_path() + "/" + camera.track.camera, &report.skeleton);
    for (const auto& [frame, image] : camera.overlays) {
      MakeFolder(folder->work_path() + "/overlay");
      dataset::WriteImage(image, Pose2dOverlayPath(folder->work_path(), camera.track.camera, frame), 90);
    }
  }
  WriteFileAtomic(folder->work_path() + "/skeleton.json", SkeletonToJson(report.skeleton) + "\n");
  if (report.budget) KeepBudget(started_s, folder, written);
  folder->Commit();
}

/// What cannot be must not cost the run.
void CheckBudgetForPoses(const Pose2dOptions& options, bool existing) {
  (void)options.budget.BudgetSeconds(), (void)options.budget.Target();
  if (options.budget.Asked() && existing)
    throw UsageError("option 'budget' and option 'target': keypoints that are there cost no time; leave them out");
}

geometry::Rig RigFor(const std::string& path, InputNotes* notes) {
  if (path.empty()) return {};
  notes->inputs.push_back(path);
  const calib::ImportedRig imported = ReadCalibrationFiles({path}, {});
  AddNotes(imported.notes, notes);
  return imported.rig;
}

/// Cameras that the calibration knows by other names would be compared with nobody, and nothing would say so.
void RequireSharedCamera(const geometry::Rig& rig, const std::string& path, const std::vector<std::string>& cameras) {
  const auto known = [&](const std::string& camera) { return rig.Find(camera) >= 0; };
  if (rig.cameras.empty() || cameras.empty() || std::any_of(cameras.begin(), cameras.end(), known)) return;
  throw FormatError(path, "cameras",
                    "has " + Join(geometry::CameraNames(rig), ", ") + ", the footage or its keypoints " + Join(cameras, ", ") +
                        ": none is in both; name the cameras alike, e.g. option 'video' " + geometry::CameraNames(rig).front() +
                        "=FILE");
}

std::vector<std::string> CamerasWithFootage(const std::vector<dataset::CameraFootage>& footage) {
  std::vector<std::string> names;
  for (const dataset::CameraFootage& camera : footage) names.push_back(camera.camera);
  return names;
}

std::vector<std::string> CamerasWithPoses(const std::vector<CameraPoses>& cameras) {
  std::vector<std::string> names;
  for (const CameraPoses& camera : cameras) names.push_back(camera.track.camera);
  return names;
}

}  // namespace

bool Pose2dReport::FoundPeople() const {
  return std::any_of(cameras.begin(), cameras.end(), [](const CameraPoses& c) { return c.frames_with_people > 0; });
}

std::string Pose2dOverlayPath(const std::string& out, const std::string& camera, int frame) {
  return out + "/overlay/" + camera + Format("_%08d.jpg", frame);
}

Pose2dReport RunPose2d(const Pose2dOptions& options, const RunContext& run) {
  Pose2dReport report;
  const double started_s = options.budget.NowSeconds();
  const bool existing = options.backend.rfind(kExistingPoses, 0) == 0;
  CheckBudgetForPoses(options, existing);
  const TakeInput take = ReadTakeInput(options.take, &report.notes);
  if (take.footage.empty() && !existing)
    throw UsageError("no footage: give option 'video' or option 'images' for each camera, or option 'session'");
  const std::string calibration = options.calib.empty() ? take.calibration : options.calib;
  const geometry::Rig rig = RigFor(calibration, &report.notes);
  RequireSharedCamera(rig, calibration, CamerasWithFootage(take.footage));
  report.out = options.out.empty() ? take.Folder("pose2d") : options.out;
  if (report.out.empty()) throw UsageError("option 'out' is needed without option 'session'");
  std::vector<std::string> inputs = take.Paths();
  inputs.insert(inputs.end(), {ExistingFolder(options), options.calib, options.skeleton});
  AtomicFolder folder(report.out, options.overwrite, inputs);
  std::vector<int> frames;
  if (!options.frames.empty()) frames = ParseRanges("option 'frames'", options.frames);
  if (existing) {
    ReadAll(options, take, &report);
    RequireSharedCamera(rig, calibration, CamerasWithPoses(report.cameras));
  } else {
    DetectAll(options, {take.footage, options.pose, options.overlays, options.every, 0, frames, options.cache}, rig, started_s,
              run, &report);
  }
  LimitPoses(frames, &report.cameras, &report.notes);
  RequireFrames(report.cameras);
  report.other_sizes = OtherSizes(report.cameras, rig);
  report.agreement = MeasureAgreement(PoseTracks(report.cameras), report.skeleton, rig, options.pose.max_persons, run);
  WritePoses(started_s, &folder, &report);
  return report;
}

}  // namespace mvstudio::stages
