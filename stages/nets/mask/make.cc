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

dataset::HullSummary CompareWithHull(const MaskJob& job, const std::string& folder, const std::vector<int>& time_steps,
                                     const RunContext& run) {
  std::vector<VisualHull> hulls(time_steps.size());
  ProgressStage stage(run, "visual hulls", static_cast<int64_t>(time_steps.size()));
  std::mutex mutex;
  ParallelFor(static_cast<int64_t>(time_steps.size()), run.num_threads, [&](int64_t i) {
    hulls[i] = Carve(job, time_steps[i], ReadMasks(job, folder, time_steps[i]));
    hulls[i].cells.clear();
    const std::lock_guard<std::mutex> lock(mutex);
    stage.Advance();
  });
  dataset::HullSummary summary;
  for (const VisualHull& hull : hulls) summary.Add(hull);
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

struct TakePass {
  std::vector<MaskCameraResult> cameras;
  std::vector<int> time_steps;  ///< that any camera has, ascending
  std::vector<int> shared;      ///< those that most cameras have: all, unless one has none of the others' frames
};

MaskCameraResult SegmentCamera(const MaskJob& job, const MaskCamera& camera, const MaskBackend& backend,
                               const CameraMaskModel& model, const std::string& folder, const std::string& room,
                               const std::function<void(int)>& on_frame) {
  const std::string& name = camera.footage.camera;
  MakeFolder(folder + "/" + name);
  if (job.run.soft) MakeFolder(folder + "/soft/" + name);
  std::vector<dataset::SheetTile> tiles;
  const int every = std::max(1, camera.num_wanted() / std::max(1, job.run.sheet_tiles));
  int position = 0;
  const auto possible = [&](int frame) {
    const std::string path = MaskPath(room, name, frame);
    return fs::exists(path) ? dataset::ReadImage(path, true) : Image();
  };
  MaskCameraResult result;
  result.background_known = model.background.KnownFraction();
  const int tile_px = job.run.sheet_tiles > 40 ? 110 : 240;
  result.take = dataset::SegmentTake(
      camera.footage.path, camera.bodies, NetOf(backend), model, room.empty() ? std::function<Image(int)>() : possible,
      [&](int frame, const Image& rgb, const BodyMask& mask) {
        dataset::WriteImage(mask.mask, MaskPath(folder, name, frame));
        if (job.run.soft) dataset::WriteImage(mask.soft, MaskPath(folder + "/soft", name, frame));
        if (position % every == every / 2 && int(tiles.size()) < job.run.sheet_tiles) {
          const Image one = dataset::ContactSheet({{rgb, mask.mask, {}}}, 1, tile_px, true);
          tiles.push_back({one, Image(one.width, one.height, 1, 0), {}});
        }
        ++position;
        on_frame(frame);
      },
      job.mask, job.run.keep_undamaged, camera.wanted ? &*camera.wanted : nullptr);
  if (!tiles.empty()) result.sheet = dataset::ContactSheet(tiles, job.run.sheet_tiles > 40 ? 14 : 6, tile_px + 8, false);
  return result;
}

TakePass SegmentAll(const MaskJob& job, const MaskBackend& backend, const std::vector<CameraMaskModel>& models,
                    const std::string& folder, const std::string& room, const RunContext& run) {
  TakePass pass;
  pass.cameras.resize(job.cameras.size());
  int64_t total = 0;
  for (const MaskCamera& camera : job.cameras) total += camera.num_wanted();
  ProgressStage stage(run, room.empty() ? "masks" : "masks within the visual hull", total);
  std::mutex mutex;
  std::map<int, int> seen;
  ParallelFor(static_cast<int64_t>(job.cameras.size()), run.num_threads, [&](int64_t c) {
    pass.cameras[c] = SegmentCamera(job, job.cameras[c], backend, models[c], folder, room, [&](int frame) {
      const std::lock_guard<std::mutex> lock(mutex);
      ++seen[job.cameras[c].TimeStepOf(frame)];
      stage.Advance();
    });
  });
  int most = 0;
  for (const auto& [time_step, count] : seen) {
    if (time_step < 0) continue;
    pass.time_steps.push_back(time_step);
    if (count > most) most = count, pass.shared.clear();
    if (count == most) pass.shared.push_back(time_step);
  }
  return pass;
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
    learned[c] =
        dataset::LearnTakeCamera(camera.samples, camera.bodies, net, camera.plate.empty() ? nullptr : &camera.plate, job.mask);
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

MaskRunResult MakeMasks(const MaskJob& job, const MaskBackend& backend, const std::vector<CameraMaskModel>& models,
                        const std::string& folder, const RunContext& run) {
  TakePass pass = SegmentAll(job, backend, models, folder, "", run);
  const bool together = job.has_calibration() && job.cameras.size() > 1;
  if (job.run.hull && together) {
    const ScratchFolder room(folder);
    WriteRoom(job, folder, room.path(), pass.time_steps, run);
    pass = SegmentAll(job, backend, models, folder, room.path(), run);
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
