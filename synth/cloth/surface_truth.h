#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "avatar/body/body_template.h"
#include "geometry/skeleton/skeleton.h"
#include "synth/cloth/dressed_body.h"

namespace mvstudio::synth {

/// How far a mesh is from where skinning alone has it, over its vertices in all frames.
struct BeyondSkinning {
  std::string mesh;
  double rms_mm = 0, max_mm = 0;
};

/// Writes the exact surface of a take (docs/formats.md, "Truth of a surface"): `vertices_%08d.npz` as frames come, then
/// `subject_rest.npz` and `motion.npz`.
class SurfaceTruth {
 public:
  /// `dressed` is null for a naked body; both must outlive it.
  SurfaceTruth(std::string folder, const body::BodyTemplate& surface, const DressedBody* dressed);

  /// `vertices`, `skinned` (3, V) in world; `skinned` is empty where it equals `vertices`. `joints` (3, J) of `skeleton`.
  void Add(int frame_idx, const body::BodyPose& pose, const Eigen::Matrix3Xf& vertices, const Eigen::Matrix3Xf& skinned,
           const Eigen::Matrix3Xd& joints_in_world);
  void Finish(const geometry::Skeleton& skeleton, double fps) const;
  std::vector<BeyondSkinning> beyond_skinning() const;

 private:
  struct Mesh {
    std::string name;
    int first, vertices, first_face, faces;
    double square_sum_mm2 = 0, max_mm = 0;
  };
  const std::string folder_;
  const body::BodyTemplate& surface_;
  const DressedBody* dressed_;
  std::vector<Mesh> meshes_;
  std::vector<double> transforms_, joints_;  // (N, B, 3, 4); (N, J, 3)
  size_t frames_ = 0;
};

}  // namespace mvstudio::synth
