#include "avatar/splats/bend.h"

#include <cmath>
#include <limits>

#include "avatar/splats/gradients.h"
#include "avatar/splats/render.h"
#include "avatar/splats/train/initial.h"
#include "avatar/splats/train/loss.h"
#include "core/error.h"
#include "tests/splats/scenes.h"
#include "tests/support/test.h"

namespace mvstudio::splats {
namespace {

/// A small mannequin; bones turned by these local rotations about their heads, root placed anywhere.
struct Posed {
  body::BodyTemplate body = body::MakeMannequin(1.75, 0.5);
  std::vector<Eigen::Quaterniond> local;

  Posed() : local(body.bone_parents.size(), Eigen::Quaterniond::Identity()) {}
  int Bone(body::BoneRole role) const {
    for (size_t b = 0; b < body.bone_roles.size(); ++b)
      if (body.bone_roles[b] == role) return static_cast<int>(b);
    return -1;
  }
  Eigen::Matrix3Xf Vertices() const {
    const geometry::Rigid3 placed = {geometry::RotationExp({0.4, -0.2, 2.5}), {1, 2, 3}};
    return body::SkinVertices(body, body::PoseFromAngles(body, placed, local));
  }
};

TEST(BoneTurns, AreThoseOfThePose) {
  Posed posed;
  const int elbow = posed.Bone(body::BoneRole::kLeftForearm), thigh = posed.Bone(body::BoneRole::kRightThigh);
  ASSERT_TRUE(elbow >= 0 && thigh >= 0);
  const Eigen::Matrix3Xf none = BoneTurns(posed.body, posed.Vertices());
  EXPECT_LT(none.cwiseAbs().maxCoeff(), 2e-3f) << "at rest, wherever the person stands";
  const Eigen::Vector3d bent(0.1, 0.2, -0.9), lifted(-0.7, 0, 0.2);
  posed.local[static_cast<size_t>(elbow)] = Eigen::AngleAxisd(bent.norm(), bent.normalized());
  posed.local[static_cast<size_t>(thigh)] = Eigen::AngleAxisd(lifted.norm(), lifted.normalized());
  const Eigen::Matrix3Xf turns = BoneTurns(posed.body, posed.Vertices());
  // Vertices near the joints follow two bones, so the fit takes a part of the turn.
  EXPECT_LT((turns.col(elbow).cast<double>() - bent).norm(), 0.1 * bent.norm());
  EXPECT_LT((turns.col(thigh).cast<double>() - lifted).norm(), 0.1 * lifted.norm());
  EXPECT_EQ(turns.col(0).norm(), 0) << "a root has no turn";
}

TEST(BoneTurns, WhatFixesNoRotationTurnsWithItsParent) {
  Posed posed;
  Eigen::Matrix3Xf vertices = posed.Vertices();
  EXPECT_TRUE(BoneTurns(posed.body, Eigen::Matrix3Xf::Zero(3, vertices.cols())).isZero());
  vertices.setConstant(std::numeric_limits<float>::quiet_NaN());
  EXPECT_TRUE(BoneTurns(posed.body, vertices).isZero());
  EXPECT_TRUE(BoneTurns(posed.body, Eigen::Matrix3Xf::Constant(3, vertices.cols(), 1e30f)).allFinite());
  EXPECT_THROW(BoneTurns(posed.body, Eigen::Matrix3Xf::Zero(3, 5)), ContractViolation);
}

TEST(BonesOfFaces, AreThoseWithTheMostWeight) {
  body::BodyTemplate body;
  body.faces.resize(3, 2), body.faces << 0, 0, 1, 1, 2, 1;
  body.bone_parents = {-1, 0, 1};
  body.skin_bones.resize(4, 3), body.skin_bones << 0, 0, 2, 1, 1, 2, 2, 2, 2, 0, 0, 2;
  body.skin_weights.resize(4, 3), body.skin_weights << 0.5f, 0.25f, 1, 0.5f, 0.75f, 0, 0, 0, 0, 0, 0, 0;
  const Eigen::Matrix2Xi bones = BonesOfFaces(body);
  EXPECT_EQ(bones(0, 0), 1) << "0.5 + 0.75, before 1 of bone 2 and 0.75 of bone 0";
  EXPECT_EQ(bones(1, 0), 2);
  body.skin_weights.setZero(), body.skin_weights.row(0).setOnes(), body.skin_bones.setZero();
  EXPECT_EQ(BonesOfFaces(body)(1, 1), -1) << "one bone alone";
}

/// A random scene with a corrective, and turns of three bones.
struct BendingScene {
  testing::Scene scene = testing::RandomScene(9, 1, 5);
  Eigen::Matrix2Xi bones{2, 9};
  Eigen::Matrix3Xd turns{3, 3};

  BendingScene() {
    Rng rng(8);
    for (int i = 0; i < 9; ++i) bones(0, i) = i % 3, bones(1, i) = i % 2 == 0 ? (i + 1) % 3 : -1;
    for (double& turn : turns.reshaped()) turn = 0.5 * rng.Normal();
    scene.cloud.values.bends = true;
    for (int k = 0; k < 9 * kBendSize; ++k) scene.cloud.values.bend.push_back(0.3 * rng.Normal());
  }
  Bending<double> bending() const { return {bones, turns}; }
  double LossOf(const Truth<double>& truth) const {
    RasterImage<double> unused;
    const auto drawn = testing::Draw<double>(Bent(scene.cloud, bending()), scene.surface(), scene.view(), {});
    return Loss(drawn.image, truth, {1, 0.5, 1}, &unused).total;
  }
};

TEST(Bend, GradientIsTheDifference) {
  BendingScene s;
  Image image(26, 21, 3, 90), mask(26, 21, 1);
  for (size_t i = 0; i < mask.pixels.size(); ++i) mask.pixels[i] = i % 26 > 5 && i % 26 < 20 ? 255 : 0;
  const Truth<double> truth = TruthOf<double>(image, mask);
  RasterImage<double> by_image;
  const BasicCloud<double> bent = Bent(s.scene.cloud, s.bending());
  const auto drawn = testing::Draw<double>(bent, s.scene.surface(), s.scene.view(), {});
  Loss(drawn.image, truth, {1, 0.5, 1}, &by_image);
  const auto by_splat = RasteriseBackward(drawn.projected.splats, drawn.tiles, drawn.image, by_image, 1);
  Parameters<double> by_bent = ZeroParameters<double>(9, 1), gradient = ZeroParameters<double>(9, 1, true);
  AddGradients<double>(bent, s.scene.surface(), s.scene.view(), {}, drawn.projected.splats, by_splat, &by_bent, nullptr);
  AddBendGradient(s.scene.cloud, s.bending(), by_bent, &gradient);
  double most = 0;
  for (size_t k = 0; k < gradient.bend.size(); ++k) {
    constexpr double kStep = 1e-5;
    BendingScene plus = s, minus = s;
    plus.scene.cloud.values.bend[k] += kStep, minus.scene.cloud.values.bend[k] -= kStep;
    const double difference = (plus.LossOf(truth) - minus.LossOf(truth)) / (2 * kStep);
    ASSERT_NEAR(gradient.bend[k], difference, 1e-6 + 1e-4 * std::abs(difference)) << k;
    most = std::max(most, std::abs(difference));
  }
  EXPECT_GT(most, 1e-3);
}

TEST(Bend, IsLinearInTheTurns) {
  BendingScene s;
  const BasicCloud<double> once = Bent(s.scene.cloud, s.bending());
  EXPECT_FALSE(once.values.bends);
  s.turns *= 2;
  const BasicCloud<double> twice = Bent(s.scene.cloud, s.bending());
  const Parameters<double>& still = s.scene.cloud.values;
  for (size_t i = 0; i < 9; ++i) {
    EXPECT_NEAR(twice.values.offset[i] - still.offset[i], 2 * (once.values.offset[i] - still.offset[i]), 1e-12);
    EXPECT_NEAR(twice.values.opacity[i] - still.opacity[i], 2 * (once.values.opacity[i] - still.opacity[i]), 1e-12);
    EXPECT_EQ(twice.values.colour[12 * i + 3], still.colour[12 * i + 3]) << "higher degrees stay";
  }
  s.turns.setZero();
  EXPECT_EQ(Bent(s.scene.cloud, s.bending()).values.offset, still.offset);
  BasicCloud<double> plain = s.scene.cloud;
  plain.values.bends = false, plain.values.bend.clear();
  EXPECT_EQ(Bent(plain, s.bending()).values.colour, plain.values.colour);
}

TEST(Bend, RenderingBendsByThePosedMeshAlone) {
  Posed posed;
  Cloud cloud = CoverBody(posed.body, body::MannequinTextures(16, 2), 2000, 0, 1);
  geometry::RigCamera camera = testing::CameraOf(64, 64, 60);
  camera.cam_from_world = {geometry::RotationExp({-M_PI / 2, 0, 0}), {0, 0.9, 2.5}};
  const auto image = [&](const Eigen::Matrix3Xf& vertices) {
    return RenderGaussians(cloud, posed.body, vertices, camera, {}).image.pixels;
  };
  const Eigen::Matrix3Xf rest = posed.body.vertices;
  const int thigh = posed.Bone(body::BoneRole::kRightThigh);
  posed.local[static_cast<size_t>(thigh)] = Eigen::AngleAxisd(0.6, Eigen::Vector3d::UnitX());
  const Eigen::Matrix3Xf lifted = body::SkinVertices(posed.body, body::PoseFromAngles(posed.body, {}, posed.local));
  const auto rest_before = image(rest), lifted_before = image(lifted);
  cloud.values.bends = true, cloud.values.bend.assign(cloud.size() * kBendSize, 0.f);
  EXPECT_EQ(image(lifted), lifted_before) << "coefficients of 0";
  for (size_t k = 2; k < cloud.values.bend.size(); k += kBendKinds) cloud.values.bend[k] = 2;  // red with every turn
  EXPECT_NE(image(lifted), lifted_before);
  size_t different = 0;
  const auto rest_after = image(rest);
  for (size_t k = 0; k < rest_after.size(); ++k) different += std::abs(rest_after[k] - rest_before[k]) > 1;
  EXPECT_LT(different, rest_after.size() / 100) << "at rest no bone is turned";
  EXPECT_THROW(RenderSplats(cloud, posed.body.faces, rest, camera, {}), ContractViolation);
}

}  // namespace
}  // namespace mvstudio::splats
