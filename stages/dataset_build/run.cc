#include "stages/dataset_build/run.h"

#include <algorithm>
#include <filesystem>
#include <utility>

#include "core/disk/kept_key.h"
#include "core/disk/output.h"
#include "core/disk/paths.h"
#include "core/disk/place.h"
#include "core/error.h"
#include "core/join.h"
#include "core/stopwatch.h"
#include "dataset/build/scene_joints.h"
#include "dataset/panoptic/panoptic.h"
#include "dataset/pose/markers.h"
#include "dataset/pose/pose3d.h"
#include "stages/dataset_build/mask_warnings.h"
#include "stages/input/kept_footage.h"
#include "stages/people/human_shape.h"

namespace mvstudio::stages {
namespace {

/// Masks that `mask` made, or a person painted, come before new ones.
void FindGivenMasks(const TakeInput& take, DatasetBuildOptions* options, InputNotes* notes) {
  options->build.masks = options->build.masks && !options->no_masks;
  if (!options->build.masks) return options->masks.clear();
  const std::string made = take.Folder("masks");
  const bool there = !made.empty() && std::any_of(take.footage.begin(), take.footage.end(), [&](const auto& footage) {
    return std::filesystem::is_directory(made + "/" + footage.camera);
  });
  if (options->masks.empty() && !options->make_masks && there) options->masks = made;
  if (options->masks.empty()) return;
  notes->inputs.push_back(options->masks);
  Append(MaskWarnings(options->masks), &notes->warnings);
}

/// Of the session, else of the joints; 0: neither states it.
double StatedRate_hz(const TakeInput& take, const dataset::BuildInputs& inputs) {
  if (take.fps_hz > 0) return take.fps_hz;
  return dataset::SceneFilesAt(inputs.pose3d).empty() ? dataset::ReadPoints3d(inputs.pose3d, inputs.marker_unit).frame_rate_hz
                                                      : dataset::ReadSceneJoints(inputs.pose3d).frame_rate_hz;
}

/// What a session says takes the place of options that were not given.
dataset::BuildInputs ToBuildInputs(DatasetBuildOptions* options, InputNotes* notes) {
  TakeInput take = ReadTakeInput(options->take, notes);
  if (take.footage.empty())
    throw UsageError("no footage: give option 'video' or option 'images' for each camera, or option 'session'");
  dataset::BuildInputs inputs;
  inputs.calibration = options->calib.empty() ? take.calibration : options->calib;
  if (inputs.calibration.empty()) RefuseWithoutCalibration(options->take.session);
  inputs.pose3d = options->pose3d.empty() ? take.Folder("pose3d") : options->pose3d;
  inputs.first_frame = options->first_frame, inputs.first_mask = options->first_mask;
  inputs.marker_unit = options->marker_unit, inputs.skeleton = options->skeleton;
  if (!options->frames.empty()) inputs.frames = ParseRanges("option 'frames'", options->frames);
  if (inputs.pose3d.empty()) throw UsageError("option 'pose3d' is needed: the folder that triangulate wrote");
  std::error_code none;
  if (options->pose3d.empty() && !std::filesystem::exists(inputs.pose3d, none))
    throw UsageError(inputs.pose3d + ": no 3D joints; run mvstudio triangulate option 'session' " + options->take.session +
                     " first, or give option 'pose3d'");
  if (options->out.empty()) options->out = take.Folder("dataset");
  if (options->out.empty()) throw UsageError("option 'out' is needed without option 'session'");
  if (!options->keep_sequence && !take.take.empty()) options->build.sequence = dataset::Slug(take.take);
  if (!options->keep_rate) {
    const double stated_hz = StatedRate_hz(take, inputs);
    if (stated_hz > 0) options->build.frame_rate_hz = stated_hz;
  }
  LeaveOutUncalibrated(inputs.calibration, &take, notes);
  FindGivenMasks(take, options, notes);
  inputs.masks = options->masks;
  inputs.footage = std::move(take.footage);
  return inputs;
}

/// To be raised whenever a build gives other images or masks than before.
constexpr char kBuildVersion[] = "mvstudio dataset 1";

/// Beside the dataset, hidden: SESSION/dataset/.kept-walk; empty: nothing is kept.
std::string KeptPlace(const DatasetBuildOptions& options) {
  if (!KeptResults(options.cache, "datasets").enabled()) return "";
  if (options.cache.kind == CachePlace::Kind::kFolder) return KeptResults(options.cache, "datasets").folder();
  const std::filesystem::path path = PathOnDisk(options.out);
  return (path.parent_path() / (".kept-" + path.filename().string())).string();
}

/// Of everything that the images and masks are made of.
std::string KeyOfBuild(const DatasetBuildOptions& options, const dataset::BuildInputs& inputs) {
  // Parts of a plan share a folder: only the first that wants the digest of footage reads all of it.
  const bool shared = options.cache.kind == CachePlace::Kind::kFolder;
  const CachePlace digests = shared ? options.cache : CachePlace{CachePlace::Kind::kOff, ""};
  KeptKey key;
  key.Add(kBuildVersion);
  const auto add = [&](const std::string& path) {
    const std::optional<std::string> digest = path.empty() ? "" : FootageDigest(digests, path);
    key.Add(digest.value_or("none"));
  };
  for (const dataset::CameraFootage& footage : inputs.footage) {
    key.Add(footage.camera);
    add(footage.path), add(footage.plate);
    const dataset::CameraTimeline* times = footage.timeline ? footage.timeline->Find(footage.camera) : nullptr;
    if (times) key.Add(Join(times->frame_at, " ", [](int64_t frame) { return std::to_string(frame); }));
  }
  add(inputs.calibration), add(inputs.pose3d), add(inputs.masks);
  key.Add(inputs.marker_unit + " " + inputs.skeleton + " " + RangesText(inputs.frames));
  key.Add(std::to_string(inputs.first_frame) + " " + std::to_string(inputs.first_mask));
  dataset::BuildOptions build = options.build;
  build.overwrite = false;
  key.AddFields(build);
  key.Add(build.masks ? "masks" : "");
  return key.Take();
}

dataset::BuildPart BuildPartOf(const DatasetBuildOptions& options) {
  const StagePart part = ParsePart(options.part);
  if (part.kind != PartKind::kSamples && part.kind != PartKind::kFrames)
    throw UsageError("option 'part' " + options.part + ": a dataset is built by samples=CAMERA and frames=CAMERA");
  if (options.out.empty()) throw UsageError("option 'part' needs option 'out', a folder for the list of what is kept");
  if (options.cache.kind != CachePlace::Kind::kFolder)
    throw UsageError("option 'part' keeps its result: give option 'cache' a folder");
  return {part.camera, part.kind == PartKind::kSamples, part.first_block, part.end_block};
}

}  // namespace

bool DatasetBuildReport::OtherWorld() const { return built.world != dataset::kZUpWorld && built.world != calibrated_world; }

bool DatasetBuildReport::IsPartial() const {
  const auto lacks_masks = [](const dataset::BuiltCamera& camera) { return !camera.without_mask.empty(); };
  return !built.gaps.empty() || std::any_of(built.cameras.begin(), built.cameras.end(), lacks_masks);
}

DatasetBuildReport RunDatasetBuild(DatasetBuildOptions options, const RunContext& run) {
  const Stopwatch watch;
  DatasetBuildReport report;
  report.inputs = ToBuildInputs(&options, &report.notes);
  report.inputs.kept = KeptPlace(options);
  report.inputs.kept_key = [&] { return KeyOfBuild(options, report.inputs); };
  report.built = dataset::BuildDataset(report.inputs, options.out, options.build, run);
  report.inputs.kept_key = nullptr;
  report.wall_s = watch.Seconds();
  report.calibrated_world = WorldText(dataset::ReadAnyCalibration(report.inputs.calibration));
  report.options = std::move(options);
  return report;
}

PartReport RunDatasetBuildPart(DatasetBuildOptions options, const RunContext& run) {
  const dataset::BuildPart part = BuildPartOf(options);
  PartReport report{{}, options.part, options.out, {}};
  dataset::BuildInputs inputs = ToBuildInputs(&options, &report.notes);
  AtomicFolder folder(options.out, options.build.overwrite, {inputs.calibration, inputs.pose3d});
  inputs.kept = KeptPlace(options);
  inputs.kept_key = [&] { return KeyOfBuild(options, inputs); };
  const bool there = std::any_of(inputs.footage.begin(), inputs.footage.end(),
                                 [&](const dataset::CameraFootage& footage) { return footage.camera == part.camera; });
  if (there) {
    for (const std::string& name : dataset::KeepBuildPart(inputs, part, options.build, run))
      report.kept.push_back("datasets/" + name);
  } else {
    report.notes.partial = true;  // its camera is not in the calibration
  }
  WritePart(report, folder.work_path());
  folder.Commit();
  return report;
}

}  // namespace mvstudio::stages
