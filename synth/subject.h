#pragma once

#include <array>
#include <memory>
#include <optional>
#include <vector>

#include "avatar/body/body_template.h"
#include "core/status.h"
#include "synth/cloth/cloth_subject.h"
#include "synth/studio.h"

namespace mvstudio::synth {

/// What moves in the take, frame by frame.
class Subject {
 public:
  /// Throws as ReadBody (synth/read_body.h) and Dress do.
  Subject(const SynthOptions& options, uint64_t seed);

  const body::BodyTemplate& naked() const { return cloth_ ? cloth_->dressed().naked : body_; }
  /// Its rest pose is final after the first frame: the cloth has settled then.
  const body::BodyTemplate& surface() const { return cloth_ ? cloth_->dressed().surface : body_; }
  /// Null without cloth.
  const DressedBody* dressed() const { return cloth_ ? &cloth_->dressed() : nullptr; }
  const std::array<Image, body::kNumParts>& textures() const { return textures_; }

  struct Frame {
    body::BodyPose pose;
    Eigen::Matrix3Xf vertices;  // (3, V) of surface(), in world
    Eigen::Matrix3Xf skinned;   // the same by skinning alone; empty where that is all there is
  };
  /// Frames [first, last) of the take; each call begins where the last one ended. `status` is not kOk when the cloth gave no
  /// place: then `frames` ends before the frame that failed.
  struct Frames {
    Status status = Status::kOk;
    std::vector<Frame> frames;
  };
  Frames Next(int first, int last, int num_threads);

 private:
  body::BodyPose PoseAt(int clip, double time_s) const;
  body::BodyPose WarmUpPose(int clip, double time_s) const;
  Status WarmUp(int clip);
  Status MoveCloth(int frame_idx, Frame* frame);

  const SynthOptions options_;
  const uint64_t seed_;
  body::BodyTemplate body_;
  std::array<Image, body::kNumParts> textures_;
  std::unique_ptr<ClothSubject> cloth_;
};

}  // namespace mvstudio::synth
