#include <Eigen/Geometry>

#include "avatar/body/smpl/read.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "core/random.h"
#include "tests/body/pickle_bytes.h"
#include "tests/body/small_smpl.h"
#include "tests/body/surface_checks.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::body {
namespace {

using small_smpl::Arrays;
using small_smpl::kBones;
using small_smpl::kParents;
using small_smpl::kShapes;
using small_smpl::Model;

/// SMPL as its paper writes it, in its own frame: vertices, then joints, (V + 24, 3).
Eigen::MatrixX3d ClosedForm(const Arrays& arrays, const Eigen::VectorXd& shape, const std::vector<Eigen::Matrix3d>& turns) {
  const int count = 6 * kBones;
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const auto map = [&arrays](const char* name, int rows, int cols) {
    return Eigen::Map<const RowMajor>(arrays.at(name).values.data(), rows, cols);
  };
  const Eigen::VectorXd flat = map("v_template", 3 * count, 1) + map("shapedirs", 3 * count, kShapes) * shape;
  const RowMajor shaped = Eigen::Map<const RowMajor>(flat.data(), count, 3);
  const RowMajor joints = map("J_regressor", kBones, count) * shaped;
  Eigen::VectorXd entries(9 * (kBones - 1));
  for (int b = 1; b < kBones; ++b) {
    for (int i = 0; i < 9; ++i) entries[9 * (b - 1) + i] = turns[b](i / 3, i % 3) - (i / 3 == i % 3);
  }
  const Eigen::VectorXd posed = flat + map("posedirs", 3 * count, 9 * (kBones - 1)) * entries;
  std::vector<Eigen::Matrix4d> world(kBones);
  Eigen::MatrixX3d result = Eigen::MatrixX3d::Zero(count + kBones, 3);
  for (int b = 0; b < kBones; ++b) {
    Eigen::Matrix4d local = Eigen::Matrix4d::Identity();
    local.topLeftCorner<3, 3>() = turns[b];
    local.topRightCorner<3, 1>() = joints.row(b).transpose();
    if (b > 0) local.topRightCorner<3, 1>() -= joints.row(kParents[b]).transpose();
    world[b] = b == 0 ? local : Eigen::Matrix4d(world[kParents[b]] * local);
    result.row(count + b) = world[b].topRightCorner<3, 1>().transpose();
  }
  for (int v = 0; v < count; ++v) {
    for (int b = 0; b < kBones; ++b) {
      const double weight = arrays.at("weights").values[static_cast<size_t>(v * kBones + b)];
      const Eigen::Vector3d from_joint = posed.segment<3>(3 * v) - joints.row(b).transpose();
      result.row(v) += weight * (world[b] * from_joint.homogeneous()).head<3>().transpose();
    }
  }
  return result;
}

Eigen::Matrix3d BodyFromSmpl() {
  Eigen::Matrix3d turn;
  turn << 1, 0, 0, 0, 0, -1, 0, 1, 0;
  return turn;
}

TEST(Smpl, SkinsLikeItsClosedForm) {
  const Arrays arrays = Model();
  const BodyTemplate body = SmplFromArrays(arrays, "model");
  const Eigen::Matrix3d turn = BodyFromSmpl();
  Rng rng(5);
  for (int trial = 0; trial < 5; ++trial) {
    const Eigen::Vector3d shape(rng.Normal(), rng.Normal(), rng.Normal());
    std::vector<Eigen::Matrix3d> turns;
    std::vector<Eigen::Quaterniond> local;
    for (int b = 0; b < kBones; ++b) {
      const Eigen::Quaterniond q = geometry::RotationExp(0.4 * Eigen::Vector3d(rng.Normal(), rng.Normal(), rng.Normal()));
      turns.push_back(q.toRotationMatrix());
      local.emplace_back(turn * turns.back() * turn.transpose());
    }
    const Eigen::MatrixX3d truth = ClosedForm(arrays, shape, turns);
    const BodyTemplate shaped = WithShape(body, shape);
    const BodyPose pose = PoseFromAngles(shaped, {}, local);
    const Eigen::Matrix3Xd vertices = SkinVertices(shaped, pose).cast<double>();
    const Eigen::Vector3d offset = pose.bone_transforms[0] * Eigen::Vector3d(shaped.bone_heads.col(0)) -
                                   turn * truth.row(6 * kBones).transpose();  // the floor
    EXPECT_LT(offset.head<2>().norm(), 1e-6);
    for (Eigen::Index v = 0; v < vertices.cols(); ++v)
      ASSERT_LT((vertices.col(v) - turn * truth.row(v).transpose() - offset).norm(), 2e-6) << "vertex " << v;
    for (int b = 0; b < kBones; ++b) {
      const Eigen::Vector3d head = pose.bone_transforms[b] * Eigen::Vector3d(shaped.bone_heads.col(b));
      ASSERT_LT((head - turn * truth.row(6 * kBones + b).transpose() - offset).norm(), 2e-6) << "joint " << b;
    }
  }
}

TEST(Smpl, IsATemplateLikeOthers) {
  const BodyTemplate body = SmplFromArrays(Model(), "model");
  ExpectClosedSurface(body);
  ExpectSoundSkin(body);
  EXPECT_NEAR(body.vertices.row(2).minCoeff(), 0, 1e-7);
  for (int j = 3; j < 9; ++j) EXPECT_GT(body.coco19(0, j), 0.05) << j;
  for (int j = 9; j < 15; ++j) EXPECT_LT(body.coco19(0, j), -0.05) << j;
  EXPECT_LT(body.coco19(1, 1), body.coco19(1, 0));  // the nose is before the neck
  for (const int part : body.face_part) EXPECT_TRUE(part >= 1 && part <= kNumParts);
  EXPECT_GE(body.face_uv.minCoeff(), 0);
  EXPECT_LE(body.face_uv.maxCoeff(), 1);
  std::array<bool, 19> all;
  all.fill(true);
  Rng rng(6);
  for (int trial = 0; trial < 20; ++trial) {
    std::vector<Eigen::Quaterniond> turns;
    for (int b = 0; b < kBones; ++b)
      turns.push_back(geometry::RotationExp(0.25 * Eigen::Vector3d(rng.Normal(), rng.Normal(), rng.Normal())));
    const Eigen::Matrix3Xd truth = PosedCoco19(body, PoseFromAngles(body, {}, turns));
    BodyPose pose;
    ASSERT_TRUE(PoseFromJoints(body, truth, all, &pose));
    EXPECT_LT((PosedCoco19(body, pose) - truth).colwise().norm().maxCoeff(), 1e-6);
  }
}

TEST(Smpl, OtherFilesAreRefused) {
  const mvstudio::testing::TempDir folder;
  for (const char* name : {"a.npz", "a.pkl", "a.txt"}) {
    const std::string path = folder / name;
    WriteFileAtomic(path, "no body");
    EXPECT_THROW(ReadSmpl(path), FormatError) << name;
  }
  EXPECT_THROW(ReadSmpl(folder / "none.npz"), IoError);
}

void ExpectSameBody(const BodyTemplate& a, const BodyTemplate& b) {
  EXPECT_EQ(a.vertices, b.vertices);
  EXPECT_EQ(a.faces, b.faces);
  EXPECT_EQ(a.bone_parents, b.bone_parents);
  EXPECT_EQ(a.bone_heads, b.bone_heads);
  EXPECT_EQ(a.bone_tails, b.bone_tails);
  EXPECT_EQ(a.skin_bones, b.skin_bones);
  EXPECT_EQ(a.skin_weights, b.skin_weights);
  EXPECT_EQ(a.coco19, b.coco19);
  EXPECT_EQ(a.shapes.vertices, b.shapes.vertices);
  EXPECT_EQ(a.pose_directions, b.pose_directions);
}

TEST(Smpl, PicklesAndTheirCopiesAreOneBody) {
  const mvstudio::testing::TempDir folder;
  for (const bool whole : {true, false}) {
    Arrays arrays = Model();
    if (!whole) arrays.erase("shapedirs"), arrays.erase("posedirs");
    arrays["other"] = {{1}, {5}};
    WriteFileAtomic(folder / "a.pkl", pickle_bytes::DictOf(arrays));
    const Arrays read = ReadSmplArrays(folder / "a.pkl");
    EXPECT_EQ(read.size(), arrays.size() - 1) << "arrays that are no body's are left out";
    WriteFileAtomic(folder / "a.npz", SmplNpz(read, "a.pkl"));
    const Arrays again = ReadSmplArrays(folder / "a.npz");
    for (const auto& [name, array] : read) {
      EXPECT_EQ(again.at(name).shape, array.shape) << name;
      EXPECT_EQ(again.at(name).values, array.values) << name;
    }
    ExpectSameBody(ReadSmpl(folder / "a.npz"), SmplFromArrays(arrays, "model"));
    ExpectSameBody(ReadSmpl(folder / "a.npz"), ReadSmpl(folder / "a.pkl"));
    EXPECT_EQ(SmplNpz(again, "a.npz"), SmplNpz(read, "a.pkl"));
  }
  Arrays damaged = Model();
  damaged.at("f").values[5] = 0.5;
  EXPECT_THROW(SmplNpz(damaged, "a.pkl"), FormatError);
}

TEST(Smpl, WorksWithoutShapes) {
  Arrays arrays = Model();
  arrays.erase("shapedirs");
  arrays.erase("posedirs");
  const BodyTemplate body = SmplFromArrays(arrays, "model");
  EXPECT_TRUE(body.shapes.names.empty());
  EXPECT_EQ(body.pose_directions.size(), 0);
  EXPECT_EQ(WithShape(body, Eigen::VectorXd()).vertices, body.vertices);
}

TEST(Smpl, NamesTheArrayThatDoesNotFit) {
  const auto refusal = [](const std::string& name, const auto& change) {
    Arrays arrays = Model();
    change(&arrays.at(name));
    return mvstudio::testing::MessageOf<FormatError>([&] { SmplFromArrays(arrays, "model.npz"); });
  };
  const auto expect = [&](const std::string& name, const auto& change) {
    EXPECT_NE(refusal(name, change).find("model.npz: " + name), std::string::npos) << refusal(name, change);
  };
  for (const char* name : {"v_template", "f", "weights", "J_regressor", "kintree_table", "shapedirs", "posedirs"}) {
    expect(name, [](NpyArray* array) { array->shape.push_back(1); });
    expect(name, [](NpyArray* array) { array->values.pop_back(); });
    expect(name, [](NpyArray* array) { array->values[1] = std::nan(""); });
  }
  expect("f", [](NpyArray* array) { array->values[5] = 1e6; });
  expect("f", [](NpyArray* array) { array->values[5] = -1; });
  expect("kintree_table", [](NpyArray* array) { array->values[3] = 3; });
  expect("kintree_table", [](NpyArray* array) { array->values[23] = 24; });
  Arrays none;
  EXPECT_THROW(SmplFromArrays(none, "model"), FormatError);
}

}  // namespace
}  // namespace mvstudio::body
