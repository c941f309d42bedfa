#include "synth/cloth/cloth_subject.h"

namespace mvstudio::synth {
namespace {

Cut CutOf(uint64_t seed) {
  Cut cut;
  cut.seed = seed;
  return cut;
}

/// The garments of a dressed body without the body.
body::BodyTemplate ClothAlone(const DressedBody& dressed) {
  body::BodyTemplate cloth = dressed.surface;
  const Eigen::Index count = cloth.vertices.cols() - dressed.body_vertices;
  cloth.vertices = dressed.surface.vertices.rightCols(count);
  cloth.skin_bones = dressed.surface.skin_bones.rightCols(count);
  cloth.skin_weights = dressed.surface.skin_weights.rightCols(count);
  cloth.faces.resize(3, 0);
  return cloth;
}

}  // namespace

ClothSubject::ClothSubject(const body::BodyTemplate& body, uint64_t seed)
    : dressed_(Dress(body, CutOf(seed))),
      muscles_(body),
      sim_(dressed_),
      swollen_(dressed_.naked),
      cloth_(ClothAlone(dressed_)) {}

Eigen::Matrix3Xf ClothSubject::Skinned(const body::BodyPose& pose) const { return body::SkinVertices(dressed_.surface, pose); }

/// Skin and pinned cloth of `vertices_`.
void ClothSubject::MoveBody(const body::BodyPose& pose) {
  swollen_.vertices = dressed_.naked.vertices + muscles_.Swelling(pose);
  vertices_.resize(3, dressed_.surface.vertices.cols());
  vertices_ << body::SkinVertices(swollen_, pose), body::SkinVertices(cloth_, pose);
}

Status ClothSubject::Settle() {
  constexpr double kCallS = 0.008;
  constexpr int kSteps = 8;
  const body::BodyPose rest = body::PoseFromAngles(
      dressed_.naked, {}, std::vector<Eigen::Quaterniond>(dressed_.naked.bone_names.size(), Eigen::Quaterniond::Identity()));
  Status status = Reset(rest);
  for (int i = 0; i < kSettleS / kCallS && status == Status::kOk; ++i) status = Advance(rest, kSteps, kCallS / kSteps);
  if (status != Status::kOk) return status;
  cloth_.vertices = sim_.positions().cast<float>();
  dressed_.surface.vertices.rightCols(cloth_.vertices.cols()) = cloth_.vertices;
  return Status::kOk;
}

Status ClothSubject::Reset(const body::BodyPose& pose) {
  MoveBody(pose);
  return sim_.Reset(vertices_);
}

Status ClothSubject::Advance(const body::BodyPose& pose, int steps, double step_s) {
  MoveBody(pose);
  const Status status = sim_.Advance(vertices_, steps, step_s);
  if (status == Status::kOk) vertices_.rightCols(sim_.positions().cols()) = sim_.positions().cast<float>();
  return status;
}

}  // namespace mvstudio::synth
