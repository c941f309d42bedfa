#include "synth/subject.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "core/parallel.h"
#include "synth/motion.h"
#include "synth/read_body.h"

namespace mvstudio::synth {
namespace {

constexpr double kWarmUpS = 2, kBlendS = 1;  // s before a clip; the first part leads from the rest pose into the motion
constexpr double kShortestTurnS = 4;         // s once around; shorter takes end before
constexpr double kSkinHz = 125;              // the body is skinned at least as often; between, it moves in straight lines
constexpr int kStepsPerSkin = 8;             // of the cloth

}  // namespace

Subject::Subject(const SynthOptions& options, uint64_t seed) : options_(options), seed_(seed) {
  GivenBody given;
  if (options.body.empty()) {
    given.body = body::MakeMannequin(options.person_height_m);
  } else {
    given = ReadBody(options.body);
  }
  body_ = std::move(given.body);
  textures_ = given.textures ? *given.textures : body::MannequinTextures(options.texture_px, seed);
  if (options.subject == SubjectKind::kCloth) cloth_ = std::make_unique<ClothSubject>(body_, seed);
}

body::BodyPose Subject::PoseAt(int clip, double time_s) const {
  if (clip > 0) return PersonPose(body_, time_s, seed_ + 1);
  if (options_.take_motion == TakeMotion::kWalk) return PersonPose(body_, time_s, seed_);
  return TurnPose(body_, time_s, std::max(kShortestTurnS, options_.take_frames / options_.fps), seed_);
}

/// Before the clip: from the rest pose into the motion.
body::BodyPose Subject::WarmUpPose(int clip, double time_s) const {
  const body::BodyPose pose = PoseAt(clip, time_s);
  const double t = std::clamp((time_s + kWarmUpS) / kBlendS, 0.0, 1.0), share = t * t * (3 - 2 * t);
  std::vector<Eigen::Quaterniond> turns;
  geometry::Rigid3 world_from_body;
  for (size_t b = 0; b < pose.bone_transforms.size(); ++b) {
    const int parent = body_.bone_parents[b];
    if (parent < 0) {
      world_from_body = pose.bone_transforms[b];
      turns.push_back(Eigen::Quaterniond::Identity());
      continue;
    }
    const Eigen::Quaterniond local = pose.bone_transforms[parent].rotation.conjugate() * pose.bone_transforms[b].rotation;
    turns.push_back(Eigen::Quaterniond::Identity().slerp(share, local));
  }
  return body::PoseFromAngles(body_, world_from_body, turns);
}

Status Subject::WarmUp(int clip) {
  const int skins = static_cast<int>(std::ceil(kWarmUpS * kSkinHz));
  const double skin_s = kWarmUpS / skins;
  Status status = cloth_->Reset(WarmUpPose(clip, -kWarmUpS));
  for (int i = 1; i <= skins && status == Status::kOk; ++i)
    status = cloth_->Advance(WarmUpPose(clip, -kWarmUpS + i * skin_s), kStepsPerSkin, skin_s / kStepsPerSkin);
  return status;
}

Status Subject::MoveCloth(int frame_idx, Frame* frame) {
  const int clip = frame_idx < options_.take_frames ? 0 : 1, in_clip = frame_idx - (clip ? options_.take_frames : 0);
  if (in_clip == 0) {
    Status status = clip == 0 ? cloth_->Settle() : Status::kOk;
    if (status == Status::kOk) status = WarmUp(clip);
    if (status != Status::kOk) return status;
  } else {
    const int skins = static_cast<int>(std::ceil(kSkinHz / options_.fps));
    const double skin_s = 1 / (options_.fps * skins);
    for (int i = 1; i <= skins; ++i) {
      const double time_s = (in_clip - 1) / options_.fps + i * skin_s;
      const Status status =
          cloth_->Advance(i == skins ? frame->pose : PoseAt(clip, time_s), kStepsPerSkin, skin_s / kStepsPerSkin);
      if (status != Status::kOk) return status;
    }
  }
  frame->vertices = cloth_->vertices();
  frame->skinned = cloth_->Skinned(frame->pose);
  return Status::kOk;
}

Subject::Frames Subject::Next(int first, int last, int num_threads) {
  Frames out;
  out.frames.resize(last - first);
  ParallelFor(last - first, num_threads, [&](int64_t i) {
    const int frame_idx = first + static_cast<int>(i), clip = frame_idx < options_.take_frames ? 0 : 1;
    Frame& frame = out.frames[i];
    frame.pose = PoseAt(clip, static_cast<double>(frame_idx - (clip ? options_.take_frames : 0)) / options_.fps);
    if (!cloth_) frame.vertices = body::SkinVertices(body_, frame.pose);
  });
  for (int f = first; cloth_ && f < last; ++f) {
    out.status = MoveCloth(f, &out.frames[f - first]);
    if (out.status == Status::kOk) continue;
    out.frames.resize(f - first);
    break;
  }
  return out;
}

}  // namespace mvstudio::synth
