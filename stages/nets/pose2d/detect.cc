#include "stages/nets/pose2d/detect.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <mutex>

#include "core/disk/kept_key.h"
#include "core/disk/manifest.h"
#include "core/error.h"
#include "core/log.h"
#include "core/parallel.h"
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

void DetectCamera(const DetectJob& job, const dataset::CameraFootage& footage, const PoseBackend& backend,
                  const std::function<void()>& on_frame, CameraPoses* camera) {
  const TimeSteps time_steps(footage);
  const std::unique_ptr<dataset::FrameSource> source = dataset::OpenFrames(footage.path, {true, false, true});
  detect::PoseTracker tracker(*backend.net, backend.finder.get(), job.options, backend.plan);
  const int64_t between = std::max<int64_t>(1, source->num_frames() / std::max(1, job.overlays));
  const auto seconds_since = [](std::chrono::steady_clock::time_point start) {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  };
  for (int64_t position = 0;; ++position) {
    const auto reading = std::chrono::steady_clock::now();
    std::optional<dataset::FrameSource::Frame> frame = source->Advance();
    if (!frame || (job.max_frames > 0 && camera->frames >= job.max_frames)) break;
    std::vector<int> numbers = time_steps.Of(frame->number);
    on_frame();
    if (!job.frames.empty()) {
      if (!numbers.empty() && numbers.front() > job.frames.back()) break;
      camera->numbers.insert(camera->numbers.end(), numbers.begin(), numbers.end());
      const auto other = [&](int number) { return !std::binary_search(job.frames.begin(), job.frames.end(), number); };
      numbers.erase(std::remove_if(numbers.begin(), numbers.end(), other), numbers.end());
    }
    if (position < job.first || position % job.every != 0 || numbers.empty()) continue;
    const Image rgb = source->FullImage();
    camera->read_s += seconds_since(reading);
    const auto start = std::chrono::steady_clock::now();
    const std::vector<Person2d> people = Poses(tracker.Next(rgb));
    camera->seconds += seconds_since(start);
    for (const int number : numbers) camera->track.frames[number] = people;
    camera->width = rgb.width, camera->height = rgb.height;
    camera->frames += 1;
    camera->frames_with_people += !people.empty();
    if (static_cast<int>(camera->overlays.size()) < job.overlays && position % between == 0) {
      camera->overlays[numbers[0]] = detect::DrawPoses(rgb, people, backend.net->skeleton());
    }
  }
  camera->damage = source->Damage();
}

/// False: the camera's failure says why.
bool DetectOrFail(const DetectJob& job, const dataset::CameraFootage& footage, const PoseBackend& backend,
                  const std::function<void()>& on_frame, CameraPoses* camera) {
  try {
    DetectCamera(job, footage, backend, on_frame, camera);
  } catch (const IoError& error) {
    camera->failure = error.what();
  } catch (const FormatError& error) {
    camera->failure = error.what();
  }
  return camera->failure.empty();
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

/// What the camera gave in an earlier run.
std::optional<CameraPoses> KeptCamera(const KeptResults& kept, const std::string& key) {
  const std::optional<std::string> bytes = kept.Load(key);
  if (!bytes) return std::nullopt;
  try {
    return DecodeCameraPoses(*bytes);
  } catch (const DamagedBytes&) {
    kept.Damaged(key);
  }
  return std::nullopt;
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
  const KeptResults kept(job.cache, "keypoints");
  std::mutex mutex;
  ParallelFor(count, threads, [&](int64_t c) {
    detect::SetGraphThreads(std::max(1, threads / std::max(1, count)));
    const auto idx = static_cast<size_t>(c);
    const auto on_frames = [&](int64_t frames) {
      const std::lock_guard<std::mutex> lock(mutex);
      stage.Advance(frames);
    };
    const auto key = kept.enabled() ? CameraPosesKey(job, job.footage[idx], backend) : std::nullopt;
    if (auto before = key ? KeptCamera(kept, *key) : std::nullopt) {
      Log(LogLevel::kInfo, "camera " + job.footage[idx].camera + ": its keypoints were kept from an earlier run");
      cameras[idx] = std::move(*before);
      on_frames(cameras[idx].frames * int64_t{job.every});
    } else if (DetectOrFail(
                   job, job.footage[idx], backend, [&] { on_frames(1); }, &cameras[idx]) &&
               key) {
      kept.Store(*key, EncodeCameraPoses(cameras[idx]));
    }
    cameras[idx].track.camera = job.footage[idx].camera;
  });
  return cameras;
}

}  // namespace mvstudio::stages
