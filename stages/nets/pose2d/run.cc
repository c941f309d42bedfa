#include "stages/nets/pose2d/run.h"

#include <algorithm>
#include <filesystem>
#include <iterator>

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
#include "stages/nets/pose2d/choose.h"
#include "stages/nets/pose2d/existing.h"
#include "stages/nets/pose2d/kept.h"
#include "stages/words.h"

namespace mvstudio::stages {
namespace {

constexpr char kExistingPoses[] = "openpose:";

bool IsExisting(const Pose2dOptions& options) { return options.backend.rfind(kExistingPoses, 0) == 0; }

/// The folder of keypoints that are there; empty: they are to be detected.
std::string ExistingFolder(const Pose2dOptions& options) {
  return IsExisting(options) ? options.backend.substr(sizeof(kExistingPoses) - 1) : "";
}

void DetectAll(Pose2dOptions options, DetectJob job, const geometry::Rig& rig, double started_s, const RunContext& run,
               Pose2dReport* report) {
  if (options.budget.Asked()) {
    report->budget = ChooseNet(job, rig, started_s, run, &options);
    job.options = options.pose, job.every = options.every;
  }
  report->backend = ChoosePoseBackend(options, job, rig, run, &report->trials);
  const PoseBackend backend = OpenPoseBackend(report->backend, options.models, options.pose.quality, options.onnx);
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

/// What is read before anything is detected.
struct Pose2dInput {
  TakeInput take;
  std::string calibration;  ///< may be empty
  geometry::Rig rig;

  /// What the output must not lie in.
  std::vector<std::string> Paths(const Pose2dOptions& options) const {
    std::vector<std::string> paths = take.Paths();
    paths.insert(paths.end(), {ExistingFolder(options), options.calib, options.skeleton});
    return paths;
  }
};

Pose2dInput ReadPose2dInput(const Pose2dOptions& options, InputNotes* notes) {
  const bool existing = IsExisting(options);
  CheckBudgetForPoses(options, existing);
  Pose2dInput input;
  input.take = ReadTakeInput(options.take, notes);
  if (input.take.footage.empty() && !existing)
    throw UsageError("no footage: give option 'video' or option 'images' for each camera, or option 'session'");
  input.calibration = options.calib.empty() ? input.take.calibration : options.calib;
  input.rig = RigFor(input.calibration, notes);
  RequireSharedCamera(input.rig, input.calibration, CamerasWithFootage(input.take.footage));
  return input;
}

DetectJob JobOf(const Pose2dOptions& options, const Pose2dInput& input) {
  DetectJob job{input.take.footage, options.pose, options.overlays, options.every, 0, {}, options.cache};
  if (!options.frames.empty()) job.frames = ParseRanges("option 'frames'", options.frames);
  return job;
}

void CheckPart(const Pose2dOptions& options, const StagePart& part) {
  if (part.kind != PartKind::kChoice && part.kind != PartKind::kFrames)
    throw UsageError("option 'part' " + options.part + ": pose2d has the parts choice and frames=CAMERA");
  if (options.out.empty()) throw UsageError("option 'part' needs option 'out', a folder for the list of what is kept");
  if (!KeptResults(options.cache, kPosesKind).enabled())
    throw UsageError("option 'part' keeps its result: give option 'cache'");
  if (options.budget.Asked() || IsExisting(options))
    throw UsageError("option 'part' goes with nets that look at each frame: without option 'budget' and openpose:FOLDER");
}

dataset::CameraFootage FootageOfPart(const std::string& camera, const std::vector<dataset::CameraFootage>& footage) {
  for (const dataset::CameraFootage& one : footage) {
    if (one.camera == camera) return one;
  }
  throw UsageError("option 'part': no camera " + camera + "; the take has " + Join(CamerasWithFootage(footage), ", "));
}

/// Those of the part that are there.
std::vector<std::string> KeptBlocks(const DetectJob& job, const PoseBackend& backend) {
  std::vector<std::string> there;
  const KeptResults kept(job.cache, kPosesKind);
  const std::optional<std::string> base = CameraPosesKey(job, job.footage.front(), backend);
  for (int64_t block = job.first_block; base && block < job.end_block; ++block) {
    const std::string key = BlockKey(*base, block);
    if (!kept.Has(key)) break;
    there.push_back(std::string(kPosesKind) + "/" + key);
  }
  return there;
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
  const bool existing = IsExisting(options);
  const Pose2dInput input = ReadPose2dInput(options, &report.notes);
  report.out = options.out.empty() ? input.take.Folder("pose2d") : options.out;
  if (report.out.empty()) throw UsageError("option 'out' is needed without option 'session'");
  AtomicFolder folder(report.out, options.overwrite, input.Paths(options));
  if (existing) {
    ReadAll(options, input.take, &report);
    RequireSharedCamera(input.rig, input.calibration, CamerasWithPoses(report.cameras));
  } else {
    DetectAll(options, JobOf(options, input), input.rig, started_s, run, &report);
  }
  LimitPoses(JobOf(options, input).frames, &report.cameras, &report.notes);
  RequireFrames(report.cameras);
  report.other_sizes = OtherSizes(report.cameras, input.rig);
  report.agreement = MeasureAgreement(PoseTracks(report.cameras), report.skeleton, input.rig, options.pose.max_persons, run);
  WritePoses(started_s, &folder, &report);
  return report;
}

PartReport RunPose2dPart(const Pose2dOptions& options, const RunContext& run) {
  const StagePart part = ParsePart(options.part);
  CheckPart(options, part);
  PartReport report{{}, options.part, options.out, {}};
  const Pose2dInput input = ReadPose2dInput(options, &report.notes);
  AtomicFolder folder(report.out, options.overwrite, input.Paths(options));
  DetectJob job = JobOf(options, input);
  std::vector<Pose2dTrial> trials;
  const std::string name = ChoosePoseBackend(options, job, input.rig, run, &trials);
  if (part.kind == PartKind::kFrames) {
    job.footage = {FootageOfPart(part.camera, job.footage)};
    job.first_block = part.first_block, job.end_block = part.end_block;
    const PoseBackend backend = OpenPoseBackend(name, options.models, options.pose.quality, options.onnx);
    const CameraPoses camera = DetectPoses(job, backend, run).front();
    if (!camera.failure.empty()) report.notes.partial = true;
    if (!camera.failure.empty())
      report.notes.warnings.push_back({"POSE-CAMERA", camera.failure, "the others go on without it"});
    report.kept = KeptBlocks(job, backend);
  }
  WritePart(report, folder.work_path());
  folder.Commit();
  return report;
}

}  // namespace mvstudio::stages
