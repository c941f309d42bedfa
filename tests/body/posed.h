#pragma once

#include <cmath>
#include <map>
#include <string>
#include <vector>

#include "avatar/body/articulated_pose.h"
#include "avatar/body/files/atlas.h"
#include "tests/support/hostile_files.h"

/// Bodies, poses and atlases for the tests of files.
namespace mvstudio::body {

/// A motion in which every bone turns by its own angles.
inline std::vector<ArticulatedPose> Dance(const BodyTemplate& body, int num_frames) {
  std::vector<ArticulatedPose> poses(static_cast<size_t>(num_frames));
  for (int f = 0; f < num_frames; ++f) {
    ArticulatedPose& pose = poses[static_cast<size_t>(f)];
    pose.shift = {3 + 0.1 * f, -2, 0.02 * f};
    for (size_t b = 0; b < body.bone_names.size(); ++b) {
      const double phase = static_cast<double>(b);
      const Eigen::Vector3d axis(std::cos(phase), std::sin(2 * phase), std::sin(3 * phase + 1));
      pose.local_rotations.emplace_back(Eigen::AngleAxisd(0.9 * std::sin(0.5 * f + phase), axis.normalized()));
    }
  }
  return poses;
}

/// The poses of frames 0, 1, …
inline std::map<int, ArticulatedPose> Numbered(const std::vector<ArticulatedPose>& poses) {
  std::map<int, ArticulatedPose> pose_of_frame;
  for (const ArticulatedPose& pose : poses) pose_of_frame.emplace(static_cast<int>(pose_of_frame.size()), pose);
  return pose_of_frame;
}

inline AtlasPng BlackAtlas(int chart_px) {
  const auto size = static_cast<uint32_t>(AtlasSizePx(chart_px));
  return {mvstudio::testing::ZeroPng(size, size, true), chart_px};
}

/// Two triangles that share an edge where charts 1 and 2 meet; two bones.
inline BodyTemplate Flag() {
  BodyTemplate body;
  body.vertices.resize(3, 4);
  body.vertices << 0, 1, 1, 0, 0, 0, 0, 0, 0, 0, 1, 1;
  body.faces.resize(3, 2);
  body.faces << 0, 0, 1, 2, 2, 3;
  body.face_part = {1, 2};
  body.face_uv.resize(2, 6);
  body.face_uv << 0, 1, 1, 0, 1, 0, 0, 0, 1, 0, 1, 1;
  body.bone_names = {"pole", "Fähnchen"};
  body.bone_roles = {BoneRole::kPelvis, BoneRole::kOther};
  body.bone_parents = {-1, 0};
  body.bone_heads.resize(3, 2);
  body.bone_heads << 0, 0.5, 0, 0, 0, 0.25;
  body.bone_tails = body.bone_heads.colwise() + Eigen::Vector3d(0, 0, 1.0 / 3);
  body.skin_bones = Eigen::Matrix4Xi::Zero(4, 4);
  body.skin_weights = Eigen::Matrix4Xf::Zero(4, 4);
  body.skin_weights.row(0) << 1, 0.5f, 0.25f, 1;
  body.skin_bones.row(1) << 1, 1, 1, 1;
  body.skin_weights.row(1) << 0, 0.5f, 0.75f, 0;
  body.coco19 = Eigen::Matrix3Xd::Constant(3, 19, 0.1);
  body.coco19_bone.fill(1);
  return body;
}

}  // namespace mvstudio::body
