#include "stages/nets/avatar_train_data.h"

#include <algorithm>

#include "avatar/nets/generator.h"
#include "avatar/run/pack/frame_runs.h"
#include "avatar/run/pack/split_side.h"
#include "core/choice/frame_choice.h"
#include "core/error.h"
#include "core/join.h"
#include "core/log.h"
#include "dataset/panoptic/in_view.h"
#include "dataset/verify/image_mask.h"
#include "dataset/views/split.h"
#include "stages/frame_notice.h"
#include "stages/words.h"

namespace mvstudio::stages {
namespace {

/// Those of `frames` in which the person has a pose.
std::vector<int> WithPose(const dataset::PanopticDataset& data, int person, const std::vector<int>& frames) {
  std::vector<int> with;
  for (const int frame : frames) {
    const auto found = data.poses.find(frame);
    if (found != data.poses.end() && found->second.count(person)) with.push_back(frame);
  }
  return with;
}

avatar::DatasetSplit FromFile(const dataset::PanopticDataset& data, int person, const std::string& path) {
  const dataset::Split file = dataset::ReadSplit(path);
  dataset::RequireSplitOf(file, data, path);
  avatar::DatasetSplit split;
  split.train_cameras = file.train.cameras, split.train_frames = WithPose(data, person, file.train.frames);
  split.holdout_cameras = file.test.cameras, split.holdout_frames = WithPose(data, person, file.test.frames);
  split.validation_cameras = file.validation.cameras;
  split.validation_frames = WithPose(data, person, file.validation.frames);
  if (split.validation_frames.empty()) split.validation_cameras.clear();
  if (split.train_frames.empty())
    throw FormatError(path, "train.frames", "person " + std::to_string(person) + " has no pose in any of them");
  return split;
}

FrameChoice ChoiceOf(const dataset::PanopticDataset& data, const char* option, const std::string& ranges) {
  return KnownFrames(option, ParseRanges(option, ranges), data.frames, data.root);
}

/// Leaves out the frames that are not among `frames`, on all sides.
void KeepFrames(const std::vector<int>& frames, const std::string& root, avatar::DatasetSplit* split) {
  const auto gone = [&](int frame) { return !std::binary_search(frames.begin(), frames.end(), frame); };
  for (auto* side : {&split->train_frames, &split->holdout_frames, &split->validation_frames})
    side->erase(std::remove_if(side->begin(), side->end(), gone), side->end());
  if (split->train_frames.empty())
    throw NothingLeftError("option 'frames': none of these frames of " + root + " shows the person and is trained on");
}

/// Takes the camera out of those trained on.
void TakeValidationCamera(const dataset::PanopticDataset& data, const std::string& name, avatar::DatasetSplit* split) {
  if (!split->validation_cameras.empty())
    throw UsageError("option 'validate-camera' " + name +
                     ": the split has validation images already; leave one of the two out");
  auto& cameras = split->train_cameras;
  const auto found = std::find(cameras.begin(), cameras.end(), data.Resolve(name));
  if (found == cameras.end()) {
    throw UsageError("option 'validate-camera' " + name + " is not one of the training cameras: " + Join(cameras, ", "));
  }
  if (cameras.size() == 1) throw UsageError("option 'validate-camera' " + name + " leaves no camera to train on");
  split->validation_cameras = {*found};
  split->validation_frames = split->train_frames;
  cameras.erase(found);
}

/// About `count` of `frames`, spread evenly; for methods with memory runs of frames, each with a past but for its first ones.
std::vector<int> SpreadFrames(const std::vector<int>& frames, size_t count, bool memory) {
  const size_t length = std::min<size_t>(memory ? avatar::kNumPrevious + 1 : 1, frames.size());
  const size_t runs = std::clamp<size_t>(count / length, 1, frames.size() / length);
  std::vector<int> some;
  for (size_t i = 0; i < runs; ++i) {
    const size_t begin = std::min((2 * i + 1) * frames.size() / (2 * runs), frames.size() - length);
    for (size_t k = 0; k < length; ++k) {
      if (some.empty() || frames[begin + k] > some.back()) some.push_back(frames[begin + k]);
    }
  }
  return some;
}

avatar::SplitSide ValidationSide(const avatar::DatasetSplit& split) {
  return {"validation cameras in validation frames", split.validation_cameras, split.validation_frames};
}

/// Counts what is missing; throws where a side of the split has too little left.
void RequireSides(const dataset::PanopticDataset& data, const avatar::DatasetSplit& split, RunPacks* packs) {
  packs->missing = avatar::RequireImages(data, avatar::TrainingSide(split), avatar::kMostMissing);
  for (const avatar::SplitSide& side : {ValidationSide(split), avatar::HoldoutSide(split)}) {
    if (side.cameras.empty()) continue;
    dataset::MissingImages missing = avatar::RequireImages(data, side);
    if (missing.missing() > 0) packs->missing_scored.push_back({side.kind, std::move(missing)});
  }
}

/// At most `count` images, spread over cameras and frames.
std::optional<avatar::TrainingSet> WatchedPack(const dataset::PanopticDataset& data, const avatar::RunConfig& config, int count,
                                               bool memory, const RunContext& run) {
  const avatar::DatasetSplit& split = config.split;
  const bool validation = !split.validation_cameras.empty();
  if (count == 0 || (!validation && split.holdout_cameras.empty() && split.holdout_frames.empty())) return std::nullopt;
  avatar::TrainingSetOptions options = config.pack;
  const avatar::SplitSide side = validation ? ValidationSide(split) : avatar::HoldoutSide(split);
  options.cameras = side.cameras;
  options.frame_step = std::max(1, avatar::UsualStep(side.frames));
  const std::vector<int> frames = avatar::FramesWithImages(data, side);
  const auto wanted = std::min(frames.size(), static_cast<size_t>(count) / options.cameras.size() + 1);
  options.frames = SpreadFrames(frames, wanted, memory);
  try {
    return avatar::BuildTrainingSet(data, options, run);
  } catch (const FormatError&) {
    if (validation) throw;
    return std::nullopt;  // none of these few images is usable; evaluation says why
  }
}

/// Warps training images into each image of the packs.
void AddReferences(const avatar::ModelOptions& model, const avatar::RunConfig& config, const RunContext& run,
                   std::shared_ptr<const avatar::References> references, RunPacks* packs) {
  if (!references)
    references = std::make_shared<const avatar::References>(avatar::SpreadReferenceViews(packs->train, packs->train_views),
                                                            config.pack.fitted->person.body, run.num_threads);
  packs->references = std::move(references);
  FillReferences(*packs->references, packs->train_views, model, run.num_threads, &packs->train);
  if (packs->watched) FillReferences(*packs->references, packs->watched_views, model, run.num_threads, &*packs->watched);
}

}  // namespace

avatar::DatasetSplit SplitOf(const dataset::PanopticDataset& data, int person, const SplitArguments& a) {
  if (!a.split.empty() && !(a.train_cameras + a.holdout_cameras + a.holdout_frames).empty())
    throw UsageError(
        "option 'split' names the cameras and frames: leave option 'train-cameras', option 'holdout-cameras' and option "
        "'holdout-frames' out");
  avatar::DatasetSplit split;
  if (!a.split.empty()) {
    split = FromFile(data, person, a.split);
  } else {
    const std::vector<int> frames =
        a.holdout_frames.empty() ? std::vector<int>() : ParseRanges("option 'holdout-frames'", a.holdout_frames);
    split = avatar::SplitDataset(data, person, SplitCommas(a.holdout_cameras), frames, SplitCommas(a.train_cameras));
  }
  if (!a.frames.empty()) KeepFrames(ChoiceOf(data, "option 'frames'", a.frames).frames, data.root, &split);
  if (!a.validate_camera.empty()) TakeValidationCamera(data, a.validate_camera, &split);
  return split;
}

std::vector<Notice> CheckTrainingImages(const dataset::PanopticDataset& data, const avatar::DatasetSplit& split,
                                        const RunContext& run) {
  dataset::RequireInView(data, false);
  dataset::CameraFrames frames;
  for (const std::string& camera : split.train_cameras) frames[camera] = split.train_frames;
  std::vector<dataset::Finding> found = dataset::CompareImagesWithMasks(data, data.Masks(), frames, run);
  if (found.empty()) found = dataset::CompareImagesWithJoints(data, frames, run);
  for (dataset::Finding& finding : dataset::CompareJointsWithMasks(data, data.Masks(), frames, run))
    found.push_back(std::move(finding));
  std::vector<Notice> notices;
  for (const dataset::Finding& finding : found) {
    notices.push_back({finding.code, finding.path + ": " + finding.text,
                       "what is trained on these images is wrong; `mvstudio dataset verify " + data.root + "` checks all"});
    Log(LogLevel::kWarning, finding.code + ": " + notices.back().text);
  }
  return notices;
}

void ReportSplitFrames(const dataset::PanopticDataset& data, const SplitArguments& a, InputNotes* notes) {
  NoteFrames(ChoiceOf(data, "option 'frames'", a.frames).beyond, notes);
  NoteFrames(ChoiceOf(data, "option 'holdout-frames'", a.holdout_frames).beyond, notes);
}

RunPacks BuildPacks(const dataset::PanopticDataset& data, const avatar::ModelOptions& model,
                    const avatar::TrainOptions& options, const RunContext& run, avatar::RunConfig* config,
                    std::shared_ptr<const avatar::References> references) {
  if (options.patience > 0 && (config->split.validation_cameras.empty() || options.validate_images == 0))
    throw UsageError(
        "option 'patience' needs option 'validate-camera' or a option 'split' with validation images, and option "
        "'validate-pictures' above 0: images "
        "of the final score must not choose the weights");
  RunPacks packs;
  RequireSides(data, config->split, &packs);
  config->pack.cameras = config->split.train_cameras;
  config->pack.frames = config->split.train_frames;
  config->pack.template_colours = CorrectsColours(model);
  config->pack.keep_views = config->pack.keep_views || TakesReferences(model);
  avatar::TrainingSet built = avatar::BuildTrainingSet(data, config->pack, run);
  config->shape = config->pack.shape = built.shape;
  config->half_extent_m = config->pack.half_extent_m = built.half_extent_m;
  config->template_iou = built.template_iou;
  config->pack.person = built.person;
  config->pack.fit_shape = false;
  packs.train = std::move(built.pack), packs.train_views = std::move(built.views);
  auto watched = WatchedPack(data, *config, options.validate_images, NumPreviousChannels(model) > 0, run);
  if (watched) packs.watched = std::move(watched->pack), packs.watched_views = std::move(watched->views);
  if (TakesReferences(model)) AddReferences(model, *config, run, std::move(references), &packs);
  packs.skipped = std::move(built.skipped);
  packs.frames_without_person = avatar::FramesWithout(data, built.person);
  return packs;
}

}  // namespace mvstudio::stages
