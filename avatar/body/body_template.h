#pragma once

#include <Eigen/Core>
#include <array>
#include <memory>
#include <string>
#include <vector>

#include "avatar/body/blend_shapes.h"
#include "avatar/body/bone_role.h"
#include "core/charts/body_charts.h"
#include "core/image.h"
#include "geometry/rigid/rigid3.h"

namespace mvstudio::body {

inline constexpr int kNumParts = kNumBodyCharts;

/// Offsets of a rest surface that move with the pose, beyond what is linear in the bones' rotations.
class MovingOffsets {
 public:
  virtual ~MovingOffsets() = default;
  /// Offsets (3, V) at rest, metres in body. `posed` (3, V): the skinned surface without them, metres, about the root bone's
  /// head in the axes that the root bone turns. Finite for whatever is finite.
  virtual Eigen::Matrix3Xf At(const Eigen::Matrix3Xf& posed) const = 0;
};

/// A skinned, textured body. Frame `body`: metres, z up, the person faces -y, x points to the
/// person's left, feet near z = 0, arms spread (T- or A-pose).
struct BodyTemplate {
  Eigen::Matrix3Xf vertices;            // (3, V) rest positions in body
  Eigen::Matrix3Xi faces;               // (3, F) counter-clockwise seen from outside
  std::vector<int> face_part;           // (F) 1..24
  Eigen::Matrix2Xf face_uv;             // (2, 3F) chart coordinates in [0, 1] of the three corners of each face
  std::vector<std::string> bone_names;  // (B)
  std::vector<int> bone_parents;        // (B) -1 for the root; parents come first
  std::vector<BoneRole> bone_roles;     // (B)
  Eigen::Matrix3Xd bone_heads;          // (3, B) rest positions of the bones' heads in body
  Eigen::Matrix3Xd bone_tails;          // (3, B) rest positions of their far ends: stretch acts along head -> tail. That of the
                                        // pelvis lies across the body, so that its stretch is that of the hips' width
  Eigen::Matrix4Xi skin_bones;          // (4, V) bones that move a vertex
  Eigen::Matrix4Xf skin_weights;        // (4, V) sum to one
  Eigen::Matrix3Xd coco19;              // (3, 19) rest positions of the Panoptic joints in body
  std::array<int, 19> coco19_bone;      // bone each joint moves with
  BlendShapes shapes;                   // no columns when the body has one shape only
  /// (3V, 9 (B-1)) or empty: SMPL's pose blend shapes. Column 9 (b - 1) + 3 r + c displaces the vertices in body, metres, per
  /// unit of entry (r, c) of the local rotation of bone b minus identity; bone 0 is the root. Loper et al., "SMPL: a skinned
  /// multi-person linear model", SIGGRAPH Asia 2015.
  Eigen::MatrixXf pose_directions;
  std::shared_ptr<const MovingOffsets> moving_offsets;  ///< of these vertices; null: none
};

/// Procedural clothed mannequin in an A-pose: smooth union of tubes with measured-looking profiles, meshed by surface nets.
/// `detail` multiplies the mesh resolution (1: about 8,000 vertices; the number of faces grows with its square).
BodyTemplate MakeMannequin(double height_m = 1.75, double detail = 1.0);

/// The body displaced along its shapes: vertices, bones and joints; linear in the coefficients (S). The result keeps the
/// shapes, which now act from where it is.
BodyTemplate WithShape(const BodyTemplate& body, const Eigen::VectorXd& coefficients);

/// Body pose: world_from_body transform of each bone's rest frame. For a vertex that follows bone b alone, x_in_world =
/// bone_transforms[b] * S_b(x_in_body). S_b scales about the bone's rest head: by bone_stretch[b] along the bone, by girth
/// perpendicular to it.
struct BodyPose {
  std::vector<geometry::Rigid3> bone_transforms;  // (B)
  std::vector<double> bone_stretch;               // (B) length over rest length along the bone, 1 for none
  double girth = 1;                               // size over rest size across every bone
};

/// Joint angles -> pose. `local_rotations[b]` rotates bone b about its head relative to its parent; world_from_body places
/// the root.
BodyPose PoseFromAngles(const BodyTemplate& body, const geometry::Rigid3& world_from_body,
                        const std::vector<Eigen::Quaterniond>& local_rotations);

/// Pose whose Panoptic joints are closest to `coco19_in_world`: bones are rotated and stretched to the given joints;
/// joints with `valid[j] == false` are filled from their neighbours. Bones of the spine and of the neck share the turn; bones
/// of role kOther follow their parents. The limbs' bones end where the next ones begin, which are the Panoptic joints. Returns
/// false (and an unusable pose) when the trunk itself is missing. Throws ContractViolation when the roles are incomplete.
bool PoseFromJoints(const BodyTemplate& body, const Eigen::Matrix3Xd& coco19_in_world, const std::array<bool, 19>& valid,
                    BodyPose* pose);

/// Linear blend skinning, after the pose blend shapes and the moving offsets where the body has them: vertices in world, (3, V)
/// metres.
Eigen::Matrix3Xf SkinVertices(const BodyTemplate& body, const BodyPose& pose);
/// What MovingOffsets::At takes, for a body with or without them.
Eigen::Matrix3Xf PosedAboutRoot(const BodyTemplate& body, const BodyPose& pose);
/// Panoptic joints of a posed body, (3, 19) in world.
Eigen::Matrix3Xd PosedCoco19(const BodyTemplate& body, const BodyPose& pose);

/// Texture atlas of the mannequin: 24 charts, each size x size RGB, with patterns of several scales down to the finest
/// that an image can show. Chart k is part k + 1; the centre of pixel (x, y) has u = (x + 0.5) / size, v = (y + 0.5) /
/// size.
std::array<Image, kNumParts> MannequinTextures(int size_px, uint64_t seed);

}  // namespace mvstudio::body
