#include "stages/nets/mask/input.h"

#include <algorithm>
#include <filesystem>
#include <set>

#include "core/choice/frame_choice.h"
#include "core/disk/kept_key.h"
#include "core/disk/manifest.h"
#include "core/disk/paths.h"
#include "core/error.h"
#include "core/parallel.h"
#include "dataset/detect/models/models.h"
#include "dataset/footage/frames.h"
#include "dataset/footage/image_io.h"
#include "dataset/footage/mask_files.h"
#include "dataset/masks/size_rule.h"
#include "dataset/panoptic/panoptic.h"
#include "stages/frame_notice.h"
#include "stages/input/calib_read.h"
#include "stages/input/first_frames.h"
#include "stages/input/pose3d_input.h"
#include "stages/input/score_input.h"
#include "stages/nets/mask/kept.h"
#include "stages/words.h"

namespace mvstudio::stages {
namespace fs = std::filesystem;
namespace {

std::string SizeText(int width, int height) { return std::to_string(width) + "x" + std::to_string(height); }

/// The camera as its footage shows it.
geometry::RigCamera MatchSize(const MaskStageOptions& options, const geometry::RigCamera& camera, const MaskCamera& taken,
                              const std::map<int, People>& poses, InputNotes* notes) {
  const int w = taken.samples.width, h = taken.samples.height, cw = camera.camera.width_px, ch = camera.camera.height_px;
  const std::string sizes = "footage is " + SizeText(w, h) + ", the calibration is for " + SizeText(cw, ch);
  const auto rules = dataset::SizeRules(cw, ch, w, h);
  if (rules.empty()) throw FormatError(taken.footage.path, "camera " + taken.footage.camera, sizes + ": more than 2 % apart");
  if (rules.size() == 1) return ApplySizeRule(camera, rules[0], w, h);
  dataset::SizeRule rule = rules[0];
  for (const dataset::SizeRule& r : rules) {
    if (r.name == ToString(options.run.size_rule)) rule = r;
  }
  std::vector<Image> frames;
  std::vector<People> people;
  for (size_t f = 0; f < taken.samples.frames.size(); ++f) {
    const auto found = poses.find(taken.TimeStepOf(taken.samples.numbers[f]));
    if (found == poses.end()) continue;
    frames.push_back(taken.samples.frames[f]), people.push_back(found->second);
  }
  if (options.run.size_rule == dataset::SizeRuleChoice::kAuto && !frames.empty())
    rule = dataset::DecideSizeRule(rules, camera, frames, people, 0, options.mask).rule;
  notes->warnings.push_back({"MSK-SIZE", "camera " + taken.footage.camera + ": " + sizes + "; taken as '" + rule.name + "'",
                             "calibrate with footage of the size that is used, or name the rule with option 'size-rule'"});
  return ApplySizeRule(camera, rule, w, h);
}

/// From an earlier run or from the footage.
dataset::FootageSamples SampleOrLoad(const MaskStageOptions& options, const dataset::CameraFootage& footage, std::string* key) {
  const bool keep_undamaged = options.run.keep_undamaged;
  const KeptResults kept(options.cache, kSamplesKind);
  *key = SamplesKey(options.cache, footage, options.mask, keep_undamaged);
  if (auto before = LoadKept(kept, *key, DecodeSamples)) return std::move(*before);
  dataset::FootageSamples samples = dataset::SampleFootage(footage.path, options.mask.background_frames, keep_undamaged);
  if (!key->empty()) kept.Store(*key, EncodeSamples(samples));
  return samples;
}

MaskCamera SampleCamera(const MaskStageOptions& options, const dataset::CameraFootage& footage) {
  MaskCamera camera;
  camera.footage = footage;
  if (footage.timeline) {
    camera.frame_at.emplace();
    const dataset::CameraTimeline* times = footage.timeline->Find(footage.camera);
    const std::vector<int64_t> frames = times ? times->frame_at : std::vector<int64_t>();
    for (size_t time_step = 0; time_step < frames.size(); ++time_step) {
      if (frames[time_step] >= 0) camera.frame_at->emplace(static_cast<int>(time_step), static_cast<int>(frames[time_step]));
    }
  }
  camera.samples = SampleOrLoad(options, footage, &camera.samples_key);
  if (footage.plate.empty()) return camera;
  camera.plate = dataset::ReadImage(footage.plate);
  if (camera.plate.width != camera.samples.width || camera.plate.height != camera.samples.height) {
    throw FormatError(footage.plate, "camera " + footage.camera,
                      "the clean plate is " + SizeText(camera.plate.width, camera.plate.height) + ", the footage " +
                          SizeText(camera.samples.width, camera.samples.height) + ": take both with the same settings");
  }
  return camera;
}

void AddCalibration(const MaskStageOptions& options, const std::string& path, MaskJob* job, InputNotes* notes) {
  const calib::ImportedRig imported = ReadCalibrationFiles({path}, options.read);
  const geometry::Rig& rig = imported.rig;
  AddNotes(imported.notes, notes);
  RequirePoses(rig, path);
  notes->inputs.push_back(path);
  for (MaskCamera& camera : job->cameras) {
    const int idx = rig.Find(camera.footage.camera);
    if (idx < 0) throw FormatError(path, "cameras", "has no camera " + camera.footage.camera);
    camera.camera = MatchSize(options, rig.cameras[idx], camera, job->poses, notes);
    for (const auto& [time_step, people] : job->poses) {
      const int frame = camera.FrameAt(time_step);
      if (frame >= 0) camera.bodies.frames[frame] = dataset::ProjectBody(people, *camera.camera, options.mask);
    }
  }
}

MaskCamera* CameraNamed(const std::string& name, MaskJob* job) {
  const auto is = [&](const MaskCamera& camera) { return camera.footage.camera == name; };
  const auto found = std::find_if(job->cameras.begin(), job->cameras.end(), is);
  return found == job->cameras.end() ? nullptr : &*found;
}

/// The sizes of the footage, in whose pixels the joints are.
geometry::Rig FootageRig(const MaskJob& job) {
  geometry::Rig rig;
  for (const MaskCamera& camera : job.cameras) {
    geometry::RigCamera sized;
    sized.camera.name = camera.footage.camera;
    sized.camera.width_px = camera.samples.width, sized.camera.height_px = camera.samples.height;
    rig.cameras.push_back(std::move(sized));
  }
  return rig;
}

/// Of cameras whose joints have the numbers of its frames.
std::vector<NamedPath> UntimedFootage(const MaskJob& job) {
  std::vector<NamedPath> footage;
  for (const MaskCamera& camera : job.cameras) {
    if (!camera.frame_at) footage.push_back({camera.footage.camera, camera.footage.path});
  }
  return footage;
}

/// The same for time steps of 3D joints.
void NumberPoses(const MaskStageOptions& options, MaskJob* job, InputNotes* notes) {
  int first = FirstFrameOf(options.changes, "");
  if (options.changes.first_frame.empty()) {
    std::vector<std::string> paths;
    for (const NamedPath& named : UntimedFootage(*job)) paths.push_back(named.path);
    std::set<int64_t> steps;
    for (const auto& [step, people] : job->poses) steps.insert(step);
    const auto found =
        paths.size() == job->cameras.size() ? dataset::FirstNumberOf(steps, paths) : dataset::FirstNumber::kAsFrames;
    ReportFirstNumber(found, "the 3D joints", notes);
    first = found == dataset::FirstNumber::kOne ? 1 : 0;
  }
  if (first != 0) dataset::NumberFrom(first, &job->poses);
}

void AddKeypoints(const MaskStageOptions& options, MaskJob* job, InputNotes* notes) {
  const geometry::Skeleton skeleton = geometry::SkeletonFrom(options.skeleton);
  if (geometry::IsSkeletonFile(options.skeleton)) notes->inputs.push_back(options.skeleton);
  std::vector<dataset::Pose2dTrack> tracks;
  for (const NamedPath& named : options.pose2d) {
    const auto& [name, path] = named;
    if (!CameraNamed(name, job))
      throw UsageError("option 'pose2d' " + ToString(named) + ": camera " + name + " has no footage");
    tracks.push_back(dataset::ReadPose2d(path, name, skeleton));
    notes->inputs.push_back(path);
  }
  NumberFromZero(options.changes, UntimedFootage(*job), &tracks, notes);
  ScoresToShares(options.changes, false, &tracks, notes);
  ApplyChanges(options.changes, FootageRig(*job), skeleton, &tracks);
  for (const dataset::Pose2dTrack& track : tracks) {
    MaskCamera* camera = CameraNamed(track.camera, job);
    for (const auto& [frame, people] : track.frames) {
      dataset::ProjectedBody body = dataset::BodyFromKeypoints(people, skeleton, options.mask);
      if (!body.empty()) camera->bodies.frames[frame] = std::move(body);
    }
  }
}

/// Leaves time steps that were not asked for without masks, and says which are not there.
void LimitToFrames(const std::string& ranges, MaskJob* job, InputNotes* notes) {
  if (ranges.empty()) return;
  std::vector<int> there;
  for (const MaskCamera& camera : job->cameras) {
    for (const int frame : camera.samples.all) {
      if (camera.TimeStepOf(frame) >= 0) there.push_back(camera.TimeStepOf(frame));
    }
  }
  const FrameChoice choice =
      KnownFrames("option 'frames'", ParseRanges("option 'frames'", ranges), std::move(there), "the footage");
  NoteFrames(choice.beyond, notes);
  for (MaskCamera& camera : job->cameras) {
    camera.wanted.emplace();
    for (const int frame : camera.samples.all) {
      if (std::binary_search(choice.frames.begin(), choice.frames.end(), camera.TimeStepOf(frame)))
        camera.wanted->insert(frame);
    }
  }
}

void CheckArguments(const MaskStageOptions& options, const TakeInput& take) {
  if (take.footage.empty())
    throw UsageError("no footage was given: add option 'video' CAMERA=FILE or option 'images' CAMERA=FOLDER");
  std::set<std::string> cameras;
  for (const dataset::CameraFootage& f : take.footage) {
    if (!cameras.insert(f.camera).second) throw UsageError("camera " + f.camera + " was given footage twice");
  }
  if (!options.pose3d.empty() && !options.pose2d.empty()) throw UsageError("give option 'pose3d' or option 'pose2d', not both");
  const std::string calib = options.calib.empty() ? take.calibration : options.calib;
  if (!options.pose3d.empty() && calib.empty()) throw UsageError("option 'pose3d' needs option 'calib'");
  if (options.run.hull && calib.empty()) throw UsageError("option 'hull' needs option 'calib'");
  if (!options.changes.rate.empty())
    throw UsageError("option 'rate': a mask has the number of its frame, whatever the rates; joints must be numbered so");
  if (options.mask.background_frames < 1) throw UsageError("option 'mask-background-frames' must be at least 1");
  if (!(options.hull.voxel_m > 0)) throw UsageError("option 'hull-voxel' must be positive");
}

/// The package's files are held against its hashes when they are read.
std::string SelfieWeights() { return detect::PinnedModelPackage().integrity; }

std::string OnnxWeights(const std::string& file, const detect::OnnxSegmenterOptions& options) {
  KeptKey key;
  key.Add(mvstudio::DigestOf(file).sha256);
  key.AddFields(options);
  return key.Take();
}

}  // namespace

MaskJob ReadMaskJob(const MaskStageOptions& options, const TakeInput& take, InputNotes* notes, const RunContext& run) {
  CheckArguments(options, take);
  MaskJob job;
  job.mask = options.mask, job.hull = options.hull, job.run = options.run, job.cache = options.cache;
  if (!options.pose3d.empty()) {
    job.poses = ReadCoco19Poses(options.pose3d, options.marker_unit);
    notes->inputs.push_back(options.pose3d);
  }
  job.cameras.resize(take.footage.size());
  {
    ProgressStage stage(run, "reading footage", static_cast<int64_t>(take.footage.size()));
    ParallelFor(static_cast<int64_t>(take.footage.size()), run.num_threads,
                [&](int64_t c) { job.cameras[c] = SampleCamera(options, take.footage[c]); });
    stage.Advance(static_cast<int64_t>(take.footage.size()));
  }
  NumberPoses(options, &job, notes);
  LimitToFrames(options.changes.frames, &job, notes);
  const std::string calib = options.calib.empty() ? take.calibration : options.calib;
  if (!calib.empty()) AddCalibration(options, calib, &job, notes);
  AddKeypoints(options, &job, notes);
  return job;
}

std::vector<MaskBackend> MaskBackends(const MaskStageOptions& options, InputNotes* notes) {
  const std::string& name = options.backend;
  if (name == "background") return {{"background", nullptr}};
  if (name == "selfie") return {{"selfie", detect::SelfieSegmenter(), SelfieWeights()}};
  if (name.rfind("onnx:", 0) == 0)
    return {{name, detect::OnnxSegmenter(name.substr(5), options.onnx), OnnxWeights(name.substr(5), options.onnx)}};
  if (name != "auto") throw UsageError("option 'backend' " + name + ": known are auto, background, selfie, onnx:FILE");
  std::vector<MaskBackend> backends = {{"background", nullptr}};
  if (detect::HasModel("selfie")) {
    backends.push_back({"selfie", detect::SelfieSegmenter(), SelfieWeights()});
  } else {
    notes->warnings.push_back(
        {"MSK-NONET", "the net 'selfie' is not installed: only 'background' can be tried", "mvstudio models fetch"});
  }
  return backends;
}

TruthScore CompareWithTruth(const std::string& truth, const std::string& folder, const std::string& camera) {
  TruthScore score;
  dataset::FrameMasks exact = dataset::FindMasks(truth);
  if (exact.files.empty()) throw IoError(truth, "no exact mask is there");
  const auto num_masks = dataset::FramesFrom0(folder + "/" + camera);
  std::set<int64_t> distinct;
  for (const auto& [frame, path] : exact.files) distinct.insert(frame);
  score.from_one = num_masks && dataset::FirstNumberOf(distinct, *num_masks) == dataset::FirstNumber::kOne;
  if (score.from_one) exact.CountFrom(1);
  score.masks = exact.meaning = dataset::MeaningOfMasks(exact.Paths());
  for (const auto& [frame, path] : exact.files) {
    const std::string own = MaskPath(folder, camera, static_cast<int>(frame));
    if (!fs::exists(own)) {
      ++score.missing;
      continue;
    }
    const dataset::ImageHeader size = dataset::ReadImageHeader(path);
    const Image a = dataset::ReadImage(own, true);
    if (a.width != size.width || a.height != size.height)
      throw FormatError(path, "", "is " + SizeText(size.width, size.height) + ", the footage " + SizeText(a.width, a.height));
    const Image b = dataset::MaskOfFrame(exact, frame, a.width, a.height);
    double both = 0, either = 0;
    for (size_t i = 0; i < a.pixels.size(); ++i) {
      const bool m = a.pixels[i] > 127, t = b.pixels[i] > 127;
      both += m && t, either += m || t;
      score.too_much_px += m && !t, score.too_little_px += t && !m;
    }
    const double iou = either > 0 ? both / either : 1;
    score.iou_sum += iou;
    ++score.images;
    if (iou < score.worst || score.worst_image.empty()) score.worst = iou, score.worst_image = own;
  }
  return score;
}

}  // namespace mvstudio::stages
