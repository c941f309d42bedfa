#include "avatar/body/fit/fit_body.h"

#include <cmath>

#include "avatar/body/fit/pose_by_images.h"
#include "avatar/body/surface_nets.h"
#include "avatar/body/texture/bake.h"
#include "avatar/body/texture/texel_map.h"
#include "core/random.h"
#include "core/statistics.h"
#include "tests/body/fit_studio.h"
#include "tests/support/test.h"

namespace mvstudio::body {
namespace {

using Eigen::Vector3d;

constexpr int kSizePx = Studio::kSizePx;

double MeanSurfaceError(const Studio& studio, const BodyFit& fit) {
  double sum = 0;
  int count = 0;
  for (const auto& [frame, pose] : fit.person.seen) {
    const Eigen::Matrix3Xf truth = SkinVertices(studio.person, ToBodyPose(studio.person, studio.poses[frame]));
    const Eigen::Matrix3Xf found = SkinVertices(fit.person.body, ToBodyPose(fit.person.body, pose));
    // To the nearest vertex of the truth: a fit says nothing of where on the surface a vertex lies.
    for (Eigen::Index v = 0; v < found.cols(); v += 23)
      sum += std::sqrt((truth.colwise() - found.col(v)).colwise().squaredNorm().minCoeff()), ++count;
  }
  return sum / count;
}

/// What a stage said that it would do, and did.
struct Work : public ProgressSink {
  void Begin(const std::string& /*stage*/, int64_t all) override { total = all, done = 0; }
  void Advance(int64_t work, const std::string& /*note*/) override { done += work; }
  int64_t total = 0, done = -1;
};

TEST(FitBody, FindsTheSurfaceOfAnotherPerson) {
  const Studio studio(20);
  const BodyFit fit = FitBody(studio.rest, studio.steps, {}, {});
  ASSERT_EQ(fit.status, Status::kOk);
  EXPECT_GT(fit.iou, 0.94) << "by joints alone";
  EXPECT_GT(fit.iou, fit.iou_before + 0.02);
  EXPECT_LT(MeanSurfaceError(studio, fit), 0.012) << "vertices lie 20 mm apart";
  EXPECT_FALSE(fit.stages.front().kept);
  EXPECT_TRUE(fit.rejected.empty());
  for (const CameraFit& camera : fit.cameras) EXPECT_LT(camera.shift_px.norm(), 0.5) << camera.name;
}

TEST(FitBody, WrongSilhouettesAreNamedAndDoNotDeform) {
  Studio studio(20);
  const BodyFit right = FitBody(studio.rest, studio.steps, {}, {});
  for (const int step : {3, 8, 13})
    studio.steps[step].views[1].outline = std::make_shared<MaskOutline>(Image(kSizePx, kSizePx, 1, 255));
  studio.steps[6].views[2].outline = std::make_shared<MaskOutline>(Image(kSizePx, kSizePx, 1));
  const BodyFit fit = FitBody(studio.rest, studio.steps, {}, {});
  ASSERT_EQ(fit.rejected.size(), 4u);
  for (const RejectedView& view : fit.rejected) EXPECT_EQ(view.camera, view.frame == 6 ? "cam2" : "cam1");
  EXPECT_LT((fit.person.body.vertices - right.person.body.vertices).colwise().norm().mean(), 0.003);
}

TEST(FitBody, AShiftedCameraIsSeen) {
  Studio studio(15, 6);
  for (FitStep& step : studio.steps) step.views[4].camera.camera.params[2] += 3;
  const BodyFit fit = FitBody(studio.rest, studio.steps, {}, {});
  for (const CameraFit& camera : fit.cameras) {
    if (camera.name == "cam4") {
      EXPECT_NEAR(camera.shift_px[0], -3, 1);
      EXPECT_EQ(camera.rejected, 15) << "3 px of a person of 45 px: it must not take part";
      EXPECT_GT(camera.shift_px.norm(), 4 * camera.shift_sigma_px);
    } else {
      EXPECT_LT(camera.shift_px.norm(), 1) << camera.name;
    }
  }
}

TEST(FitBody, BrightnessNeedsASecondCamera) {
  for (const int cameras : {1, 2}) {
    Studio studio(12, cameras);
    for (FitStep& step : studio.steps) {
      for (FitView& view : step.views) view.grey = std::make_shared<Image>(view.outline->mask());
    }
    Work work;
    const BodyFit fit = FitBody(studio.rest, studio.steps, {}, {&work});
    EXPECT_EQ(fit.stages.back().name == "poses by brightness", cameras == 2) << cameras;
    EXPECT_EQ(work.done, work.total) << cameras;
  }
}

TEST(FitBody, FewStepsAreNotJudgedAndNoneIsAStatus) {
  const Studio three(3);
  Work work;
  const BodyFit fit = FitBody(three.rest, three.steps, {}, {&work});
  EXPECT_EQ(work.done, work.total) << "all of it though the bones alone are kept";
  EXPECT_EQ(fit.status, Status::kOk);
  EXPECT_TRUE(std::isnan(fit.iou));
  EXPECT_TRUE(fit.person.body.vertices.allFinite());
  EXPECT_TRUE(fit.stages.front().kept) << "nothing was held out";
  EXPECT_EQ(fit.offsets.cwiseAbs().maxCoeff(), 0);
  std::vector<FitStep> none = three.steps;
  for (FitStep& step : none) step.joints.valid.fill(false);
  EXPECT_EQ(FitBody(three.rest, none, {}, {}).status, Status::kTooFewViews);
  EXPECT_EQ(FitBody(three.rest, {}, {}, {}).status, Status::kTooFewViews);
}

/// Mean distance of a pose's vertices from those of the truth.
double PoseError(const Studio& studio, const PersonBody& person, const std::map<int, ArticulatedPose>& poses) {
  double sum = 0;
  for (const auto& [frame, pose] : poses) {
    const Eigen::Matrix3Xf truth = SkinVertices(studio.person, ToBodyPose(studio.person, studio.poses[frame]));
    sum += (SkinVertices(person.body, ToBodyPose(person.body, pose)) - truth).colwise().norm().mean();
  }
  return sum / static_cast<double>(poses.size());
}

class PosesOfOtherSteps : public ::testing::Test {
 protected:
  PosesOfOtherSteps() : studio_(26) {
    others_.assign(studio_.steps.begin() + 20, studio_.steps.end());
    const std::vector<FitStep> fitted(studio_.steps.begin(), studio_.steps.begin() + 20);
    person_ = FitBody(studio_.rest, fitted, {}, {}).person;
  }
  std::map<int, ArticulatedPose> ByJoints() const {
    std::map<int, ArticulatedPose> poses;
    for (const FitStep& step : others_) poses[step.frame] = *PoseByJoints(person_, step.joints.x_in_world, step.joints.valid);
    return poses;
  }
  ArticulatedPose ByJointsAt(int frame) const {
    const FitStep& step = studio_.steps[frame];
    return *PoseByJoints(person_, step.joints.x_in_world, step.joints.valid);
  }
  Studio studio_;
  std::vector<FitStep> others_;
  PersonBody person_;
};

TEST_F(PosesOfOtherSteps, ImagesShowWhatJointsDoNot) {
  const StepPoses posed = PoseByImages(person_, nullptr, others_, {});
  ASSERT_EQ(posed.poses.size(), 6u);
  EXPECT_GT(Mean(posed.iou), Mean(posed.iou_before) + 0.005);
  EXPECT_LT(PoseError(studio_, person_, posed.poses), 0.9 * PoseError(studio_, person_, ByJoints()));
  EXPECT_TRUE(posed.rejected.empty());
}

TEST_F(PosesOfOtherSteps, AWrongSilhouetteIsNamedAndDoesNotTurnTheBody) {
  const StepPoses right = PoseByImages(person_, nullptr, others_, {});
  others_[2].views[1].outline = others_[4].views[3].outline;
  const StepPoses posed = PoseByImages(person_, nullptr, others_, {});
  ASSERT_EQ(posed.rejected.size(), 1u);
  EXPECT_EQ(posed.rejected[0].frame, 22);
  EXPECT_EQ(posed.rejected[0].camera, "cam1");
  EXPECT_LT(PoseError(studio_, person_, posed.poses), PoseError(studio_, person_, right.poses) + 0.002);
}

TEST_F(PosesOfOtherSteps, WithoutSilhouettesJointsPose) {
  for (FitStep& step : others_) step.views.clear();
  others_[0].joints.valid.fill(false);
  const StepPoses posed = PoseByImages(person_, nullptr, others_, {});
  EXPECT_EQ(posed.poses.size(), 5u) << "no trunk in the first";
  EXPECT_TRUE(posed.iou.empty());
  for (const auto& [frame, pose] : posed.poses) EXPECT_EQ(pose.shift, ByJointsAt(frame).shift);
}

/// Views from all around; camera 3 shows everything `gain` times as bright.
TextureBaker BakeFrom(const BodyTemplate& body, const Textures& truth, double gain) {
  TextureBaker baker(body, 32);
  for (int c = 0; c < 12; ++c) {
    geometry::RigCamera camera = CameraAt(2 * M_PI * c / 12, c % 3 == 0 ? 2.4 : 1.0);
    camera.camera.width_px = camera.camera.height_px = 500;
    camera.camera.params << 600, 600, 249.5, 249.5;
    RenderedBody rendered = RenderBody(body, truth, body.vertices, camera);
    for (uint8_t& value : rendered.image.pixels) value = static_cast<uint8_t>(std::lround(value * (c == 3 ? gain : 1)));
    baker.Add({camera, rendered.image, rendered.cover, body.vertices, c}, {});
  }
  return baker;
}

/// Mean difference in grey levels of the body in two coats.
double ColourError(const BodyTemplate& body, const Textures& a, const Textures& b) {
  const geometry::RigCamera camera = CameraAt(0.3, 1.4);
  const Image one = RenderBody(body, a, body.vertices, camera).image, other = RenderBody(body, b, body.vertices, camera).image;
  double sum = 0;
  int count = 0;
  for (size_t i = 0; i < one.pixels.size(); ++i) {
    if (one.pixels[i] > 0) sum += std::abs(one.pixels[i] - other.pixels[i]), ++count;
  }
  return sum / count;
}

TEST(TextureBaker, BringsTheColoursBack) {
  const BodyTemplate body = MakeMannequin(1.75, 0.6);
  const Textures truth = MannequinTextures(32, 5);
  const TextureBaker baker = BakeFrom(body, truth, 1);
  EXPECT_GT(baker.SeenShare(), 0.7);
  EXPECT_LT(ColourError(body, truth, baker.Finish(baker.Gains())), 12);
  for (const Eigen::Array3d& gain : baker.Gains()) EXPECT_LT((gain - 1).abs().maxCoeff(), 0.02);
}

TEST(TextureBaker, ADarkCameraIsMeasuredAndDoesNotStain) {
  const BodyTemplate body = MakeMannequin(1.75, 0.6);
  const Textures truth = MannequinTextures(32, 5);
  const TextureBaker right = BakeFrom(body, truth, 1), baker = BakeFrom(body, truth, 0.7);
  const std::vector<Eigen::Array3d> gains = baker.Gains();
  const double others = gains[0][1];
  EXPECT_LT((gains[3] / others - 0.7).abs().maxCoeff(), 0.02);
  Textures found = baker.Finish(gains);
  for (Image& texture : found) {
    for (uint8_t& value : texture.pixels) value = static_cast<uint8_t>(std::lround(std::min(255.0, value * others)));
  }
  EXPECT_LT(ColourError(body, right.Finish(right.Gains()), found), 2)
      << "beyond the brightness of all, which nothing determines";
}

TEST(FillTexels, FarTexelsTakeTheColourOfTheirRowAndNearOnesThatOfTheirNeighbours) {
  constexpr int kSize = 32;
  constexpr int kFront = 0, kBack = 1, kHand = 2;  // the trunk's two sides are alike
  Textures textures;
  textures.fill(Image(kSize, kSize, 3, 7));
  std::vector<uint8_t> known(static_cast<size_t>(kNumParts) * kSize * kSize, 0);
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < 4; ++x) {
      known[static_cast<size_t>(y) * kSize + x] = 1;
      for (int c = 0; c < 3; ++c) textures[kFront].Pixel(x, y)[c] = y < kSize / 2 ? 200 : 40;  // a shirt over trousers
    }
  }
  FillTexels(known, &textures);
  for (const int x : {5, 20, 31}) {
    EXPECT_EQ(*textures[kFront].Pixel(x, 3), 200) << x;
    EXPECT_EQ(*textures[kFront].Pixel(x, 28), 40) << x;
    EXPECT_EQ(*textures[kBack].Pixel(x, 3), 200) << x;
    EXPECT_EQ(*textures[kBack].Pixel(x, 28), 40) << x;
  }
  EXPECT_EQ(*textures[kHand].Pixel(3, 3), 7) << "nothing is known of charts like it";
}

}  // namespace
}  // namespace mvstudio::body
