#include "stages/nets/pose2d/detect.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <mutex>

#include "core/disk/kept_key.h"
#include "core/disk/manifest.h"
#include "core/error.h"
#include "core/parallel.h"
#include "core/stopwatch.h"
#include "dataset/detect/joints/pose_overlay.h"
#include "dataset/detect/models/models.h"
#include "dataset/footage/frames.h"
#include "stages/nets/pose2d/kept.h"

namespace mvstudio::stages {

using dataset::Person2d;

namespace {

constexpr std::string_view kOnnx = "onnx:";

/// Frame number of the footage -> time steps that show it.
class TimeSteps {
 public:
  explicit TimeSteps(const dataset::CameraFootage& footage) {
    const dataset::CameraTimeline* times = footage.timeline ? footage.timeline->Find(footage.camera) : nullptr;
    known_ = times != nullptr;
    if (!times) return;
    for (size_t i = 0; i < times->frame_at.size(); ++i) {
      if (times->frame_at[i] >= 0) of_frame_[times->frame_at[i]].push_back(static_cast<int>(i));
    }
  }
  std::vector<int> Of(int64_t frame) const {
    if (!known_) return {static_cast<int>(frame)};
    const auto found = of_frame_.find(frame);
    return found == of_frame_.end() ? std::vector<int>() : found->second;
  }

 private:
  bool known_ = false;
  std::map<int64_t, std::vector<int>> of_frame_;
};

std::vector<Person2d> Poses(const std::vector<detect::TrackedPerson>& people) {
  std::vector<Person2d> poses;
  for (const detect::TrackedPerson& person : people) poses.push_back(person.pose);
  return poses;
}

/// One camera's footage, block after block.
class CameraBlocks {
 public:
  CameraBlocks(const DetectJob& job, const dataset::CameraFootage& footage, const PoseBackend& backend)
      : job_(job), footage_(footage), backend_(backend), time_steps_(footage) {}

  /// The next block; frames before it are passed over. At most `most` frames of it are looked at.
  void Detect(int64_t number, int64_t most, const std::function<void()>& on_frame, PoseBlock* block) {
    if (!source_) source_ = dataset::OpenFrames(footage_.path, {true, false, true});
    while (position_ < number * kKeptBlock && source_->Advance()) ++position_;
    const size_t told = source_->Damage().size();
    detect::PoseTracker tracker(*backend_.net, backend_.finder.get(), job_.options, backend_.plan);
    block->ended = position_ < number * kKeptBlock;
    while (!block->ended && position_ < (number + 1) * kKeptBlock) {
      block->ended = !Next(&tracker, most, on_frame, &block->poses);
      block->positions += !block->ended;
    }
    const std::vector<std::string> damage = source_->Damage();
    block->poses.damage.assign(damage.begin() + static_cast<std::ptrdiff_t>(told), damage.end());
  }

 private:
  /// False: there is none, or none that was asked for.
  bool Next(detect::PoseTracker* tracker, int64_t most, const std::function<void()>& on_frame, CameraPoses* camera) {
    const Stopwatch reading;
    std::optional<dataset::FrameSource::Frame> frame = source_->Advance();
    if (!frame || camera->frames >= most) return false;
    const int64_t position = position_++;
    std::vector<int> numbers = time_steps_.Of(frame->number);
    on_frame();
    if (!job_.frames.empty()) {
      if (!numbers.empty() && numbers.front() > job_.frames.back()) return false;
      camera->numbers.insert(camera->numbers.end(), numbers.begin(), numbers.end());
      const auto other = [&](int number) { return !std::binary_search(job_.frames.begin(), job_.frames.end(), number); };
      numbers.erase(std::remove_if(numbers.begin(), numbers.end(), other), numbers.end());
    }
    if (position < job_.first || position % job_.every != 0 || numbers.empty()) return true;
    const Image rgb = source_->FullImage();
    camera->read_s += reading.Seconds();
    Look(rgb, position, numbers, tracker, camera);
    return true;
  }

  void Look(const Image& rgb, int64_t position, const std::vector<int>& numbers, detect::PoseTracker* tracker,
            CameraPoses* camera) const {
    const Stopwatch watch;
    const std::vector<Person2d> people = Poses(tracker->Next(rgb));
    camera->seconds += watch.Seconds();
    for (const int number : numbers) camera->track.frames[number] = people;
    camera->width = rgb.width, camera->height = rgb.height;
    camera->frames += 1;
    camera->frames_with_people += !people.empty();
    const int64_t between = std::max<int64_t>(1, source_->num_frames() / std::max(1, job_.overlays));
    if (static_cast<int>(camera->overlays.size()) < job_.overlays && position % between == 0)
      camera->overlays[numbers[0]] = detect::DrawPoses(rgb, people, backend_.net->skeleton());
  }

  const DetectJob& job_;
  const dataset::CameraFootage& footage_;
  const PoseBackend& backend_;
  TimeSteps time_steps_;
  std::unique_ptr<dataset::FrameSource> source_;
  int64_t position_ = 0;  ///< of the next frame
};

/// What a block adds to a camera.
void AppendBlock(CameraPoses block, int overlays, CameraPoses* camera) {
  for (auto& [frame, people] : block.track.frames) camera->track.frames[frame] = std::move(people);
  for (auto& [frame, image] : block.overlays) {
    if (static_cast<int>(camera->overlays.size()) < overlays) camera->overlays[frame] = std::move(image);
  }
  camera->damage.insert(camera->damage.end(), block.damage.begin(), block.damage.end());
  camera->numbers.insert(camera->numbers.end(), block.numbers.begin(), block.numbers.end());
  camera->frames += block.frames, camera->frames_with_people += block.frames_with_people;
  if (block.width > 0) camera->width = block.width, camera->height = block.height;
  camera->seconds += block.seconds, camera->read_s += block.read_s;
}

/// A block of an earlier run.
std::optional<PoseBlock> KeptBlock(const KeptResults& kept, const std::string& key) {
  const std::optional<std::string> bytes = kept.Load(key);
  if (!bytes) return std::nullopt;
  try {
    return DecodePoseBlock(*bytes);
  } catch (const DamagedBytes&) {
    kept.Damaged(key);
  }
  return std::nullopt;
}

/// `base`: of the blocks' keys; nothing: they are not kept.
void DetectCamera(const DetectJob& job, const dataset::CameraFootage& footage, const PoseBackend& backend,
                  const std::optional<std::string>& base, const std::function<void(int64_t)>& on_frames, CameraPoses* camera) {
  const KeptResults kept(job.cache, kPosesKind);
  CameraBlocks blocks(job, footage, backend);
  bool ended = false;
  for (int64_t number = job.first_block; number < job.end_block && !ended; ++number) {
    const std::string key = base ? BlockKey(*base, number) : "";
    std::optional<PoseBlock> block = base ? KeptBlock(kept, key) : std::nullopt;
    if (block) {
      on_frames(block->positions);
    } else {
      block.emplace();
      const int64_t most = job.max_frames > 0 ? job.max_frames - camera->frames : std::numeric_limits<int64_t>::max();
      try {
        blocks.Detect(
            number, most, [&] { on_frames(1); }, &*block);
      } catch (const Error&) {
        AppendBlock(std::move(block->poses), job.overlays, camera);
        throw;
      }
      if (base) kept.Store(key, EncodePoseBlock(*block));
    }
    ended = block->ended;
    AppendBlock(std::move(block->poses), job.overlays, camera);
  }
}

/// The camera's failure says why there is no result.
void DetectOrFail(const DetectJob& job, const dataset::CameraFootage& footage, const PoseBackend& backend,
                  const std::optional<std::string>& base, const std::function<void(int64_t)>& on_frames, CameraPoses* camera) {
  try {
    DetectCamera(job, footage, backend, base, on_frames, camera);
  } catch (const IoError& error) {
    camera->failure = error.what();
  } catch (const FormatError& error) {
    camera->failure = error.what();
  }
}

/// Frames that will be looked at, as the footage itself says; 0 where one of the cameras does not.
int64_t NumFrames(const DetectJob& job) {
  int64_t total = 0;
  for (const dataset::CameraFootage& footage : job.footage) {
    try {
      int64_t frames = dataset::DescribeFootage(footage.path).num_frames;
      if (frames <= 0) return 0;
      if (job.max_frames > 0) frames = std::min(frames, int64_t{job.max_frames} * job.every);
      total += frames;
    } catch (const Error&) {  // its camera says why
    }
  }
  return total;
}

/// Which nets these are: the package's files are held against its hashes when they are read.
std::string WeightsOf(const PoseBackend& backend, const detect::OnnxOptions& onnx) {
  KeptKey key;
  key.Add(detect::PinnedModelPackage().integrity + (backend.finder ? " with finder" : ""));
  key.Add(backend.name);
  if (backend.name.rfind(kOnnx, 0) == 0) {
    key.Add(mvstudio::DigestOf(backend.name.substr(kOnnx.size())).sha256);
    key.AddFields(onnx);
  }
  return key.Take();
}

}  // namespace

PoseBackend OpenPoseBackend(const std::string& name, const std::string& models, detect::PoseQuality quality,
                            const detect::OnnxOptions& onnx) {
  PoseBackend backend;
  backend.name = name;
  backend.plan = detect::PlanOf(quality);
  if (name == "posenet") {
    backend.net = detect::OpenPosenet(models, backend.plan.posenet_px);
  } else if (name == "movenet") {
    backend.net = detect::OpenMovenet(models);
  } else if (name == "blazepose") {
    backend.net = detect::OpenBlazepose(models);
  } else if (name.rfind(kOnnx, 0) == 0) {
    backend.net = detect::OpenOnnx(name.substr(kOnnx.size()), onnx);
  } else {
    throw UsageError("option 'backend' " + name + ": must be auto, posenet, movenet, blazepose, onnx:FILE or openpose:FOLDER");
  }
  const bool bring_finder = name.rfind(kOnnx, 0) != 0 || detect::HasModel("posenet", models);
  if (bring_finder) backend.finder = std::make_shared<detect::PersonFinder>(models);
  backend.weights = WeightsOf(backend, onnx);
  return backend;
}

std::vector<std::string> InstalledPoseBackends(const std::string& models) {
  detect::ReadModel("posenet", models);  // finds the people for every net; says what to do when it is not there
  std::vector<std::string> names = {"posenet"};
  if (detect::HasModel("movenet-thunder", models)) names.insert(names.begin(), "movenet");
  return names;
}

std::vector<CameraPoses> DetectPoses(const DetectJob& job, const PoseBackend& backend, const RunContext& run) {
  const int threads = ResolveThreads(run.num_threads);
  const auto count = static_cast<int>(job.footage.size());
  std::vector<CameraPoses> cameras(job.footage.size());
  ProgressStage stage(run, "keypoints by " + backend.name, NumFrames(job));
  const bool keeps = KeptResults(job.cache, kPosesKind).enabled() && job.max_frames == 0 && job.first == 0;
  std::mutex mutex;
  ParallelFor(count, threads, [&](int64_t c) {
    detect::SetGraphThreads(std::max(1, threads / std::max(1, count)));
    const auto idx = static_cast<size_t>(c);
    const auto on_frames = [&](int64_t frames) {
      const std::lock_guard<std::mutex> lock(mutex);
      stage.Advance(frames);
    };
    const auto base = keeps ? CameraPosesKey(job, job.footage[idx], backend) : std::nullopt;
    DetectOrFail(job, job.footage[idx], backend, base, on_frames, &cameras[idx]);
    cameras[idx].track.camera = job.footage[idx].camera;
  });
  return cameras;
}

}  // namespace mvstudio::stages
