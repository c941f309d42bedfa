#include "avatar/body/files/gltf.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "avatar/body/surface_nets.h"
#include "core/check.h"
#include "core/disk/files.h"
#include "dataset/arrays/glb.h"

namespace mvstudio::body {
namespace {

using dataset::internal::AppendTurn;
using dataset::internal::AppendVector;
using dataset::internal::GlbBuilder;
using dataset::internal::GlbJson;

constexpr int kClampToEdge = 33071, kLinear = 9729, kMipmaps = 9987;

struct Motion {
  std::vector<float> seconds;  // rising from 0
  std::vector<ArticulatedPose> poses;
};

void CheckPose(const BodyTemplate& body, int frame, const ArticulatedPose& pose) {
  const auto& turns = pose.local_rotations;
  MVS_CHECK(turns.size() == body.bone_names.size(),
            "the pose of frame " << frame << " of " << turns.size() << " bones for a body of " << body.bone_names.size());
  MVS_CHECK(pose.shift.allFinite(), "the shift of frame " << frame << " is not finite");
  for (const Eigen::Quaterniond& turn : turns) {
    MVS_CHECK(std::abs(turn.norm() - 1) < 1e-3, "a rotation of frame " << frame << " has the norm " << turn.norm());
  }
}

Motion MotionOf(const BodyTemplate& body, const std::map<int, ArticulatedPose>& pose_of_frame, double frame_rate_hz) {
  MVS_CHECK(std::isfinite(frame_rate_hz) && frame_rate_hz > 0, "frame_rate_hz = " << frame_rate_hz);
  Motion motion;
  for (const auto& [frame, pose] : pose_of_frame) {
    CheckPose(body, frame, pose);
    const double frames = static_cast<double>(frame) - static_cast<double>(pose_of_frame.begin()->first);
    const auto seconds = static_cast<float>(frames / frame_rate_hz);
    MVS_CHECK(std::isfinite(seconds) && (motion.seconds.empty() || seconds > motion.seconds.back()),
              "frame " << frame << " at " << frame_rate_hz << " Hz: floats do not tell its time from the frame before");
    motion.seconds.push_back(seconds), motion.poses.push_back(pose);
  }
  return motion;
}

/// Up to four bones of a vertex, each once, with weights that sum to one; unused places are zero, as the format wants it.
struct Influence {
  std::array<uint16_t, 4> bones{};
  std::array<float, 4> weights{};
};

Influence InfluenceOf(const BodyTemplate& body, int vertex) {
  Influence result;
  size_t count = 0;
  float sum = 0;
  for (int k = 0; k < 4; ++k) {
    const float weight = body.skin_weights(k, vertex);
    if (!(weight > 0)) continue;
    const auto bone = static_cast<uint16_t>(body.skin_bones(k, vertex));
    size_t place = 0;
    while (place < count && result.bones[place] != bone) ++place;
    result.bones[place] = bone, result.weights[place] += weight, sum += weight;
    count = std::max(count, place + 1);
  }
  MVS_CHECK(sum > 0, "vertex " << vertex << " follows no bone");
  for (float& weight : result.weights) weight /= sum;
  return result;
}

GlbJson Attributes(const BodyTemplate& body, const AtlasMesh& mesh, GlbBuilder* builder) {
  const Eigen::Matrix3Xf normals = VertexNormals(body.vertices, body.faces);
  std::vector<float> places, directions, weights;
  std::vector<uint16_t> bones;
  for (const int vertex : mesh.vertices) {
    AppendVector(&places, body.vertices.col(vertex).cast<double>());
    AppendVector(&directions, normals.col(vertex).cast<double>());
    const Influence influence = InfluenceOf(body, vertex);
    bones.insert(bones.end(), influence.bones.begin(), influence.bones.end());
    weights.insert(weights.end(), influence.weights.begin(), influence.weights.end());
  }
  const std::vector<float> uv(mesh.uv.data(), mesh.uv.data() + mesh.uv.size());
  GlbJson attributes;
  attributes["POSITION"] = builder->Floats(places, 3, dataset::internal::kArrayBuffer);
  attributes["NORMAL"] = builder->Floats(directions, 3, dataset::internal::kArrayBuffer);
  attributes["TEXCOORD_0"] = builder->Floats(uv, 2, dataset::internal::kArrayBuffer);
  attributes["JOINTS_0"] = builder->Shorts(bones, 4, dataset::internal::kArrayBuffer);
  attributes["WEIGHTS_0"] = builder->Floats(weights, 4, dataset::internal::kArrayBuffer);
  return attributes;
}

int AddMaterial(const AtlasPng& atlas, GlbBuilder* builder) {
  const int view = builder->View(atlas.bytes.data(), atlas.bytes.size());
  const int image = builder->Add("images", {{"name", "atlas"}, {"mimeType", "image/png"}, {"bufferView", view}});
  const int sampler = builder->Add(
      "samplers", {{"magFilter", kLinear}, {"minFilter", kMipmaps}, {"wrapS", kClampToEdge}, {"wrapT", kClampToEdge}});
  const int texture = builder->Add("textures", {{"source", image}, {"sampler", sampler}});
  const GlbJson surface = {{"baseColorTexture", {{"index", texture}}}, {"metallicFactor", 0.0}, {"roughnessFactor", 1.0}};
  return builder->Add("materials", {{"name", "body"}, {"pbrMetallicRoughness", surface}});
}

int AddMesh(const BodyTemplate& body, const AtlasPng& atlas, GlbBuilder* builder) {
  const AtlasMesh mesh = UnwrapOntoAtlas(body, atlas.chart_px);
  GlbJson primitive;
  primitive["attributes"] = Attributes(body, mesh, builder);
  const std::vector<uint32_t> corners(mesh.faces.data(), mesh.faces.data() + mesh.faces.size());
  primitive["indices"] = builder->Words(corners, 1, dataset::internal::kElementBuffer);
  primitive["material"] = AddMaterial(atlas, builder);
  return builder->Add("meshes", {{"name", "body"}, {"primitives", GlbJson::array({primitive})}});
}

/// The head of a bone from the one of its parent, at rest.
Eigen::Vector3d RestOffset(const BodyTemplate& body, size_t bone) {
  const auto b = static_cast<Eigen::Index>(bone);
  const int parent = body.bone_parents[bone];
  return parent < 0 ? Eigen::Vector3d(body.bone_heads.col(b))
                    : Eigen::Vector3d(body.bone_heads.col(b) - body.bone_heads.col(parent));
}

std::vector<float> Turns(const std::vector<ArticulatedPose>& poses, size_t bone) {
  std::vector<float> turns;
  for (const ArticulatedPose& pose : poses) AppendTurn(&turns, pose.local_rotations[bone].normalized());
  return turns;
}

std::vector<float> RootPlaces(const BodyTemplate& body, const std::vector<ArticulatedPose>& poses, size_t bone) {
  std::vector<float> places;
  for (const ArticulatedPose& pose : poses) AppendVector(&places, RestOffset(body, bone) + pose.shift);
  return places;
}

/// Nodes of the joints, one after the other in the order of the bones; index of the first one.
int AddJoints(const BodyTemplate& body, const std::vector<ArticulatedPose>& poses, GlbBuilder* builder) {
  const std::vector<ArticulatedPose> first(poses.begin(), poses.begin() + (poses.empty() ? 0 : 1));
  const int begin = builder->Count("nodes");
  for (size_t b = 0; b < body.bone_names.size(); ++b) {
    GlbJson children = GlbJson::array();
    for (size_t c = 0; c < body.bone_names.size(); ++c) {
      if (body.bone_parents[c] == static_cast<int>(b)) children.push_back(begin + static_cast<int>(c));
    }
    std::vector<float> place, turn = Turns(first, b);
    AppendVector(&place, RestOffset(body, b));
    if (body.bone_parents[b] < 0 && !first.empty()) place = RootPlaces(body, first, b);
    GlbJson node = {{"name", body.bone_names[b]}, {"translation", place}};
    if (!turn.empty()) node["rotation"] = turn;
    if (!children.empty()) node["children"] = children;
    builder->Add("nodes", node);
  }
  return begin;
}

int AddSkin(const BodyTemplate& body, int first_joint, GlbBuilder* builder) {
  std::vector<float> inverse_bind;
  GlbJson joints = GlbJson::array();
  for (size_t b = 0; b < body.bone_names.size(); ++b) {
    Eigen::Matrix4f body_to_bone = Eigen::Matrix4f::Identity();
    body_to_bone.topRightCorner<3, 1>() = -body.bone_heads.col(static_cast<Eigen::Index>(b)).cast<float>();
    inverse_bind.insert(inverse_bind.end(), body_to_bone.data(), body_to_bone.data() + 16);
    joints.push_back(first_joint + static_cast<int>(b));
  }
  return builder->Add("skins", {{"inverseBindMatrices", builder->Floats(inverse_bind, 16)}, {"joints", joints}});
}

void AddAnimation(const BodyTemplate& body, const Motion& motion, int first_joint, GlbBuilder* builder) {
  const int times = builder->Floats(motion.seconds, 1);
  GlbJson samplers = GlbJson::array(), channels = GlbJson::array();
  const auto follow = [&](size_t bone, const char* path, const std::vector<float>& values, size_t components) {
    channels.push_back(
        {{"sampler", samplers.size()}, {"target", {{"node", first_joint + static_cast<int>(bone)}, {"path", path}}}});
    samplers.push_back({{"input", times}, {"interpolation", "LINEAR"}, {"output", builder->Floats(values, components)}});
  };
  for (size_t b = 0; b < body.bone_names.size(); ++b) {
    if (body.bone_parents[b] < 0) follow(b, "translation", RootPlaces(body, motion.poses, b), 3);
    follow(b, "rotation", Turns(motion.poses, b), 4);
  }
  builder->Add("animations", {{"name", "take"}, {"samplers", samplers}, {"channels", channels}});
}

}  // namespace

std::string GlbOfBody(const BodyTemplate& body, const AtlasPng& atlas, const std::map<int, ArticulatedPose>& pose_of_frame,
                      double frame_rate_hz) {
  CheckAtlas(atlas);
  const Motion motion = MotionOf(body, pose_of_frame, frame_rate_hz);
  MVS_CHECK(body.vertices.allFinite() && body.bone_heads.allFinite(), "a vertex or a bone is not finite");
  GlbBuilder builder;
  const int mesh = AddMesh(body, atlas, &builder), joints = AddJoints(body, motion.poses, &builder);
  GlbJson roots = GlbJson::array();
  for (size_t b = 0; b < body.bone_names.size(); ++b) {
    if (body.bone_parents[b] < 0) roots.push_back(joints + static_cast<int>(b));
  }
  const double half = std::sqrt(0.5);  // a quarter turn about x: z up becomes y up
  const int world = builder.Add("nodes", {{"name", "world, z up"}, {"rotation", {-half, 0.0, 0.0, half}}, {"children", roots}});
  // A skinned mesh follows its joints alone: its node stands beside them, not below.
  const int shown = builder.Add("nodes", {{"name", "body"}, {"mesh", mesh}, {"skin", AddSkin(body, joints, &builder)}});
  if (!motion.poses.empty()) AddAnimation(body, motion, joints, &builder);
  builder.Set("scene", 0);
  builder.Set("scenes", GlbJson::array({{{"nodes", {world, shown}}}}));
  return builder.Glb();
}

void WriteBodyGlb(const std::string& path, const BodyTemplate& body, const AtlasPng& atlas,
                  const std::map<int, ArticulatedPose>& pose_of_frame, double frame_rate_hz) {
  WriteFileAtomic(path, GlbOfBody(body, atlas, pose_of_frame, frame_rate_hz));
}

}  // namespace mvstudio::body
