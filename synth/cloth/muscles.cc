#include "synth/cloth/muscles.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "avatar/body/role_bones.h"
#include "avatar/body/surface_nets.h"
#include "core/check.h"

namespace mvstudio::synth {
namespace {

using Eigen::Vector3d;

/// Where a muscle lies and how much it swells, in units of its bone and of a person of 1.75 m.
struct Kind {
  bool arm;        // of the elbow, or of the knee
  bool on_child;   // on the forearm or shin, or on the bone above
  double along;    // centre along the bone, 0 at its head
  double width;    // standard deviation of the bell along the bone
  bool inner;      // on the side to which the joint bends, or opposite
  double swell_m;  // at a right angle
};

constexpr Kind kKinds[] = {{true, false, 0.55, 0.18, true, 0.014},  {true, true, 0.24, 0.15, true, 0.007},
                           {true, false, 1.00, 0.09, false, 0.008}, {false, false, 0.62, 0.18, true, 0.014},
                           {false, true, 0.30, 0.15, true, 0.012},  {false, false, 1.00, 0.08, false, 0.010}};

/// How much of the muscle a rest position has, 0 to 1.
double Share(const Kind& kind, const Vector3d& head, const Vector3d& way, const Vector3d& lobe, const Vector3d& x) {
  const Vector3d unit = way.normalized(), from_head = x - head;
  const double along = from_head.dot(unit) / way.norm(), z = (along - kind.along) / kind.width;
  const Vector3d across = from_head - unit * from_head.dot(unit);
  const double cosine = across.norm() > 1e-9 ? across.normalized().dot(lobe) : 0;
  return std::exp(-0.5 * z * z) * std::pow(std::max(0.0, cosine), 2);
}

/// Skin weight of `bone` at vertex i.
double WeightOf(const body::BodyTemplate& body, int bone, Eigen::Index i) {
  double weight = 0;
  for (int k = 0; k < 4; ++k) weight += body.skin_bones(k, i) == bone ? body.skin_weights(k, i) : 0.f;
  return weight;
}

}  // namespace

Muscles::Muscles(const body::BodyTemplate& body) : num_vertices_(body.vertices.cols()) {
  const body::RoleBones bones = body::FindRoleBones(body);
  const Eigen::Matrix3Xf normals = body::VertexNormals(body.vertices, body.faces);
  const double scale = body.coco19(2, 0) / 1.43;  // height of the neck of a person of 1.75 m
  for (int side = 0; side < 2; ++side) {
    for (const Kind& kind : kKinds) {
      const int upper = kind.arm ? bones.arms[side][1] : bones.legs[side][0];
      const int lower = kind.arm ? bones.arms[side][2] : bones.legs[side][1];
      const int on = kind.on_child ? lower : upper;
      const Vector3d head = body.bone_heads.col(on), way = body.bone_tails.col(on) - head;
      const Vector3d bends_to(0, kind.arm == kind.inner ? -1 : 1, 0);  // elbows bend forwards, knees backwards
      const Vector3d lobe = (bends_to - way * (way.dot(bends_to) / way.squaredNorm())).normalized();
      Muscle muscle{upper, lower, (body.bone_tails.col(lower) - body.bone_heads.col(lower)).normalized(), {}, {}};
      std::vector<Eigen::Vector3f> full;
      for (Eigen::Index i = 0; i < num_vertices_; ++i) {
        const double weight = WeightOf(body, upper, i) + WeightOf(body, lower, i);
        const double share = weight * Share(kind, head, way, lobe, body.vertices.col(i).cast<double>());
        if (share < 1e-4) continue;
        muscle.vertices.push_back(static_cast<int>(i));
        full.emplace_back(static_cast<float>(scale * kind.swell_m * share) * normals.col(i));
      }
      muscle.full.resize(3, static_cast<Eigen::Index>(full.size()));
      for (size_t i = 0; i < full.size(); ++i) muscle.full.col(static_cast<Eigen::Index>(i)) = full[i];
      muscles_.push_back(std::move(muscle));
    }
  }
}

Eigen::Matrix3Xf Muscles::Swelling(const body::BodyPose& pose) const {
  Eigen::Matrix3Xf swelling = Eigen::Matrix3Xf::Zero(3, num_vertices_);
  for (const Muscle& muscle : muscles_) {
    const Eigen::Quaterniond bend =
        pose.bone_transforms[muscle.bone].rotation.conjugate() * pose.bone_transforms[muscle.child].rotation;
    // |R d - d|^2 / 2 = 1 - cos, without cancellation and exactly 0 without a bend.
    const double share = 0.5 * (bend * muscle.rest_in_child - muscle.rest_in_child).squaredNorm();
    if (share < 1e-24) continue;
    for (size_t i = 0; i < muscle.vertices.size(); ++i)
      swelling.col(muscle.vertices[i]) += static_cast<float>(share) * muscle.full.col(static_cast<Eigen::Index>(i));
  }
  return swelling;
}

}  // namespace mvstudio::synth
