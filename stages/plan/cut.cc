#include "stages/plan/cut.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "core/error.h"
#include "core/hash/sha256.h"
#include "core/parallel.h"
#include "dataset/footage/frames.h"
#include "stages/input/kept_footage.h"
#include "stages/part.h"
#include "stages/pipeline/need.h"

namespace mvstudio::stages {
namespace {

/// Footage of a camera of the take.
struct CutCamera {
  std::string name, path, plate;  ///< as the stage's inputs name them
  int64_t num_frames = 0;         ///< 0: not known
  double megapixels = 0;
};

bool Gives(const PipelineStage& stage, const std::string& option) {
  return std::any_of(stage.options.begin(), stage.options.end(), [&](const auto& given) { return given.name == option; });
}

bool CanBeCut(const PipelineStage& stage) {
  constexpr StageKind kCut[] = {StageKind::kPose2d, StageKind::kMask, StageKind::kDataset, StageKind::kVerify};
  if (std::find(std::begin(kCut), std::end(kCut), stage.kind) == std::end(kCut)) return false;
  for (const char* option : {"cache", "out", "part", "budget", "target"})
    if (Gives(stage, option)) return false;
  for (const LineOption& option : stage.options) {
    const bool reads = option.name == "backend" && !option.values.empty() && option.values[0].rfind("openpose:", 0) == 0;
    if (reads) return false;  // keypoints that are there
  }
  return true;
}

CutCamera CameraOf(const dataset::Session& session, const dataset::SessionFootage& footage, bool allow_outside) {
  CutCamera camera;
  camera.name = footage.camera;
  camera.path = dataset::ResolveInSession(session, footage.path, allow_outside);
  if (!footage.plate.empty()) camera.plate = dataset::ResolveInSession(session, footage.plate, allow_outside);
  try {
    const dataset::FootageInfo info = dataset::DescribeFootage(camera.path);
    camera.num_frames = info.num_frames, camera.megapixels = 1e-6 * info.width * info.height;
  } catch (const Error&) {  // the stage itself says what is wrong with it
  }
  return camera;
}

/// The parts of one stage.
class StageCutter {
 public:
  StageCutter(const PipelineStage& stage, std::vector<CutCamera> cameras, double measured_s, double task_s, std::string folder)
      : stage_(stage), cameras_(std::move(cameras)), task_s_(task_s), folder_(std::move(folder)) {
    double foretold_s = 0;
    for (const CutCamera& camera : cameras_) foretold_s += static_cast<double>(camera.num_frames) * ImageSecondsOf(camera);
    const double lanes = std::min<double>(ResolveThreads(0), static_cast<double>(cameras_.size()));
    if (std::isfinite(measured_s) && foretold_s > 0) scale_ = measured_s * lanes / foretold_s;
    total_s_ = foretold_s * scale_;
  }

  std::vector<std::vector<PartTask>> Cut() const {
    std::vector<std::vector<PartTask>> levels;
    if (!(total_s_ > 2 * task_s_)) return levels;
    if (stage_.kind == StageKind::kVerify) return {Shares()};
    if (stage_.kind != StageKind::kPose2d) levels.push_back(Samples());
    if (stage_.kind != StageKind::kDataset && !Gives(stage_, "backend"))
      levels.push_back({Part({PartKind::kChoice, "", 0, 0}, NAN, nullptr)});
    levels.push_back(Frames());
    return levels;
  }

 private:
  double ImageSecondsOf(const CutCamera& camera) const { return ImageSeconds(stage_.kind, camera.megapixels); }

  std::vector<PartTask> Samples() const {
    std::vector<PartTask> parts;
    for (const CutCamera& camera : cameras_) parts.push_back(Part({PartKind::kSamples, camera.name, 0, 0}, NAN, &camera));
    return parts;
  }

  /// Cameras of a dataset have other names, and none before it is built.
  std::vector<PartTask> Shares() const {
    const auto cameras = static_cast<double>(cameras_.size());
    const int count = static_cast<int>(std::min(cameras, std::ceil(total_s_ / task_s_)));
    std::vector<PartTask> parts;
    for (int index = 0; index < count; ++index) {
      StagePart part{PartKind::kShare, "", 0, 0};
      part.index = index, part.count = count;
      parts.push_back(Part(part, total_s_ / count, nullptr));
    }
    return parts;
  }

  std::vector<PartTask> Frames() const {
    std::vector<PartTask> parts;
    for (const CutCamera& camera : cameras_) {
      const double block_s = kKeptBlock * ImageSecondsOf(camera) * scale_;
      const int64_t blocks = std::max<int64_t>(1, (camera.num_frames + kKeptBlock - 1) / kKeptBlock);
      const auto wanted = static_cast<int64_t>(std::llround(task_s_ / std::max(block_s, 1e-6)));
      const int64_t at_once = std::clamp<int64_t>(wanted, 1, blocks);
      for (int64_t first = 0; first < blocks; first += at_once) {
        StagePart part{PartKind::kFrames, camera.name, first, std::min(blocks, first + at_once)};
        const int64_t frames = std::min(camera.num_frames, part.end_block * kKeptBlock) - first * kKeptBlock;
        const double seconds = block_s * static_cast<double>(frames) / kKeptBlock;
        if (at_once == blocks) part.end_block = std::numeric_limits<int64_t>::max();
        parts.push_back(Part(part, camera.num_frames > 0 ? seconds : NAN, &camera));
      }
    }
    return parts;
  }

  /// `camera`: the only one whose footage is looked at; nullptr: all are.
  PartTask Part(const StagePart& part, double seconds, const CutCamera* camera) const {
    PartTask task{stage_, seconds};
    PipelineStage& stage = task.stage;
    stage.part = ToString(part);
    stage.output =
        folder_ + "/parts/" + std::string(ToString(stage.kind)) + "-" + dataset::Slug(stage.take) + "/" + Place(part);
    stage.options.push_back({"part", {stage.part}});
    SetOutput(&stage);
    stage.options.push_back({"cache", {KeptFolder(folder_)}});
    if (!camera) return task;
    std::set<std::string> others;
    for (const CutCamera& other : cameras_)
      if (other.name != camera->name) others.insert({other.path, other.plate});
    const auto is_other = [&](const std::string& input) { return others.count(input) > 0; };
    stage.inputs.erase(std::remove_if(stage.inputs.begin(), stage.inputs.end(), is_other), stage.inputs.end());
    stage.need = NeedOf(stage.kind, {1, camera->megapixels, camera->num_frames});
    return task;
  }

  static void SetOutput(PipelineStage* stage) {
    const auto keep = std::find_if(stage->options.begin(), stage->options.end(),
                                   [](const LineOption& option) { return option.name == "keep"; });
    if (keep != stage->options.end()) {
      keep->values = {stage->output};
    } else {
      stage->options.push_back({"out", {stage->output}});
    }
  }

  /// A name of a folder; cameras may have any name.
  std::string Place(const StagePart& part) const {
    const std::string text = ToString(part);
    const auto at = std::find_if(cameras_.begin(), cameras_.end(), [&](const CutCamera& c) { return c.name == part.camera; });
    return std::to_string(at - cameras_.begin()) + "-" + Sha256Hex(text.data(), text.size()).substr(0, 12);
  }

  const PipelineStage& stage_;
  const std::vector<CutCamera> cameras_;
  const double task_s_;
  const std::string folder_;
  double scale_ = 1;  ///< of what the rates foretell to what was measured
  double total_s_ = 0;
};

}  // namespace

PartsByStage CutStages(const PlanOptions& options, const std::vector<const PipelineStage*>& chosen, const StageRecords& earlier,
                       const std::string& folder) {
  if (!(options.task_seconds >= 0)) throw UsageError("option 'task-seconds' must be at least 0");
  PartsByStage parts;
  if (options.task_seconds == 0) return parts;
  const dataset::Session session = dataset::ReadSession(options.pipeline.session, options.pipeline.allow_outside);
  for (const PipelineStage* stage : chosen) {
    if (!CanBeCut(*stage)) continue;
    std::vector<CutCamera> cameras;
    for (const dataset::SessionFootage& footage : dataset::TakeOf(session, stage->take).footage)
      cameras.push_back(CameraOf(session, footage, options.pipeline.allow_outside));
    const auto last = earlier.find(stage->name());
    const double measured_s = SecondsOf(last == earlier.end() ? nullptr : &last->second);
    auto levels = StageCutter(*stage, std::move(cameras), measured_s, options.task_seconds, folder).Cut();
    if (!levels.empty()) parts[stage->name()] = std::move(levels);
  }
  return parts;
}

}  // namespace mvstudio::stages
