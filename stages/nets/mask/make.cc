#include "stages/nets/mask/make.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <mutex>

#include "core/disk/files.h"
#include "core/disk/output.h"
#include "core/error.h"
#include "core/format.h"
#include "core/parallel.h"
#include "dataset/footage/image_io.h"
#include "dataset/masks/sheet.h"
#include "stages/nets/mask/kept.h"

namespace mvstudio::stages {
namespace fs = std::filesystem;
namespace {

using dataset::BodyMask;
using dataset::CameraMaskModel;
using dataset::HullView;
using dataset::ProjectedBody;
using dataset::VisualHull;

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

/// Evenly chosen, at most `count`.
std::vector<int> Spread(const std::vector<int>& all, int count) {
  const int n = static_cast<int>(all.size()), k = std::min(count, n);
  std::vector<int> chosen;
  for (int i = 0; i < k; ++i) chosen.push_back(all[size_t(2 * i + 1) * n / (2 * k)]);
  return chosen;
}

bool Sampled(const MaskCamera& camera, int time_step) {
  const std::vector<int>& numbers = camera.samples.numbers;
  return std::find(numbers.begin(), numbers.end(), camera.FrameAt(time_step)) != numbers.end();
}

/// Time steps that every camera sampled.
std::vector<int> CommonSamples(const MaskJob& job) {
  std::vector<int> common;
  for (const int frame : job.cameras[0].samples.numbers) {
    const int time_step = job.cameras[0].TimeStepOf(frame);
    const bool all = std::all_of(job.cameras.begin(), job.cameras.end(),
                                 [&](const MaskCamera& camera) { return Sampled(camera, time_step); });
    if (time_step >= 0 && all) common.push_back(time_step);
  }
  return common;
}

VisualHull Carve(const MaskJob& job, int time_step, const std::vector<Image>& masks) {
  std::vector<HullView> views;
  for (size_t c = 0; c < job.cameras.size(); ++c) views.push_back({&*job.cameras[c].camera, &masks[c]});
  const auto people = job.poses.find(time_step);
  dataset::HullBox box{Status::kTooFewViews, {}, 0};
  if (people != job.poses.end()) box = dataset::BoxOfJoints(people->second);
  if (box.status != Status::kOk) box = dataset::BoxOfMasks(views);
  return dataset::CarveHull(views, box, job.hull);
}

/// Masks of every camera at one time step, from the files; empty images where a file is missing.
std::vector<Image> ReadMasks(const MaskJob& job, const std::string& folder, int time_step) {
  std::vector<Image> masks;
  for (const MaskCamera& camera : job.cameras) {
    const std::string path = MaskPath(folder, camera.footage.camera, camera.FrameAt(time_step));
    masks.push_back(fs::exists(path) ? dataset::ReadImage(path, true)
                                     : Image(camera.samples.width, camera.samples.height, 1, 0));
  }
  return masks;
}

std::vector<VisualHull> HullsOf(const MaskJob& job, const std::string& folder, const std::vector<int>& steps,
                                const RunContext& run) {
  std::vector<VisualHull> hulls(steps.size());
  ProgressStage stage(run, "visual hulls", static_cast<int64_t>(steps.size()));
  std::mutex mutex;
  ParallelFor(static_cast<int64_t>(steps.size()), run.num_threads, [&](int64_t i) {
    hulls[i] = Carve(job, steps[i], ReadMasks(job, folder, steps[i]));
    hulls[i].cells.clear();
    const std::lock_guard<std::mutex> lock(mutex);
    stage.Advance();
  });
  return hulls;
}

dataset::HullSummary CompareWithHull(const MaskJob& job, const std::string& folder, const std::vector<int>& steps,
                                     const RunContext& run) {
  dataset::HullSummary summary;
  for (const VisualHull& hull : HullsOf(job, folder, steps, run)) summary.Add(hull);
  return summary;
}

/// Writes where the other cameras' masks allow people, in the masks' own layout.
void WriteRoom(const MaskJob& job, const std::string& masks, const std::string& room, const std::vector<int>& time_steps,
               const RunContext& run) {
  constexpr double kMarginPx = 2.5;
  for (const MaskCamera& camera : job.cameras) MakeFolder(room + "/" + camera.footage.camera);
  ParallelFor(static_cast<int64_t>(time_steps.size()), run.num_threads, [&](int64_t i) {
    const VisualHull hull = Carve(job, time_steps[i], ReadMasks(job, masks, time_steps[i]));
    if (hull.status != Status::kOk) return;
    for (const MaskCamera& camera : job.cameras) {
      const int frame = camera.FrameAt(time_steps[i]);
      if (frame >= 0)
        dataset::WriteImage(dataset::PossiblePixels(hull, *camera.camera, kMarginPx),
                            MaskPath(room, camera.footage.camera, frame));
    }
  });
}

int TilePx(const MaskJob& job) { return job.run.sheet_tiles > 40 ? 110 : 160; }

struct TakePass {
  std::vector<MaskCameraResult> cameras;
  std::vector<int> time_steps;  ///< that any camera has, ascending
  std::vector<int> shared;      ///< those that most cameras have: all, unless one has none of the others' frames
};

/// One pass over the footage of all cameras.
struct PassPlan {
  const MaskBackend* backend = nullptr;
  std::string folder;    ///< that gets the masks; empty: they are kept alone
  std::string room;      ///< folder of where the others allow people; empty: anywhere
  std::string room_key;  ///< of RoomKey; empty: nothing of this pass is kept where there is a room
  int64_t first_block = 0, end_block = std::numeric_limits<int64_t>::max();
};

/// The masks of one camera, block after block.
class CameraMasker {
 public:
  CameraMasker(const MaskJob& job, const MaskCamera& camera, const CameraMaskModel& model, const PassPlan& pass)
      : job_(job),
        camera_(camera),
        ranks_(camera.wanted ? std::vector<int>(camera.wanted->begin(), camera.wanted->end()) : camera.samples.all),
        every_(std::max(1, camera.num_wanted() / std::max(1, job.run.sheet_tiles))),
        segmenter_(camera.footage.path, ToolsOf(model, pass), job.run.keep_undamaged) {}

  MaskBlock Make(int64_t number, const std::function<void()>& on_frame) {
    MaskBlock block;
    block.positions = segmenter_.Segment(
        number * kKeptBlock, (number + 1) * kKeptBlock,
        [&](int frame, const Image& rgb, const BodyMask& mask) {
          block.frames.push_back({frame, dataset::EncodeImage(mask.mask, "mask.png"), "", TileOf(frame, rgb, mask.mask)});
          if (job_.run.soft) block.frames.back().soft = dataset::EncodeImage(mask.soft, "soft.png");
          on_frame();
        },
        &block.take);
    return block;
  }

 private:
  dataset::SegmentTools ToolsOf(const CameraMaskModel& model, const PassPlan& pass) const {
    dataset::SegmentTools tools;
    tools.bodies = &camera_.bodies, tools.net = NetOf(*pass.backend), tools.model = &model, tools.options = &job_.mask;
    tools.only = camera_.wanted ? &*camera_.wanted : nullptr;
    if (pass.room.empty()) return tools;
    tools.possible = [room = pass.room, name = camera_.footage.camera](int frame) {
      const std::string path = MaskPath(room, name, frame);
      return fs::exists(path) ? dataset::ReadImage(path, true) : Image();
    };
    return tools;
  }

  /// Of the contact sheet, which shows frames spread over the take; empty for the others.
  Image TileOf(int frame, const Image& rgb, const Image& mask) const {
    const auto rank = static_cast<int>(std::lower_bound(ranks_.begin(), ranks_.end(), frame) - ranks_.begin());
    if (rank % every_ != every_ / 2 || rank / every_ >= job_.run.sheet_tiles) return {};
    return dataset::ContactSheet({{rgb, mask, {}}}, 1, TilePx(job_), true);
  }

  const MaskJob& job_;
  const MaskCamera& camera_;
  const std::vector<int> ranks_;  ///< frames that get a mask
  const int every_;
  dataset::TakeSegmenter segmenter_;
};

void WriteMaskBlock(const MaskBlock& block, const std::string& folder, const std::string& camera) {
  for (const MaskBlock::Frame& frame : block.frames) {
    WriteFileAtomic(MaskPath(folder, camera, frame.number), frame.mask);
    if (!frame.soft.empty()) WriteFileAtomic(MaskPath(folder + "/soft", camera, frame.number), frame.soft);
  }
}

Image SheetOf(const MaskJob& job, std::vector<Image> images) {
  std::vector<dataset::SheetTile> tiles;
  for (Image& one : images) {
    Image nothing(one.width, one.height, 1, 0);
    tiles.push_back({std::move(one), std::move(nothing), {}});
  }
  if (tiles.empty()) return {};
  return dataset::ContactSheet(tiles, job.run.sheet_tiles > 40 ? 14 : 6, TilePx(job) + 8, false);
}

/// Calls `on_frame` after every frame that got a mask, and `on_block` with the key of each block that is kept.
MaskCameraResult SegmentCamera(const MaskJob& job, const MaskCamera& camera, const CameraMaskModel& model, const PassPlan& pass,
                               const std::function<void()>& on_frame,
                               const std::function<void(const std::string&)>& on_block = {}) {
  const std::string& name = camera.footage.camera;
  if (!pass.folder.empty()) MakeFolder(pass.folder + "/" + name);
  if (!pass.folder.empty() && job.run.soft) MakeFolder(pass.folder + "/soft/" + name);
  const KeptResults kept(job.cache, kMasksKind);
  const bool keeps = kept.enabled() && (pass.room.empty() || !pass.room_key.empty());
  const std::string base = keeps ? MasksKey(job, camera, *pass.backend, pass.room_key) : "";
  CameraMasker masker(job, camera, model, pass);
  MaskCameraResult result;
  result.background_known = model.background.KnownFraction();
  std::vector<Image> tiles;
  for (int64_t number = pass.first_block; number < pass.end_block; ++number) {
    const std::string key = base.empty() ? "" : BlockKey(base, number);
    std::optional<MaskBlock> block = LoadKept(kept, key, DecodeMaskBlock);
    if (!block) {
      block = masker.Make(number, on_frame);
      if (!key.empty()) kept.Store(key, EncodeMaskBlock(*block));
    } else {
      for (size_t i = 0; i < block->frames.size(); ++i) on_frame();
    }
    if (!pass.folder.empty()) WriteMaskBlock(*block, pass.folder, name);
    result.take.Add(block->take);
    for (MaskBlock::Frame& frame : block->frames) {
      result.frames.push_back(frame.number);
      if (!frame.tile.empty()) tiles.push_back(std::move(frame.tile));
    }
    if (on_block && !key.empty()) on_block(key);
    if (block->positions < kKeptBlock) break;
  }
  result.sheet = SheetOf(job, std::move(tiles));
  return result;
}

TakePass SegmentAll(const MaskJob& job, const std::vector<CameraMaskModel>& models, const PassPlan& plan,
                    const RunContext& run) {
  TakePass pass;
  pass.cameras.resize(job.cameras.size());
  int64_t total = 0;
  for (const MaskCamera& camera : job.cameras) total += camera.num_wanted();
  ProgressStage stage(run, plan.room.empty() ? "masks" : "masks within the visual hull", total);
  std::mutex mutex;
  ParallelFor(static_cast<int64_t>(job.cameras.size()), run.num_threads, [&](int64_t c) {
    pass.cameras[c] = SegmentCamera(job, job.cameras[c], models[c], plan, [&] {
      const std::lock_guard<std::mutex> lock(mutex);
      stage.Advance();
    });
  });
  std::map<int, int> seen;
  for (size_t c = 0; c < pass.cameras.size(); ++c) {
    for (const int frame : pass.cameras[c].frames) ++seen[job.cameras[c].TimeStepOf(frame)];
  }
  int most = 0;
  for (const auto& [time_step, count] : seen) {
    if (time_step < 0) continue;
    pass.time_steps.push_back(time_step);
    if (count > most) most = count, pass.shared.clear();
    if (count == most) pass.shared.push_back(time_step);
  }
  return pass;
}

/// What is known of a camera, from an earlier run or learned now.
dataset::LearnedCamera LearnOrLoad(const MaskJob& job, const MaskCamera& camera, const MaskBackend& backend,
                                   const dataset::PersonNet& net) {
  const KeptResults kept(job.cache, kModelsKind);
  const std::string key = kept.enabled() ? ModelKey(job, camera, backend) : "";
  if (auto before = LoadKept(kept, key, DecodeLearned)) return std::move(*before);
  dataset::LearnedCamera learned =
      dataset::LearnTakeCamera(camera.samples, camera.bodies, net, camera.plate.empty() ? nullptr : &camera.plate, job.mask);
  if (!key.empty()) kept.Store(key, EncodeLearned(learned));
  return learned;
}

}  // namespace

int MaskCamera::FrameAt(int time_step) const {
  if (!frame_at) return time_step;
  const auto found = frame_at->find(time_step);
  return found == frame_at->end() ? -1 : found->second;
}

int MaskCamera::TimeStepOf(int frame) const {
  if (!frame_at) return frame;
  const auto found = std::find_if(frame_at->begin(), frame_at->end(), [&](const auto& entry) { return entry.second == frame; });
  return found == frame_at->end() ? -1 : found->first;
}

std::string MaskPath(const std::string& folder, const std::string& camera, int frame) {
  return folder + "/" + camera + Format("/%08d.png", frame);
}

dataset::PersonNet NetOf(const MaskBackend& backend) {
  if (!backend.net) return {};
  return [net = backend.net](const Image& rgb, const ProjectedBody* body) {
    if (!body) return net->Probability(rgb, {});
    if (body->empty()) return Image(rgb.width, rgb.height, 1, 0);
    const detect::ImageBox box = detect::BoxAround(dataset::BodyRegion(*body, rgb.width, rgb.height, 0.1), 128, 0.08);
    return box.empty() ? Image(rgb.width, rgb.height, 1, 0) : net->Probability(rgb, box);
  };
}

double MaskTrial::score() const {
  if (!failed_camera.empty()) return std::numeric_limits<double>::infinity();
  const double unsupported = std::isfinite(joints_supported) ? 1 - joints_supported : 0;
  return (std::isfinite(disagreement) ? disagreement : 0) + unsupported;
}

MaskTrial TryBackend(const MaskJob& job, const MaskBackend& backend, bool on_frames, const RunContext& run) {
  MaskTrial trial{backend.name, Status::kOk, "", kNone, kNone, {}};
  const size_t n = job.cameras.size();
  const std::vector<int> time_steps = on_frames ? Spread(CommonSamples(job), job.run.trial_frames) : std::vector<int>();
  std::vector<dataset::LearnedCamera> learned(n);
  std::vector<std::vector<BodyMask>> masks(time_steps.size(), std::vector<BodyMask>(n));
  const dataset::PersonNet net = NetOf(backend);
  ProgressStage stage(run, "learning with " + backend.name, static_cast<int64_t>(n));
  std::mutex mutex;
  ParallelFor(static_cast<int64_t>(n), run.num_threads, [&](int64_t c) {
    const MaskCamera& camera = job.cameras[c];
    learned[c] = LearnOrLoad(job, camera, backend, net);
    for (size_t i = 0; i < time_steps.size() && learned[c].status == Status::kOk; ++i) {
      const auto& own = camera.samples.numbers;
      const int frame = camera.FrameAt(time_steps[i]);
      const Image& rgb = camera.samples.frames[std::find(own.begin(), own.end(), frame) - own.begin()];
      dataset::MaskHints hints;
      hints.body = camera.bodies.At(frame);
      const Image probability = net ? net(rgb, hints.body) : Image();
      if (!probability.empty()) hints.probability = &probability;
      masks[i][c] = dataset::SegmentPeople(rgb, hints, learned[c].model, job.mask);
    }
    const std::lock_guard<std::mutex> lock(mutex);
    stage.Advance();
  });
  for (size_t c = 0; c < n; ++c) {
    if (learned[c].status != Status::kOk && trial.failed_camera.empty())
      trial.status = learned[c].status, trial.failed_camera = job.cameras[c].footage.camera;
    trial.models.push_back(std::move(learned[c].model));
  }
  if (!trial.failed_camera.empty()) return trial;
  int joints = 0, supported = 0;
  dataset::HullSummary hull;
  for (size_t i = 0; i < time_steps.size(); ++i) {
    std::vector<Image> of_frame;
    for (BodyMask& mask : masks[i]) {
      joints += mask.joints, supported += mask.joints_supported;
      of_frame.push_back(std::move(mask.mask));
    }
    if (job.has_calibration() && n > 1) hull.Add(Carve(job, time_steps[i], of_frame));
  }
  if (hull.time_steps > 0) trial.disagreement = hull.Disagreement();
  if (joints > 0) trial.joints_supported = supported / double(joints);
  return trial;
}

std::vector<std::string> KeepMasks(const MaskJob& job, const MaskCamera& camera, const MaskBackend& backend,
                                   const CameraMaskModel& model, int64_t first_block, int64_t end_block,
                                   const RunContext& run) {
  ProgressStage stage(run, "masks", camera.num_wanted());
  std::vector<std::string> keys;
  SegmentCamera(
      job, camera, model, {&backend, "", "", "", first_block, end_block}, [&] { stage.Advance(); },
      [&](const std::string& key) { keys.push_back(std::string(kMasksKind) + "/" + key); });
  return keys;
}

std::vector<double> HullDisagreements(const MaskJob& job, const std::string& folder, const std::vector<int>& steps,
                                      const RunContext& run) {
  std::vector<double> disagreements;
  for (const VisualHull& hull : HullsOf(job, folder, steps, run)) {
    dataset::HullSummary one;
    one.Add(hull);
    disagreements.push_back(one.skipped == 0 ? one.Disagreement() : kNone);
  }
  return disagreements;
}

MaskRunResult MakeMasks(const MaskJob& job, const MaskBackend& backend, const std::vector<CameraMaskModel>& models,
                        const std::string& folder, const RunContext& run) {
  TakePass pass = SegmentAll(job, models, {&backend, folder, "", ""}, run);
  const bool together = job.has_calibration() && job.cameras.size() > 1;
  if (job.run.hull && together) {
    const ScratchFolder room(folder);
    WriteRoom(job, folder, room.path(), pass.time_steps, run);
    pass = SegmentAll(job, models, {&backend, folder, room.path(), RoomKey(job, backend)}, run);
  }
  MaskRunResult result;
  result.cameras = std::move(pass.cameras);
  if (together && job.run.hull_frames > 0) {
    result.hull = CompareWithHull(job, folder, Spread(pass.shared, job.run.hull_frames), run);
    result.disagreeing = result.hull.Disagreeing(job.hull.most_outside);
  }
  return result;
}

}  // namespace mvstudio::stages
