#include "avatar/body/files/gltf.h"

#include <limits>
#include <nlohmann/json.hpp>

#include "core/disk/files.h"
#include "core/error.h"
#include "tests/body/glb_document.h"
#include "tests/body/posed.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

/// What the files say is read back here with the format's formulas alone. Khronos' validator 2.0 finds no error and no warning
/// in fitted mannequins and MakeHuman bodies (`npm install gltf-validator`; one note, that the atlas is no power of two).
/// three.js (GLTFLoader, AnimationMixer) and Blender 3.4 place every vertex of three of them, in three frames each, within
/// 0.003 mm of SkinVertices; images of three.js with a calibrated camera are those of RenderBody, left and right included.
namespace mvstudio::body {
namespace {

using Json = nlohmann::json;

Eigen::Isometry3d LocalOf(const Json& node) {
  Eigen::Isometry3d local = Eigen::Isometry3d::Identity();
  if (node.contains("translation")) local.translate(Eigen::Vector3d(node["translation"].get<std::vector<double>>().data()));
  if (node.contains("rotation")) {
    const auto q = node["rotation"].get<std::vector<double>>();
    local.rotate(Eigen::Quaterniond(q[3], q[0], q[1], q[2]));
  }
  return local;
}

/// The document's nodes as they are at keyframe `frame` of its animation.
Json NodesAt(const GlbDocument& document, Eigen::Index frame) {
  Json nodes = document.json["nodes"];
  const Json& animation = document.json["animations"][0];
  for (const Json& channel : animation["channels"]) {
    const Json& sampler = animation["samplers"][channel["sampler"].get<size_t>()];
    const Eigen::VectorXd value = document.Read(sampler["output"]).col(frame);
    nodes[channel["target"]["node"].get<size_t>()][channel["target"]["path"].get<std::string>()] =
        std::vector<double>(value.data(), value.data() + value.size());
  }
  return nodes;
}

void PlaceNodes(const Json& nodes, size_t index, const Eigen::Isometry3d& parent, std::vector<Eigen::Isometry3d>* world) {
  (*world)[index] = parent * LocalOf(nodes[index]);
  for (const Json& child : nodes[index].value("children", Json::array())) PlaceNodes(nodes, child, (*world)[index], world);
}

/// Corners of the skinned mesh, (3, N) in the file's world, y up: the sum over joints of weight * world * inverse bind.
Eigen::Matrix3Xd Skinned(const GlbDocument& document, const Json& nodes) {
  std::vector<Eigen::Isometry3d> world(nodes.size(), Eigen::Isometry3d::Identity());
  for (const Json& root : document.json["scenes"][0]["nodes"]) PlaceNodes(nodes, root, Eigen::Isometry3d::Identity(), &world);
  const Json& skin = document.json["skins"][0];
  const Eigen::MatrixXd inverse_bind = document.Read(skin["inverseBindMatrices"]);
  std::vector<Eigen::Matrix4d> from_rest;
  for (size_t j = 0; j < skin["joints"].size(); ++j) {
    const Eigen::Map<const Eigen::Matrix4d> bind(inverse_bind.col(static_cast<Eigen::Index>(j)).data());
    from_rest.push_back(world[skin["joints"][j].get<size_t>()].matrix() * bind);
  }
  const Eigen::MatrixXd places = document.Attribute("POSITION"), joints = document.Attribute("JOINTS_0"),
                        weights = document.Attribute("WEIGHTS_0");
  Eigen::Matrix3Xd posed = Eigen::Matrix3Xd::Zero(3, places.cols());
  for (Eigen::Index i = 0; i < places.cols(); ++i) {
    for (int k = 0; k < 4; ++k)
      posed.col(i) +=
          weights(k, i) * (from_rest[static_cast<size_t>(joints(k, i))] * places.col(i).homogeneous().eval()).head<3>();
  }
  return posed;
}

/// Largest distance to the vertices of SkinVertices, metres.
double LargestError(const Eigen::Matrix3Xd& y_up, const BodyTemplate& body, const BodyPose& pose) {
  const Eigen::Matrix3Xf expected = SkinVertices(body, pose);
  const std::vector<int> vertices = UnwrapOntoAtlas(body, 32).vertices;
  EXPECT_EQ(static_cast<size_t>(y_up.cols()), vertices.size());
  double worst = 0;
  for (size_t i = 0; i < vertices.size(); ++i) {
    const Eigen::Vector3d p = y_up.col(static_cast<Eigen::Index>(i)), z_up(p.x(), -p.z(), p.y());
    worst = std::max(worst, (z_up - expected.col(vertices[i]).cast<double>()).norm());
  }
  return worst;
}

TEST(Gltf, PosedVerticesAreThoseOfSkinning) {
  const BodyTemplate body = MakeMannequin(1.75, 0.5);
  const std::vector<ArticulatedPose> poses = Dance(body, 7);
  const GlbDocument document(GlbOfBody(body, BlackAtlas(32), Numbered(poses), 25));
  for (size_t f = 0; f < poses.size(); ++f) {
    const Eigen::Matrix3Xd posed = Skinned(document, NodesAt(document, static_cast<Eigen::Index>(f)));
    EXPECT_LT(LargestError(posed, body, ToBodyPose(body, poses[f])), 1e-5) << f;
  }
  // What is shown when nothing plays.
  EXPECT_LT(LargestError(Skinned(document, document.json["nodes"]), body, ToBodyPose(body, poses[0])), 1e-5);
}

TEST(Gltf, WithoutPosesTheBodyRests) {
  const BodyTemplate body = MakeMannequin(1.75, 0.5);
  const GlbDocument document(GlbOfBody(body, BlackAtlas(32), {}, 25));
  EXPECT_FALSE(document.json.contains("animations"));
  const ArticulatedPose rest{Eigen::Vector3d::Zero(),
                             std::vector<Eigen::Quaterniond>(body.bone_names.size(), Eigen::Quaterniond::Identity())};
  EXPECT_LT(LargestError(Skinned(document, document.json["nodes"]), body, ToBodyPose(body, rest)), 1e-5);
}

TEST(Gltf, AccessorsStateTheirBoundsAndFollowEachOther) {
  const BodyTemplate body = Flag();
  const GlbDocument document(GlbOfBody(body, BlackAtlas(32), Numbered(Dance(body, 3)), 50));
  size_t end = 0;
  for (const Json& view : document.json["bufferViews"]) {
    EXPECT_EQ(view["byteOffset"], (end + 3) / 4 * 4);
    end = view["byteOffset"].get<size_t>() + view["byteLength"].get<size_t>();
  }
  EXPECT_EQ((end + 3) / 4 * 4, document.buffer.size());
  for (size_t i = 0; i < document.json["accessors"].size(); ++i) {
    const Json& accessor = document.json["accessors"][i];
    const Eigen::MatrixXd values = document.Read(i);
    if (accessor["componentType"] != 5126) continue;
    const Eigen::VectorXd low = values.rowwise().minCoeff(), high = values.rowwise().maxCoeff();
    EXPECT_EQ(accessor["min"].get<std::vector<double>>(), std::vector<double>(low.data(), low.data() + low.size())) << i;
    EXPECT_EQ(accessor["max"].get<std::vector<double>>(), std::vector<double>(high.data(), high.data() + high.size())) << i;
  }
}

TEST(Gltf, MeshOfTheFlag) {
  const BodyTemplate body = Flag();
  const GlbDocument document(GlbOfBody(body, BlackAtlas(32), {}, 50));
  const Json& primitive = document.Primitive();
  EXPECT_EQ(document.Read(primitive["indices"]), (Eigen::MatrixXd(1, 6) << 0, 1, 2, 3, 4, 5).finished());
  EXPECT_EQ(document.Attribute("NORMAL").col(0), Eigen::Vector3d(0, -1, 0));
  EXPECT_EQ(document.Attribute("TEXCOORD_0").cast<float>().eval(), UnwrapOntoAtlas(body, 32).uv);
  // Corner 0 follows the pole alone: what has no weight names no joint.
  EXPECT_EQ(document.Attribute("JOINTS_0").col(0), Eigen::Vector4d::Zero());
  EXPECT_EQ(document.Attribute("JOINTS_0").col(1), Eigen::Vector4d(0, 1, 0, 0));
  EXPECT_EQ(document.Attribute("WEIGHTS_0").col(1), Eigen::Vector4d(0.5, 0.5, 0, 0));
}

TEST(Gltf, BonesThatAreNamedTwiceAreOneInfluence) {
  BodyTemplate body = Flag();
  body.skin_bones.col(1) << 1, 0, 1, 0;
  body.skin_weights.col(1) << 0.25f, 0.5f, 0.25f, 0;
  const GlbDocument document(GlbOfBody(body, BlackAtlas(32), {}, 50));
  EXPECT_EQ(document.Attribute("JOINTS_0").col(1), Eigen::Vector4d(1, 0, 0, 0));
  EXPECT_EQ(document.Attribute("WEIGHTS_0").col(1), Eigen::Vector4d(0.5, 0.5, 0, 0));
}

TEST(Gltf, JointsHaveTheBonesNamesAndHierarchy) {
  const BodyTemplate body = MakeMannequin(1.75, 0.5);
  const GlbDocument document(GlbOfBody(body, BlackAtlas(32), Numbered(Dance(body, 2)), 25));
  const Json& joints = document.json["skins"][0]["joints"];
  ASSERT_EQ(joints.size(), body.bone_names.size());
  for (size_t b = 0; b < joints.size(); ++b) {
    const Json& node = document.json["nodes"][joints[b].get<size_t>()];
    EXPECT_EQ(node["name"], body.bone_names[b]);
    for (const Json& child : node.value("children", Json::array())) {
      const auto c = static_cast<size_t>(std::find(joints.begin(), joints.end(), child) - joints.begin());
      EXPECT_EQ(body.bone_parents.at(c), static_cast<int>(b));
    }
  }
}

TEST(Gltf, AnimationKeepsTheFrameRateAndTheShorterWay) {
  const BodyTemplate body = Flag();
  std::vector<ArticulatedPose> poses = Dance(body, 4);
  poses[2].local_rotations[1].coeffs() *= -1;  // the same rotation
  const GlbDocument document(GlbOfBody(body, BlackAtlas(32), Numbered(poses), 50));
  const Json& animation = document.json["animations"][0];
  EXPECT_EQ(animation["channels"].size(), 3u);  // the root moves and turns, its child turns
  for (const Json& sampler : animation["samplers"]) {
    const Eigen::MatrixXd times = document.Read(sampler["input"]), values = document.Read(sampler["output"]);
    EXPECT_LT((times.row(0) - Eigen::RowVector4d(0, 0.02, 0.04, 0.06)).norm(), 1e-7);
    for (int i = 0; i < 4 && values.rows() == 4; ++i) EXPECT_NEAR(values.col(i).norm(), 1, 1e-6);
    for (int i = 1; i < 4 && values.rows() == 4; ++i) EXPECT_GT(values.col(i).dot(values.col(i - 1)), 0) << i;
  }
}

TEST(Gltf, MissingFramesKeepTheirTime) {
  const BodyTemplate body = Flag();
  const std::vector<ArticulatedPose> poses = Dance(body, 3);
  const GlbDocument document(GlbOfBody(body, BlackAtlas(32), {{7, poses[0]}, {9, poses[1]}, {32, poses[2]}}, 50));
  for (const Json& sampler : document.json["animations"][0]["samplers"])
    EXPECT_LT((document.Read(sampler["input"]).row(0) - Eigen::RowVector3d(0, 0.04, 0.5)).norm(), 1e-7);
  // Frames that floats cannot tell apart.
  EXPECT_THROW(GlbOfBody(body, BlackAtlas(32), {{0, poses[0]}, {1 << 30, poses[1]}, {(1 << 30) + 1, poses[2]}}, 50),
               ContractViolation);
}

TEST(Gltf, HoldsTheAtlas) {
  const TempDir folder;
  const BodyTemplate body = Flag();
  const AtlasPng atlas = BlackAtlas(32);
  WriteBodyGlb(folder / "body.glb", body, atlas, {}, 50);
  const GlbDocument document(ReadFile(folder / "body.glb"));
  const Json& image = document.json["images"][0];
  const Json& view = document.json["bufferViews"][image["bufferView"].get<size_t>()];
  EXPECT_EQ(image["mimeType"], "image/png");
  EXPECT_EQ(document.buffer.substr(view["byteOffset"], view["byteLength"]), atlas.bytes);
  EXPECT_EQ(ReadFile(folder / "body.glb"), GlbOfBody(body, atlas, {}, 50));
}

TEST(Gltf, RefusesWhatIsNoPose) {
  const BodyTemplate body = Flag();
  const AtlasPng atlas = BlackAtlas(32);
  const std::vector<ArticulatedPose> good = Dance(body, 2);
  std::vector<ArticulatedPose> poses = good;
  poses[1].local_rotations.pop_back();
  EXPECT_THROW(GlbOfBody(body, atlas, Numbered(poses), 50), ContractViolation);
  poses = good, poses[1].shift.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(GlbOfBody(body, atlas, Numbered(poses), 50), ContractViolation);
  poses = good, poses[0].local_rotations[0].coeffs().setZero();
  EXPECT_THROW(GlbOfBody(body, atlas, Numbered(poses), 50), ContractViolation);
  EXPECT_THROW(GlbOfBody(body, atlas, Numbered(good), 0), ContractViolation);
  EXPECT_THROW(GlbOfBody(body, {atlas.bytes, 16}, Numbered(good), 50), ContractViolation);
}

}  // namespace
}  // namespace mvstudio::body
