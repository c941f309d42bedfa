#include "stages/nets/pose2d/kept.h"

#include "core/disk/kept_key.h"
#include "core/join.h"

namespace mvstudio::stages {
namespace {

/// To be raised whenever nets, tracking or this layout give other results than before.
constexpr char kPosesVersion[] = "mvstudio keypoints 2";

static_assert(sizeof(dataset::Keypoint2d) == 3 * sizeof(double));

}  // namespace

std::optional<std::string> CameraPosesKey(const DetectJob& job, const dataset::CameraFootage& footage,
                                          const PoseBackend& backend) {
  if (backend.weights.empty()) return std::nullopt;
  const std::optional<std::string> content = FootageDigest(job.cache, footage.path);
  if (!content) return std::nullopt;
  KeptKey key;
  key.Add(kPosesVersion);
  key.Add(*content);
  key.Add(backend.weights);
  key.AddFields(job.options);
  key.Add(Join(std::vector<int>{job.overlays, job.every, job.max_frames}, " ", [](int n) { return std::to_string(n); }));
  key.Add(Join(job.frames, " ", [](int frame) { return std::to_string(frame); }));
  const dataset::CameraTimeline* times = footage.timeline ? footage.timeline->Find(footage.camera) : nullptr;
  if (times) key.Add(Join(times->frame_at, " ", [](int64_t frame) { return std::to_string(frame); }));
  return key.Take();
}

std::string EncodeCameraPoses(const CameraPoses& camera) {
  KeptWriter out;
  for (const int n : {camera.frames, camera.frames_with_people, camera.width, camera.height}) out.Put<int32_t>(n);
  out.Put<double>(camera.seconds);
  out.PutAll(camera.numbers.data(), camera.numbers.size());
  out.Put<uint64_t>(camera.damage.size());
  for (const std::string& line : camera.damage) out.Put(line);
  out.Put<uint64_t>(camera.track.frames.size());
  for (const auto& [frame, people] : camera.track.frames) {
    out.Put<int32_t>(frame);
    out.Put<uint64_t>(people.size());
    for (const dataset::Person2d& person : people) out.PutAll(person.keypoints.data(), person.keypoints.size());
  }
  out.Put<uint64_t>(camera.overlays.size());
  for (const auto& [frame, image] : camera.overlays) out.Put<int32_t>(frame), PutImage(image, &out);
  return out.Take();
}

CameraPoses DecodeCameraPoses(const std::string& bytes) {
  KeptReader in(bytes);
  CameraPoses camera;
  for (int* n : {&camera.frames, &camera.frames_with_people, &camera.width, &camera.height}) *n = in.Get<int32_t>();
  camera.seconds = in.Get<double>();
  camera.numbers = in.All<int>();
  for (uint64_t n = in.Count(1); n > 0; --n) camera.damage.push_back(in.Text());
  for (uint64_t n = in.Count(1); n > 0; --n) {
    std::vector<dataset::Person2d>& people = camera.track.frames[in.Get<int32_t>()];
    people.resize(in.Count(1));
    for (dataset::Person2d& person : people) person.keypoints = in.All<dataset::Keypoint2d>();
  }
  for (uint64_t n = in.Count(1); n > 0; --n) {
    const auto frame = in.Get<int32_t>();
    camera.overlays[frame] = GetImage(&in);
  }
  if (!in.AtEnd()) throw DamagedBytes();
  return camera;
}

std::string EncodePoseBlock(const PoseBlock& block) {
  KeptWriter out;
  out.Put<int64_t>(block.positions), out.Put<uint8_t>(block.ended ? 1 : 0);
  return out.Take() + EncodeCameraPoses(block.poses);
}

PoseBlock DecodePoseBlock(const std::string& bytes) {
  KeptReader in(bytes);
  PoseBlock block;
  block.positions = in.Get<int64_t>(), block.ended = in.Get<uint8_t>() != 0;
  block.poses = DecodeCameraPoses(bytes.substr(sizeof(int64_t) + 1));
  return block;
}

}  // namespace mvstudio::stages
