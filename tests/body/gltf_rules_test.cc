#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <set>

#include "avatar/body/files/gltf.h"
#include "avatar/body/makehuman/read.h"
#include "tests/body/glb_document.h"
#include "tests/body/posed.h"
#include "tests/support/test.h"
#include "tests/support/test_data.h"

/// What the glTF 2.0 specification asks of skinned, animated files beyond the sizes that GlbDocument reads by; the numbers in
/// brackets are its sections.
namespace mvstudio::body {
namespace {

using Json = nlohmann::json;

constexpr int kUnsignedShort = 5123, kUnsignedInt = 5125, kFloat = 5126, kArrayBuffer = 34962, kElementBuffer = 34963;

void ExpectForm(const GlbDocument& d, const Json& index, int component, const std::string& type, int target) {
  const Json &accessor = d.Accessor(index), &view = d.ViewOf(accessor);
  EXPECT_EQ(accessor["componentType"], component) << index;
  EXPECT_EQ(accessor["type"], type) << index;
  EXPECT_GT(accessor["count"].get<int>(), 0) << index;
  EXPECT_EQ(view.value("target", 0), target) << index;  // [3.6.1.2]
}

/// Bounds, which positions and times must have [3.6.2.5], are those of the stored numbers.
void ExpectBounds(const GlbDocument& d, const Json& index) {
  const Eigen::MatrixXd values = d.Read(index);
  const Eigen::VectorXd low = values.rowwise().minCoeff(), high = values.rowwise().maxCoeff();
  const Json& accessor = d.Accessor(index);
  EXPECT_EQ(accessor["min"].get<std::vector<double>>(), std::vector<double>(low.data(), low.data() + low.size()));
  EXPECT_EQ(accessor["max"].get<std::vector<double>>(), std::vector<double>(high.data(), high.data() + high.size()));
}

/// [3.7.2.1], [3.7.3.1]
void ExpectSoundMesh(const GlbDocument& d) {
  const Json& attributes = d.Primitive()["attributes"];
  ExpectForm(d, attributes["POSITION"], kFloat, "VEC3", kArrayBuffer);
  ExpectForm(d, attributes["NORMAL"], kFloat, "VEC3", kArrayBuffer);
  ExpectForm(d, attributes["TEXCOORD_0"], kFloat, "VEC2", kArrayBuffer);
  ExpectForm(d, attributes["JOINTS_0"], kUnsignedShort, "VEC4", kArrayBuffer);
  ExpectForm(d, attributes["WEIGHTS_0"], kFloat, "VEC4", kArrayBuffer);
  ExpectForm(d, d.Primitive()["indices"], kUnsignedInt, "SCALAR", kElementBuffer);
  ExpectBounds(d, attributes["POSITION"]);
  const Eigen::MatrixXd places = d.Attribute("POSITION"), indices = d.Read(d.Primitive()["indices"]);
  for (const auto& [name, index] : attributes.items()) {
    const Eigen::MatrixXd values = d.Read(index);
    EXPECT_TRUE(values.allFinite()) << name;
    EXPECT_EQ(values.cols(), places.cols()) << name;
  }
  EXPECT_EQ(indices.size() % 3, 0);
  EXPECT_LT(indices.maxCoeff(), static_cast<double>(places.cols()));
  EXPECT_LT((d.Attribute("NORMAL").colwise().norm().array() - 1).abs().maxCoeff(), 1e-6);
  const Eigen::MatrixXd uv = d.Attribute("TEXCOORD_0");
  EXPECT_TRUE(uv.minCoeff() >= 0 && uv.maxCoeff() <= 1);
}

/// Weights sum to one as nearly as floats can; a joint moves a vertex once; unused places are zero [3.7.3.3].
void ExpectSoundWeights(const GlbDocument& d) {
  const Eigen::MatrixXd joints = d.Attribute("JOINTS_0"), weights = d.Attribute("WEIGHTS_0");
  const auto num_joints = static_cast<double>(d.json["skins"][0]["joints"].size());
  EXPECT_LT(joints.maxCoeff(), num_joints);
  EXPECT_GE(weights.minCoeff(), 0);
  for (Eigen::Index i = 0; i < weights.cols(); ++i) {
    std::set<double> used;
    for (int k = 0; k < 4; ++k) {
      const bool is_new = weights(k, i) > 0 && used.insert(joints(k, i)).second;
      EXPECT_TRUE(is_new || (weights(k, i) == 0 && joints(k, i) == 0)) << i;
    }
    EXPECT_NEAR(weights.col(i).sum(), 1, 2e-7 * static_cast<double>(used.size())) << i;
  }
}

/// Every node has one parent at most, rotations are unit quaternions, the scene's nodes are roots [3.5.1, 3.5.3].
void ExpectSoundNodes(const GlbDocument& d) {
  const Json& nodes = d.json["nodes"];
  std::vector<int> parent(nodes.size(), -1);
  for (size_t n = 0; n < nodes.size(); ++n) {
    for (const Json& child : nodes[n].value("children", Json::array())) {
      EXPECT_EQ(parent.at(child.get<size_t>()), -1) << child;
      parent[child.get<size_t>()] = static_cast<int>(n);
    }
    if (!nodes[n].contains("rotation")) continue;
    const auto q = nodes[n]["rotation"].get<std::vector<double>>();
    EXPECT_NEAR(Eigen::Map<const Eigen::Vector4d>(q.data()).norm(), 1, 1e-6) << n;
  }
  std::set<size_t> roots;
  for (const Json& root : d.json["scenes"][d.json["scene"].get<size_t>()]["nodes"]) roots.insert(root.get<size_t>());
  for (size_t n = 0; n < nodes.size(); ++n) {
    EXPECT_EQ(roots.count(n) == 1, parent[n] == -1) << n;
    size_t steps = 0;
    for (int at = static_cast<int>(n); at >= 0 && steps <= nodes.size(); at = parent[static_cast<size_t>(at)]) ++steps;
    EXPECT_LE(steps, nodes.size()) << "a circle at " << n;
  }
}

/// One inverse bind matrix a joint, affine, that brings the joint's rest place to the origin; the skinned node stands at the
/// top, for its own place has no effect [3.7.3.1, 3.7.3.2].
void ExpectSoundSkin(const GlbDocument& d, const BodyTemplate& body) {
  const Json& skin = d.json["skins"].at(0);
  ExpectForm(d, skin["inverseBindMatrices"], kFloat, "MAT4", 0);
  const Eigen::MatrixXd matrices = d.Read(skin["inverseBindMatrices"]);
  std::set<size_t> joints;
  for (const Json& joint : skin["joints"]) EXPECT_TRUE(joints.insert(joint.get<size_t>()).second);
  ASSERT_EQ(matrices.cols(), static_cast<Eigen::Index>(body.bone_names.size()));
  ASSERT_EQ(joints.size(), body.bone_names.size());
  for (Eigen::Index b = 0; b < matrices.cols(); ++b) {
    const Eigen::Map<const Eigen::Matrix4d> bone_from_body(matrices.col(b).data());
    EXPECT_EQ(bone_from_body.row(3), Eigen::RowVector4d(0, 0, 0, 1));
    EXPECT_LT((bone_from_body * body.bone_heads.col(b).homogeneous()).head<3>().norm(), 1e-6) << b;
    EXPECT_EQ((bone_from_body.topLeftCorner<3, 3>()), Eigen::Matrix3d::Identity()) << b;
  }
  for (const Json& node : d.json["nodes"]) {
    if (!node.contains("mesh")) continue;
    EXPECT_EQ(node["skin"], 0);
    EXPECT_FALSE(node.contains("children") || node.contains("rotation") || node.contains("translation"));
  }
}

/// [3.11]
void ExpectSoundAnimation(const GlbDocument& d, size_t num_frames) {
  const Json& animation = d.json["animations"].at(0);
  std::set<std::pair<size_t, std::string>> targets;
  for (const Json& channel : animation["channels"]) {
    const std::string path = channel["target"]["path"];
    EXPECT_TRUE(targets.emplace(channel["target"]["node"].get<size_t>(), path).second);
    const Json& sampler = animation["samplers"].at(channel["sampler"].get<size_t>());
    ExpectForm(d, sampler["input"], kFloat, "SCALAR", 0);
    ExpectForm(d, sampler["output"], kFloat, path == "rotation" ? "VEC4" : "VEC3", 0);
    ExpectBounds(d, sampler["input"]);
    const Eigen::MatrixXd times = d.Read(sampler["input"]), values = d.Read(sampler["output"]);
    EXPECT_EQ(static_cast<size_t>(times.size()), num_frames);
    EXPECT_EQ(values.cols(), times.size());
    EXPECT_EQ(times(0), 0);
    for (Eigen::Index i = 1; i < times.size(); ++i) EXPECT_GT(times(i), times(i - 1));
    const double worst = (values.colwise().norm().array() - 1).abs().maxCoeff();
    EXPECT_TRUE(path != "rotation" || worst < 1e-6) << worst;
  }
  EXPECT_EQ(targets.size(), animation["samplers"].size());
}

/// Views fill the buffer, each is used, and so is each accessor, texture, image, sampler and material.
void ExpectNothingLeftOver(const GlbDocument& d) {
  std::set<size_t> accessors, views;
  for (const auto& attribute : d.Primitive()["attributes"].items()) accessors.insert(attribute.value().get<size_t>());
  accessors.insert(d.Primitive()["indices"].get<size_t>());
  accessors.insert(d.json["skins"][0]["inverseBindMatrices"].get<size_t>());
  for (const Json& animation : d.json.value("animations", Json::array())) {
    for (const Json& sampler : animation["samplers"])
      accessors.insert(sampler["input"].get<size_t>()), accessors.insert(sampler["output"].get<size_t>());
  }
  EXPECT_EQ(accessors.size(), d.json["accessors"].size());
  for (const Json& accessor : d.json["accessors"]) EXPECT_TRUE(views.insert(accessor["bufferView"].get<size_t>()).second);
  EXPECT_TRUE(views.insert(d.json["images"][0]["bufferView"].get<size_t>()).second);
  EXPECT_EQ(views.size(), d.json["bufferViews"].size());
  for (const char* list : {"buffers", "meshes", "skins", "scenes", "materials", "textures", "images", "samplers"})
    EXPECT_EQ(d.json[list].size(), 1u) << list;
  EXPECT_FALSE(d.json.contains("cameras"));
}

void ExpectSound(const BodyTemplate& body, const std::map<int, ArticulatedPose>& pose_of_frame) {
  const GlbDocument d(GlbOfBody(body, BlackAtlas(32), pose_of_frame, 25));
  EXPECT_EQ(d.json["asset"]["version"], "2.0");
  ExpectSoundMesh(d);
  ExpectSoundWeights(d);
  ExpectSoundNodes(d);
  ExpectSoundSkin(d, body);
  if (!pose_of_frame.empty()) ExpectSoundAnimation(d, pose_of_frame.size());
  EXPECT_EQ(d.json.contains("animations"), !pose_of_frame.empty());
  ExpectNothingLeftOver(d);
}

TEST(GltfRules, MannequinWithAndWithoutMotion) {
  const BodyTemplate body = MakeMannequin(1.75, 0.5);
  ExpectSound(body, {});
  ExpectSound(body, Numbered(Dance(body, 1)));
  const std::vector<ArticulatedPose> poses = Dance(body, 3);
  ExpectSound(body, {{120, poses[0]}, {121, poses[1]}, {150, poses[2]}});
}

TEST(GltfRules, MakeHuman) {
  MVS_NEEDS_DATA("makehuman_cc0");
  const BodyTemplate body = ReadMakeHuman(mvstudio::testing::DataRoot() + "/makehuman_cc0");
  ExpectSound(body, Numbered(Dance(body, 5)));
}

/// Faces without an area, of one vertex, and so small that their normals leave the range of floats.
TEST(GltfRules, FacesWithoutNormals) {
  for (const float scale : {0.0f, 1e-10f, 3e-11f, 1e-11f, 1e-12f, 1e-20f, std::numeric_limits<float>::denorm_min()}) {
    BodyTemplate body = Flag();
    body.vertices *= scale;
    ExpectSound(body, Numbered(Dance(body, 2)));
  }
  BodyTemplate body = Flag();
  body.faces.col(1).setConstant(3);
  ExpectSound(body, {});
}

/// Rotations and weights at the edge of what the writer takes.
TEST(GltfRules, RoundedInput) {
  BodyTemplate body = Flag();
  body.skin_weights.col(1) << 0.3333f, 0.3333f, 0, 0;
  body.skin_weights.col(2) << 1e-30f, 1, 0, 0;
  std::map<int, ArticulatedPose> poses = Numbered(Dance(body, 3));
  poses[1].local_rotations[1].coeffs() *= 1.0009;
  ExpectSound(body, poses);
}

}  // namespace
}  // namespace mvstudio::body
