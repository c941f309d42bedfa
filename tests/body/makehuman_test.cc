#include <Eigen/Geometry>

#include "avatar/body/makehuman/obj.h"
#include "avatar/body/makehuman/read.h"
#include "avatar/body/makehuman/rig.h"
#include "avatar/body/makehuman/target.h"
#include "core/error.h"
#include "core/random.h"
#include "tests/body/surface_checks.h"
#include "tests/support/message_of.h"
#include "tests/support/test.h"
#include "tests/support/test_data.h"

namespace mvstudio::body {
namespace {

const BodyTemplate& MakeHuman() {
  static const BodyTemplate body = ReadMakeHuman(mvstudio::testing::DataRoot() + "/makehuman_cc0");
  return body;
}

std::array<bool, 19> AllJoints() {
  std::array<bool, 19> valid;
  valid.fill(true);
  return valid;
}

Eigen::Matrix3Xd RandomJoints(const BodyTemplate& body, Rng* rng) {
  std::vector<Eigen::Quaterniond> turns;
  for (size_t b = 0; b < body.bone_names.size(); ++b)
    turns.push_back(geometry::RotationExp(0.3 * Eigen::Vector3d(rng->Normal(), rng->Normal(), rng->Normal())));
  return PosedCoco19(body, PoseFromAngles(body, {Eigen::Quaterniond::Identity(), {1, 2, 0}}, turns));
}

TEST(MakeHuman, IsAClosedBodyOfTheRightSize) {
  MVS_NEEDS_DATA("makehuman_cc0");
  const BodyTemplate& body = MakeHuman();
  EXPECT_EQ(body.faces.cols(), 2 * 13378);
  ExpectClosedSurface(body);
  ExpectSoundSkin(body);
  EXPECT_NEAR(body.vertices.row(2).minCoeff(), 0, 1e-6);
  EXPECT_NEAR(body.vertices.row(2).maxCoeff(), 1.66, 0.05);
  EXPECT_LT(body.coco19(1, 1), body.coco19(1, 16) - 0.05);  // faces -y
  for (int j : {3, 4, 5, 6, 7, 8, 15, 16}) EXPECT_GT(body.coco19(0, j), 0.02) << j;
  for (int j : {9, 10, 11, 12, 13, 14, 17, 18}) EXPECT_LT(body.coco19(0, j), -0.02) << j;
}

TEST(MakeHuman, SidesDoNotPullEachOther) {
  MVS_NEEDS_DATA("makehuman_cc0");
  const BodyTemplate& body = MakeHuman();
  for (Eigen::Index i = 0; i < body.vertices.cols(); ++i) {
    if (std::abs(body.vertices(0, i)) < 0.12) continue;
    const std::string other = body.vertices(0, i) > 0 ? "Right" : "Left";
    float weight = 0;
    for (int k = 0; k < 4; ++k) {
      if (body.bone_names[body.skin_bones(k, i)].rfind(other, 0) == 0) weight += body.skin_weights(k, i);
    }
    EXPECT_LT(weight, 0.02f) << body.vertices.col(i).transpose();
  }
}

TEST(MakeHuman, PoseFromJointsMeetsTheJoints) {
  MVS_NEEDS_DATA("makehuman_cc0");
  for (const char* rig : {"cmu_mb", "game_engine"}) {
    const BodyTemplate body = ReadMakeHuman(mvstudio::testing::DataRoot() + "/makehuman_cc0", rig);
    Rng rng(7);
    for (int trial = 0; trial < 50; ++trial) {
      const Eigen::Matrix3Xd own = RandomJoints(body, &rng);
      Eigen::Matrix3Xd joints = 0.8 * own;
      for (int j = 0; j < 19; ++j) joints.col(j) += 0.01 * Eigen::Vector3d(rng.Normal(), rng.Normal(), rng.Normal());
      BodyPose pose;
      ASSERT_TRUE(PoseFromJoints(body, own, AllJoints(), &pose));
      EXPECT_LT((PosedCoco19(body, pose) - own).colwise().norm().maxCoeff(), 1e-6) << rig;
      ASSERT_TRUE(PoseFromJoints(body, joints, AllJoints(), &pose));
      const Eigen::VectorXd error = (PosedCoco19(body, pose) - joints).colwise().norm();
      for (int j : {0, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14}) EXPECT_LT(error[j], 1e-6) << rig << ", joint " << j;
      EXPECT_TRUE(SkinVertices(body, pose).allFinite());
    }
  }
}

/// The rest joints give the rest pose: bones between those with a role follow.
TEST(MakeHuman, RestJointsGiveTheRestBody) {
  MVS_NEEDS_DATA("makehuman_cc0");
  const BodyTemplate& body = MakeHuman();
  BodyPose pose;
  ASSERT_TRUE(PoseFromJoints(body, body.coco19, AllJoints(), &pose));
  EXPECT_LT((SkinVertices(body, pose) - body.vertices).colwise().norm().maxCoeff(), 1e-5);
}

TEST(MakeHuman, ShapesAreLinearAndMoveTheJointsAlong) {
  MVS_NEEDS_DATA("makehuman_cc0");
  const BodyTemplate& body = MakeHuman();
  const auto count = static_cast<Eigen::Index>(body.shapes.names.size());
  ASSERT_EQ(count, 26);
  Rng rng(8);
  Eigen::VectorXd a(count), b(count);
  for (Eigen::Index s = 0; s < count; ++s) a[s] = 0.2 * rng.Normal(), b[s] = 0.2 * rng.Normal();
  const BodyTemplate both = WithShape(body, a + b), steps = WithShape(WithShape(body, a), b);
  EXPECT_LT((both.vertices - steps.vertices).cwiseAbs().maxCoeff(), 1e-5);
  EXPECT_LT((both.coco19 - steps.coco19).cwiseAbs().maxCoeff(), 1e-9);
  EXPECT_LT((both.bone_heads - steps.bone_heads).cwiseAbs().maxCoeff(), 1e-9);
  const auto name = std::find(body.shapes.names.begin(), body.shapes.names.end(), "caucasian-male-young");
  ASSERT_NE(name, body.shapes.names.end());
  Eigen::VectorXd tall = Eigen::VectorXd::Zero(count);
  tall[name - body.shapes.names.begin()] = 1;
  const BodyTemplate male = WithShape(body, tall);
  const double up = male.vertices.row(2).maxCoeff() - body.vertices.row(2).maxCoeff();
  EXPECT_GT(up, 0.05);
  EXPECT_GT(male.coco19(2, 1) - body.coco19(2, 1), 0.8 * up);
  EXPECT_LT((male.bone_heads.col(male.coco19_bone[4]) - male.coco19.col(4)).norm(), 1e-6);  // the elbow
  BodyPose pose;
  ASSERT_TRUE(PoseFromJoints(male, body.coco19, AllJoints(), &pose));
  EXPECT_LT((PosedCoco19(male, pose) - body.coco19).leftCols<15>().rightCols<12>().colwise().norm().maxCoeff(), 1e-6);
}

TEST(MakeHuman, AtlasUsesAllChartsAndSpansNoSeam) {
  MVS_NEEDS_DATA("makehuman_cc0");
  const BodyTemplate& body = MakeHuman();
  std::array<Eigen::Vector3d, kNumParts + 1> sum;
  std::array<int, kNumParts + 1> count{};
  sum.fill(Eigen::Vector3d::Zero());
  int wide = 0;
  for (int f = 0; f < body.faces.cols(); ++f) {
    ASSERT_TRUE(body.face_part[f] >= 1 && body.face_part[f] <= kNumParts);
    for (int k = 0; k < 3; ++k) sum[body.face_part[f]] += body.vertices.col(body.faces(k, f)).cast<double>() / 3;
    ++count[body.face_part[f]];
    const auto u = body.face_uv.middleCols<3>(3 * f).row(0);
    wide += u.maxCoeff() - u.minCoeff() > 0.5f;
  }
  EXPECT_LT(wide, 10);  // where a face lies across the axis
  EXPECT_GE(body.face_uv.minCoeff(), 0);
  EXPECT_LE(body.face_uv.maxCoeff(), 1);
  for (int part = 1; part <= kNumParts; ++part) EXPECT_GT(count[part], 100) << "part " << part;
  const auto mean = [&](int part) { return Eigen::Vector3d(sum[part] / count[part]); };
  for (auto [back, front] : {std::pair(1, 2), {7, 9}, {8, 10}, {11, 13}, {12, 14}})
    EXPECT_GT(mean(back)[1], mean(front)[1] + 0.03);
  for (int left : {4, 5, 8, 10, 12, 14, 15, 17, 19, 21, 24}) EXPECT_GT(mean(left)[0], 0.02) << left;
  for (int right : {3, 6, 7, 9, 11, 13, 16, 18, 20, 22, 23}) EXPECT_LT(mean(right)[0], -0.02) << right;
}

template <class F>
std::string Refusal(const F& read) {
  return mvstudio::testing::MessageOf<FormatError>(read);
}

TEST(Obj, ReadsGroupsAndRefusesWithTheLine) {
  const std::string text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\ng a\nf 1/1 2/1 3/1\r\ng b\nf 1//2 2 3 4\n";
  const ObjMesh mesh = ParseObj(text, "a.obj");
  EXPECT_EQ(mesh.vertices.cols(), 4);
  EXPECT_EQ(GroupVertices(mesh, "a", "a.obj"), (std::vector<int>{0, 1, 2}));
  EXPECT_EQ(mesh.faces.at("b")[0].size(), 4u);
  EXPECT_THROW(GroupVertices(mesh, "c", "a.obj"), FormatError);
  for (const char* line : {"f 1 2 5", "f 0 1 2", "f -1 1 2", "f 1 2", "f 1 2 3 4 1", "f a b c", "f 1 2 99999999999999", "v 1 2",
                           "v 1 2 nan", "v 1 2 1e999", "v 1 2 x", "f 1.5 2 3"}) {
    EXPECT_NE(Refusal([&] { ParseObj(text + line, "a.obj"); }).find("a.obj: line 9"), std::string::npos) << line;
  }
}

TEST(Rig, RefusesWithThePlace) {
  const ObjMesh mesh = ParseObj("v 0 0 0\nv 1 0 0\nv 0 1 0\ng cube\nf 1 2 3\n", "a.obj");
  const std::string cube = R"({"strategy": "CUBE", "cube_name": "cube"})";
  const auto bone = [&](const std::string& parent, const std::string& head) {
    return R"({"parent": ")" + parent + R"(", "head": )" + head + R"(, "tail": )" + cube + "}";
  };
  const MakeHumanRig rig = ParseRig(
      R"({"b": )" + bone("a", cube) + R"(, "a": )" + bone("", R"({"strategy": "MEAN", "vertex_indices": [0, 2]})") + "}",
      "rig.json", mesh);
  ASSERT_EQ(rig.bones.size(), 2u);
  EXPECT_EQ(rig.bones[1].name, "b");
  EXPECT_EQ(rig.bones[1].parent, 0);
  const auto refusal = [&](const std::string& text) { return Refusal([&] { ParseRig(text, "rig.json", mesh); }); };
  for (const auto& [text, place] : std::vector<std::pair<std::string, std::string>>{
           {"{", "byte"},
           {"[]", "object"},
           {R"({"a": 1})", "a"},
           {R"({"a": )" + bone("b", cube) + "}", "a.parent"},
           {R"({"a": )" + bone("a", cube) + "}", "ancestor"},
           {R"({"": )" + bone("a", cube) + R"(, "a": )" + bone("", cube) + "}", "no name"},
           {R"({"a": )" + bone("", R"({"strategy": "FOO"})") + "}", "a.head.strategy"},
           {R"({"a": )" + bone("", R"({"strategy": "CUBE", "cube_name": "x"})") + "}", "a.head.cube_name"},
           {R"({"a": )" + bone("", R"({"strategy": "MEAN", "vertex_indices": []})") + "}", "a.head.vertex_indices"},
           {R"({"a": )" + bone("", R"({"strategy": "MEAN", "vertex_indices": [0, 3]})") + "}", "a.head.vertex_indices[1]"}}) {
    EXPECT_NE(refusal(text).find("rig.json"), std::string::npos) << text;
    EXPECT_NE(refusal(text).find(place), std::string::npos) << refusal(text);
  }
  const auto weights = [&](const std::string& text) { return Refusal([&] { ParseRigWeights(text, "w.json", rig, 3); }); };
  EXPECT_NE(weights(R"({"weights": {"a": [[0, 1], [3, 1]]}})").find("weights.a[1][0]"), std::string::npos);
  EXPECT_NE(weights(R"({"weights": {"a": [[0, 2]]}})").find("weights.a[0][1]"), std::string::npos);
  EXPECT_NE(weights(R"({"weights": {"a": [[0]]}})").find("weights.a[0]"), std::string::npos);
  EXPECT_NE(weights(R"({"weights": {"c": [[0, 1]]}})").find("weights.c"), std::string::npos);
}

TEST(Target, RefusesWithTheLine) {
  EXPECT_EQ(ParseTarget("# a morph\n1 .5 -.25 0\n", "a.target", 3)(1, 1), -0.25);
  for (const char* line : {"3 0 0 0", "-1 0 0 0", "0 0 0", "0 0 0 0 0", "0 a 0 0", "0 inf 0 0", "0.5 0 0 0"}) {
    EXPECT_NE(Refusal([&] { ParseTarget("# a morph\n" + std::string(line), "a.target", 3); }).find("a.target: line 2"),
              std::string::npos)
        << line;
  }
  EXPECT_THROW(Gunzip("0 0 0 0\n", "a.target.gz", 100), FormatError);
  EXPECT_THROW(Gunzip("\x1f\x8b\x08", "a.target.gz", 100), FormatError);
}

}  // namespace
}  // namespace mvstudio::body
