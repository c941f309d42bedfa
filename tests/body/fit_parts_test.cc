#include <Eigen/LU>
#include <cmath>

#include "avatar/body/fit/mask_outline.h"
#include "avatar/body/fit/offsets.h"
#include "avatar/body/fit/photometric.h"
#include "avatar/body/fit/pose_solver.h"
#include "avatar/body/fit/posed_bones.h"
#include "avatar/body/fit/rim.h"
#include "avatar/body/fit/rotation_prior.h"
#include "avatar/body/texture/surface_image.h"
#include "core/random.h"
#include "tests/support/test.h"

namespace mvstudio::body {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

const BodyTemplate& SmallBody() {
  static const BodyTemplate body = MakeMannequin(1.75, 0.5);
  return body;
}

/// A person's camera: looks along world y from 3 m before it, at hip height.
geometry::RigCamera FrontCamera(int size_px) {
  geometry::RigCamera camera;
  camera.camera = geometry::MakePinhole("front", size_px, size_px, 1.3 * size_px);
  Eigen::Matrix3d axes;
  axes << 1, 0, 0, 0, 0, -1, 0, 1, 0;
  camera.cam_from_world.rotation = Eigen::Quaterniond(axes);
  camera.cam_from_world.translation = -(axes * Vector3d(0, -3, 0.9));
  return camera;
}

ArticulatedPose RandomPose(const BodyTemplate& body, double spread_rad, Rng& rng) {
  ArticulatedPose pose;
  for (size_t b = 0; b < body.bone_names.size(); ++b)
    pose.local_rotations.push_back(geometry::RotationExp(spread_rad * Vector3d(rng.Normal(), rng.Normal(), rng.Normal())));
  pose.shift = 0.2 * Vector3d(rng.Normal(), rng.Normal(), rng.Normal());
  return pose;
}

/// A disc with grey rim pixels, as shares of the pixels.
Image Disc(int size_px, const Vector2d& centre, double radius) {
  Image disc(size_px, size_px, 1);
  for (int y = 0; y < size_px; ++y) {
    for (int x = 0; x < size_px; ++x) {
      const double inside = radius - (Vector2d(x, y) - centre).norm() + 0.5;
      *disc.Pixel(x, y) = static_cast<uint8_t>(std::lround(255 * std::clamp(inside, 0.0, 1.0)));
    }
  }
  return disc;
}

TEST(MaskOutline, DistanceToADiscIsRightWithinATenthOfAPixel) {
  const Vector2d centre(50.3, 47.8);
  const MaskOutline outline(Disc(100, centre, 30));
  for (int k = 0; k < 360; k += 7) {
    const Vector2d out(std::cos(k * M_PI / 180), std::sin(k * M_PI / 180));
    for (const double radius : {22.0, 28.7, 30.0, 33.3, 38.0}) {
      const auto distance = outline.Distance(centre + radius * out, out, 12);
      ASSERT_TRUE(distance.has_value()) << k << " " << radius;
      EXPECT_NEAR(*distance, 30 - radius, 0.1) << k << " " << radius;
    }
  }
}

TEST(MaskOutline, NothingFarAwayOutsideOrAcross) {
  const MaskOutline outline(Disc(100, {50, 50}, 30));
  EXPECT_FALSE(outline.Distance({50, 50}, {1, 0}, 20).has_value()) << "too far";
  EXPECT_FALSE(outline.Distance({79, 50}, {0, 1}, 20).has_value()) << "the outline runs along the direction";
  EXPECT_FALSE(outline.Distance({150, 50}, {1, 0}, 20).has_value()) << "outside the image";
  EXPECT_FALSE(outline.Distance({std::nan(""), 50}, {1, 0}, 20).has_value());
  EXPECT_FALSE(MaskOutline(Image(100, 100, 1, 255)).Distance({95, 50}, {1, 0}, 20).has_value()) << "cut by the image's edge";
}

TEST(FindRim, RunsAlongTheBodysOwnSilhouette) {
  const geometry::RigCamera camera = FrontCamera(300);
  const Eigen::Matrix3Xf vertices = SmallBody().vertices;
  const MaskOutline outline(RasterizeCover(SmallBody().faces, vertices, camera));
  const std::vector<RimPoint> rim = FindRim(SmallBody().faces, vertices, camera);
  ASSERT_GT(rim.size(), 100u);
  int far = 0;
  for (const RimPoint& point : rim) {
    const auto gap = outline.Distance(point.px, point.outward, 5);
    far += !gap || std::abs(*gap) > 1;
  }
  EXPECT_LT(far, static_cast<int>(rim.size()) / 10);
}

TEST(FindRim, TheDerivativeIsThatOfTheProjection) {
  const geometry::RigCamera camera = FrontCamera(300);
  const geometry::Projector projector(camera.camera);
  for (const RimPoint& point : FindRim(SmallBody().faces, SmallBody().vertices, camera)) {
    const Vector3d x = SmallBody().vertices.col(point.vertex).cast<double>();
    for (int k = 0; k < 3; ++k) {
      const Vector3d step = 1e-5 * Vector3d::Unit(k);
      const Vector2d change =
          projector.Project(camera.cam_from_world * (x + step)).px - projector.Project(camera.cam_from_world * (x - step)).px;
      ASSERT_NEAR(point.d_out_d_x[k], point.outward.dot(change) / 2e-5, 1e-4);
    }
  }
}

TEST(ArticulatedPose, GoesThroughBodyPoseUnchanged) {
  Rng rng(3);
  const ArticulatedPose pose = RandomPose(SmallBody(), 0.4, rng);
  const ArticulatedPose back = FromBodyPose(SmallBody(), ToBodyPose(SmallBody(), pose));
  EXPECT_LT((back.shift - pose.shift).norm(), 1e-12);
  for (size_t b = 0; b < pose.local_rotations.size(); ++b)
    EXPECT_LT(geometry::RotationAngle(back.local_rotations[b], pose.local_rotations[b]), 1e-7);
}

TEST(PosedBones, VerticesAreThoseOfSkinning) {
  Rng rng(4);
  const ArticulatedPose pose = RandomPose(SmallBody(), 0.4, rng);
  const PosedBones bones(SmallBody(), pose);
  const Eigen::Matrix3Xf skinned = SkinVertices(SmallBody(), bones.pose());
  for (int v = 0; v < skinned.cols(); v += 17) EXPECT_LT((bones.Vertex(v) - skinned.col(v).cast<double>()).norm(), 1e-6);
}

TEST(PosedBones, DerivativesAgreeWithDifferences) {
  Rng rng(5);
  const BodyTemplate& body = SmallBody();
  const ArticulatedPose pose = RandomPose(body, 0.5, rng);
  const PosedBones bones(body, pose);
  const auto size = static_cast<Eigen::Index>(3 * body.bone_names.size() + 3);
  for (int v = 5; v < body.vertices.cols(); v += 301) {
    const Vector3d direction(rng.Normal(), rng.Normal(), rng.Normal());
    const Eigen::VectorXd gradient = bones.VertexDerivative(v, direction);
    for (Eigen::Index k = 0; k < size; ++k) {
      constexpr double kStep = 1e-6;
      const PoseStep step = kStep * Eigen::VectorXd::Unit(size, k);
      const double up = direction.dot(PosedBones(body, Retract(body, pose, step)).Vertex(v));
      const double down = direction.dot(PosedBones(body, Retract(body, pose, -step)).Vertex(v));
      ASSERT_NEAR(gradient[k], (up - down) / (2 * kStep), 1e-7) << "vertex " << v << ", unknown " << k;
    }
  }
}

JointObservation Observed(const BodyTemplate& body, const ArticulatedPose& pose, double sigma_m) {
  JointObservation joints;
  joints.x_in_world = PosedCoco19(body, ToBodyPose(body, pose));
  joints.valid.fill(true), joints.sigma_m.fill(sigma_m);
  return joints;
}

TEST(SolvePose, FindsTheJointsOfABody) {
  Rng rng(6);
  for (int k = 0; k < 20; ++k) {
    const ArticulatedPose truth = RandomPose(SmallBody(), 0.25, rng);
    PoseProblemInput input{Observed(SmallBody(), truth, 0.003), {AnatomicalPrior(SmallBody())}, {}};
    const PoseSolution found = SolvePose(SmallBody(), input, RandomPose(SmallBody(), 0, rng), 60);
    const double error =
        (PosedCoco19(SmallBody(), ToBodyPose(SmallBody(), found.pose)) - input.joints.x_in_world).colwise().norm().maxCoeff();
    EXPECT_LT(error, 0.01) << k;
  }
}

TEST(SolvePose, AJointFarAwayIsDoubted) {
  Rng rng(7);
  const ArticulatedPose truth = RandomPose(SmallBody(), 0.1, rng);
  PoseProblemInput input{Observed(SmallBody(), truth, 0.005), {AnatomicalPrior(SmallBody())}, {}};
  const Eigen::Matrix3Xd right = input.joints.x_in_world;
  input.joints.x_in_world.col(5) += Vector3d(0.8, 0.5, 0.3);
  const PoseSolution found = SolvePose(SmallBody(), input, RandomPose(SmallBody(), 0, rng), 60);
  Eigen::Matrix3Xd posed = PosedCoco19(SmallBody(), ToBodyPose(SmallBody(), found.pose));
  posed.col(5) = right.col(5);
  EXPECT_LT((posed - right).colwise().norm().maxCoeff(), 0.02);
}

TEST(UmbrellaLaplacian, IsZeroForConstantsAndNotForSpikes) {
  const auto laplacian = UmbrellaLaplacian(SmallBody().vertices, SmallBody().faces);
  EXPECT_LT((laplacian * Eigen::VectorXd::Ones(laplacian.cols())).cwiseAbs().maxCoeff(), 1e-9);
  EXPECT_NEAR((laplacian * Eigen::VectorXd::Unit(laplacian.cols(), 7))[7], 1, 1e-12);
}

TEST(StepOffsets, FollowsWhatIsSeenAndDoubtsOneThatDisagrees) {
  const Eigen::Index count = SmallBody().vertices.cols();
  const auto laplacian = UmbrellaLaplacian(SmallBody().vertices, SmallBody().faces);
  std::vector<OffsetObservation> seen;
  for (int v = 0; v < count; v += 3) seen.push_back({v, 200, 2, 0.5});
  seen.push_back({30, 200, 400, 0.5});
  Eigen::VectorXd offsets = Eigen::VectorXd::Zero(count);
  ASSERT_EQ(StepOffsets(laplacian, seen, {1e-3, 1}, &offsets), Status::kOk);
  EXPECT_NEAR(offsets.mean(), 0.01, 1e-3);
  EXPECT_LT(offsets.cwiseAbs().maxCoeff(), 0.03);
  seen.push_back({3, std::nan(""), 1, 1});
  const Eigen::VectorXd before = offsets;
  EXPECT_EQ(StepOffsets(laplacian, seen, {1e-3, 1}, &offsets), Status::kNonFiniteInput);
  EXPECT_EQ(offsets, before);
}

TEST(OffsetSigma, IsThatOfTheDenseInverseAndLeavesWhatNobodySawOpen) {
  const Eigen::Index count = SmallBody().vertices.cols();
  const auto laplacian = UmbrellaLaplacian(SmallBody().vertices, SmallBody().faces);
  std::vector<OffsetObservation> seen;
  for (int v = 0; v < count / 3; v += 2) seen.push_back({v, 200, 0, 0.5});
  const Eigen::VectorXd sigma = OffsetSigma(laplacian, {seen}, {1e-3, 0.1});
  Eigen::MatrixXd h = Eigen::MatrixXd(laplacian.transpose() * laplacian) * 1e6;
  h.diagonal().array() += 100;
  for (const OffsetObservation& one : seen) h(one.vertex, one.vertex) += std::pow(0.5 * 200, 2);
  const Eigen::VectorXd dense = h.inverse().diagonal().cwiseSqrt();
  ASSERT_EQ(sigma.size(), count);
  EXPECT_LT((sigma - dense).cwiseAbs().maxCoeff(), 1e-8);
  EXPECT_LT(sigma[0], 0.01) << "the noise of one observation, at most";
  EXPECT_GT(sigma.maxCoeff(), 0.01);
  EXPECT_LE(sigma.maxCoeff(), 0.1) << "what the template leaves";
  seen.push_back({0, std::nan(""), 0, 1});
  EXPECT_EQ(OffsetSigma(laplacian, {seen}, {1e-3, 0.1}).size(), 0);
}

/// Far from all observations a vertex is as unknown as the prior says. Both terms as they stand leave a tenth of it.
TEST(OffsetSigma, OfAWideSmoothnessIsThatOfThePriorWhereNobodySaw) {
  constexpr int kSide = 60;
  Eigen::Matrix3Xf vertices(3, kSide * kSide);
  Eigen::Matrix3Xi faces(3, 2 * (kSide - 1) * (kSide - 1));
  Eigen::Index face = 0;
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x) {
      const int v = y * kSide + x;
      vertices.col(v) << 0.01f * static_cast<float>(x), 0.01f * static_cast<float>(y), 0;
      if (x + 1 == kSide || y + 1 == kSide) continue;
      faces.col(face++) << v, v + 1, v + kSide;
      faces.col(face++) << v + 1, v + kSide + 1, v + kSide;
    }
  }
  const auto laplacian = UmbrellaLaplacian(vertices, faces);
  const int middle = kSide / 2 * kSide + kSide / 2;
  const std::vector<std::vector<OffsetObservation>> seen = {{{0, 200, 0, 0.5}}};
  for (const double laplacian_sigma_m : {1e-3, 3e-3}) {
    const double wide = OffsetSigma(laplacian, seen, WideSmoothness(laplacian_sigma_m, 0.03))[middle];
    const double narrow = OffsetSigma(laplacian, seen, {laplacian_sigma_m, 0.03})[middle];
    std::printf("%.0f mm: %.1f mm, as they stand %.1f mm\n", 1e3 * laplacian_sigma_m, 1e3 * wide, 1e3 * narrow);
    EXPECT_NEAR(wide, 0.03, 0.009);
    EXPECT_NEAR(narrow, std::sqrt(laplacian_sigma_m * 0.03 / 2), 0.2 * narrow);
  }
}

/// All that one time step sees lies off by the same amount: a thousand such vertices say no more than one.
TEST(OffsetSigma, CoversErrorsThatATimeStepHasInCommon) {
  constexpr int kSteps = 20, kTrials = 60;
  const auto laplacian = UmbrellaLaplacian(SmallBody().vertices, SmallBody().faces);
  const Eigen::Index count = SmallBody().vertices.cols();
  Rng rng(5);
  double error = 0, variance = 0;
  for (int trial = 0; trial < kTrials; ++trial) {
    std::vector<double> off(kSteps);
    for (double& step : off) step = 2 * rng.Normal();
    const auto observe = [&](const Eigen::VectorXd& offsets) {
      std::vector<std::vector<OffsetObservation>> seen(kSteps);
      for (int i = 0; i < kSteps; ++i) {
        for (int v = 0; v < count; ++v) seen[i].push_back({v, 200, off[i] - 200 * offsets[v], 1});
      }
      return seen;
    };
    Eigen::VectorXd offsets = Eigen::VectorXd::Zero(count);
    std::vector<OffsetObservation> all;
    for (const auto& step : observe(offsets)) all.insert(all.end(), step.begin(), step.end());
    ASSERT_EQ(StepOffsets(laplacian, all, {1e-4, 0.1}, &offsets), Status::kOk);
    error += offsets.squaredNorm();
    variance += OffsetSigma(laplacian, observe(offsets), {1e-4, 0.1}).squaredNorm();
  }
  EXPECT_NEAR(std::sqrt(error / variance), 1, 0.3) << "the truth is 0; 60 trials scatter by a tenth";
}

TEST(SurfaceImage, ShowsTheFrontFromTheFront) {
  const BodyTemplate& body = SmallBody();
  Eigen::VectorXd values(body.vertices.cols());
  for (Eigen::Index v = 0; v < values.size(); ++v) values[v] = body.vertices(1, v) < 0 ? 1 : -1;  // the person faces -y
  const Image page = SurfaceImage(body, values, {-1, 1}, 160);
  ASSERT_EQ(page.width, 300);
  int64_t red_left = 0, blue_left = 0, red_right = 0, blue_right = 0;
  for (int y = 0; y < 150; ++y) {
    for (int x = 0; x < 300; ++x) {
      const uint8_t* p = page.Pixel(x, y);
      (x < 150 ? red_left : red_right) += p[0] > p[2] + 40;
      (x < 150 ? blue_left : blue_right) += p[2] > p[0] + 40;
    }
  }
  EXPECT_GT(red_left, 1000);
  EXPECT_GT(blue_right, 1000);
  EXPECT_GT(red_left, 8 * blue_left);
  EXPECT_GT(blue_right, 8 * red_right);
  EXPECT_EQ(page.Pixel(0, 0)[0], 255) << "on white";
  EXPECT_GT(page.Pixel(0, 159)[2], page.Pixel(0, 159)[0]) << "the scale begins blue";
  const Image positive = SurfaceImage(body, values.cwiseMax(0), {0, 1}, 160);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(positive.Pixel(0, 159)[c], 237, 1) << "this one begins grey, for 0";
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(positive.Pixel(299, 159)[c], page.Pixel(299, 159)[c], 1) << "and ends alike";
}

TEST(TexelMap, ValuesOfVerticesBetweenTheCornersOfAFace) {
  const BodyTemplate& body = SmallBody();
  const TexelMap map = MapTexels(body, 32);
  Eigen::Matrix3Xf values(3, body.vertices.cols());
  values << 2 * body.vertices.row(2), body.vertices.row(0) - body.vertices.row(1),
      Eigen::RowVectorXf::Constant(values.cols(), 7);
  size_t shown = 0;
  for (size_t t = 0; t < map.face.size(); ++t) {
    if (map.face[t] < 0) continue;
    ++shown;
    const Eigen::Vector3f x = AtTexel(body, map, t, body.vertices), linear(2 * x[2], x[0] - x[1], 7);
    EXPECT_LT((AtTexel(body, map, t, values) - linear).norm(), 1e-5f) << t;
  }
  EXPECT_GT(shown, map.face.size() / 2);
}

TEST(SmoothBrightness, IsNotDarkenedByTheBackgroundAndHasARightGradient) {
  Image grey(60, 60, 1), mask = Disc(60, {30, 30}, 18);
  for (int y = 0; y < 60; ++y) {
    for (int x = 0; x < 60; ++x) *grey.Pixel(x, y) = static_cast<uint8_t>(100 + x + y / 2);
  }
  const SmoothBrightness smooth(grey, mask, 2);
  double value = 0;
  Eigen::RowVector2d gradient;
  ASSERT_TRUE(smooth.At({30, 30}, &value, &gradient));
  EXPECT_NEAR(value, 145.0 / 255, 0.003);
  EXPECT_NEAR(gradient[0], 1.0 / 255, 3e-4);
  EXPECT_NEAR(gradient[1], 0.5 / 255, 3e-4);
  ASSERT_TRUE(smooth.At({45, 30}, &value, &gradient));
  EXPECT_NEAR(value, 160.0 / 255, 0.01) << "near the outline";
  EXPECT_FALSE(smooth.At({55, 30}, &value, &gradient)) << "outside the mask";
  EXPECT_FALSE(smooth.At({std::nan(""), 30}, &value, &gradient));
}

TEST(LearnedRotationPrior, LearnsWhatFollowsTheJointsAndNothingElse) {
  Rng rng(8);
  std::vector<ArticulatedPose> by_joints, seen;
  const int hand = 8, forearm = 7, head = 4;
  for (int i = 0; i < 80; ++i) {
    ArticulatedPose pose = RandomPose(SmallBody(), 0.3, rng);
    by_joints.push_back(pose);
    const Vector3d bend = geometry::RotationLog(pose.local_rotations[forearm]);
    pose.local_rotations[hand] = pose.local_rotations[hand] * geometry::RotationExp(0.5 * bend + Vector3d(0.2, 0, 0));
    pose.local_rotations[head] =
        pose.local_rotations[head] * geometry::RotationExp(0.1 * Vector3d(rng.Normal(), rng.Normal(), rng.Normal()));
    seen.push_back(pose);
  }
  const LearnedRotationPrior priors = LearnedRotationPrior::Learn(SmallBody(), by_joints, seen);
  ASSERT_EQ(priors.bones.size(), SmallBody().bone_names.size());
  EXPECT_LT(priors.bones[hand].sigma_rad, 0.05);
  EXPECT_EQ(priors.bones[head].weights.size(), 0) << "noise is no habit";
  const RotationPrior expected = priors.Expect(SmallBody(), by_joints[3]);
  EXPECT_LT(geometry::RotationAngle(expected.mean[hand], seen[3].local_rotations[hand]), 0.05);
  EXPECT_TRUE(
      LearnedRotationPrior::Learn(SmallBody(), {by_joints.begin(), by_joints.begin() + 5}, {seen.begin(), seen.begin() + 5})
          .bones.empty());
}

}  // namespace
}  // namespace mvstudio::body
