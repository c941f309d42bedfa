#include <ATen/ATen.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "avatar/body/body_template.h"
#include "avatar/maps/camera_tensor.h"
#include "avatar/run/lift/pose_variation.h"
#include "avatar/run/pretrain/label_score.h"
#include "avatar/run/pretrain/motion_clips.h"
#include "avatar/run/pretrain/pretrain_samples.h"
#include "core/error.h"
#include "tests/avatar/panoptic_fixture.h"
#include "tests/support/message_of.h"
#include "tests/support/test.h"

/// Samples that a generic network learns parts and coordinates from.
namespace mvstudio::avatar {
namespace {

using dataset::Coco19Pose;

Coco19Pose Swing(const body::BodyTemplate& body, double angle) {
  Coco19Pose pose;
  pose.x_in_world = body::PosedCoco19(body, SwingPose(body, angle));
  pose.valid.fill(true), pose.confidence.fill(1);
  return pose;
}

PretrainSources Sources(int poses) {
  PretrainSources sources;
  sources.templates.push_back(body::MakeMannequin(1.75, 0.4));
  MotionClip clip;
  clip.source = "swing";
  for (int i = 0; i < poses; ++i) {
    clip.frames.push_back(i);
    clip.poses.push_back(Swing(sources.templates[0], 0.1 * i));
  }
  HoldOutBlocks(&clip);
  sources.clips.push_back(clip);
  return sources;
}

PretrainSampleOptions Small() {
  PretrainSampleOptions options;
  options.size_px = 48;
  return options;
}

RunContext Threads(int count) { return {nullptr, count, 3}; }

TEST(MotionClips, EveryFifthBlockIsHeldOut) {
  MotionClip clip;
  const auto held_out = [&](size_t count) {
    clip.poses.resize(count);
    HoldOutBlocks(&clip);
    EXPECT_EQ(clip.learned.size() + clip.held_out.size(), count);
    return clip.held_out;
  };
  EXPECT_THAT(held_out(4), ElementsAre());
  EXPECT_THAT(held_out(5), ElementsAre(2));
  EXPECT_THAT(held_out(10), ElementsAre(4, 5));
  EXPECT_EQ(held_out(400).size(), 80u);
  EXPECT_EQ(clip.held_out.front(), 32);
  EXPECT_EQ(clip.held_out[16], 112) << "the next block, five later";
}

TEST(PoseVariation, LengthsAreOfHumansAndTheSameLeftAndRight) {
  const Coco19Pose pose = Swing(body::MakeMannequin(1.75, 0.4), 0.7);
  Rng rng(5);
  const auto length = [](const Coco19Pose& p, int a, int b) { return (p.x_in_world.col(a) - p.x_in_world.col(b)).norm(); };
  std::set<double> arms;
  for (int k = 0; k < 50; ++k) {
    PoseVariation variation;
    DrawLengths(0.05, rng, &variation);
    DrawTurns(0.2, rng, &variation);
    const Coco19Pose varied = Varied(pose, variation);
    for (const auto& [left, right, from_left, from_right] :
         {std::array{4, 10, 3, 9}, {5, 11, 4, 10}, {7, 13, 6, 12}, {8, 14, 7, 13}, {3, 9, 0, 0}, {6, 12, 2, 2}}) {
      const double factor = length(varied, left, from_left) / length(pose, left, from_left);
      EXPECT_NEAR(factor, length(varied, right, from_right) / length(pose, right, from_right), 1e-9);
      EXPECT_LE(std::abs(std::log(factor)), 4 * 0.05 + 1e-9);
    }
    arms.insert(length(varied, 4, 3));
    EXPECT_EQ(varied.x_in_world.col(2), pose.x_in_world.col(2));
  }
  EXPECT_EQ(arms.size(), 50u);
}

TEST(PoseVariation, TheMirrorImageOfTheMirrorImageIsThePose) {
  const Coco19Pose pose = Swing(body::MakeMannequin(1.75, 0.4), 0.7), mirrored = Mirrored(pose);
  EXPECT_EQ(Mirrored(mirrored).x_in_world, pose.x_in_world);
  EXPECT_EQ(mirrored.x_in_world(0, 4), -pose.x_in_world(0, 10)) << "the left elbow is where the right one was";
}

TEST(PretrainSamples, AreAFunctionOfSeedAndSet) {
  const PretrainSources sources = Sources(20);
  const PretrainSamples one = DrawSamples(sources, Small(), PoseShare::kLearned, 4, 12, Threads(1));
  const PretrainSamples two = DrawSamples(sources, Small(), PoseShare::kLearned, 4, 12, Threads(2));
  Validate(one.pack);
  for (const auto& [a, b] : {std::pair{one.pack.part, two.pack.part},
                             {one.pack.uv, two.pack.uv},
                             {one.pack.joints_in_cam, two.pack.joints_in_cam},
                             {one.pack.intrinsics, two.pack.intrinsics}})
    EXPECT_TRUE(at::equal(a, b));
  const PretrainSamples next = DrawSamples(sources, Small(), PoseShare::kLearned, 5, 12, Threads(1));
  EXPECT_FALSE(at::equal(one.pack.joints_in_cam, next.pack.joints_in_cam));
  const PretrainSamples other = DrawSamples(sources, Small(), PoseShare::kLearned, 4, 12, {nullptr, 1, 4});
  EXPECT_FALSE(at::equal(one.pack.joints_in_cam, other.pack.joints_in_cam));
}

/// The angle between trunk and left upper arm tells the poses apart: nothing else varies here.
TEST(PretrainSamples, HeldOutPosesAreNeverLearnedFrom) {
  PretrainSources sources = Sources(20);
  PretrainSampleOptions options = Small();
  options.pose_jitter_deg = options.limb_spread = options.girth_spread = 0;
  const auto angles = [&](PoseShare share) {
    const at::Tensor x = DrawSamples(sources, options, share, 0, 40, Threads(2)).pack.joints_in_cam;
    const auto between = [&](int64_t a, int64_t b) { return x.select(1, a) - x.select(1, b); };
    const at::Tensor arm = (between(4, 3) - between(10, 9)).norm(2, 1);  // of a mirrored pose the same
    std::set<int> rounded;
    for (int64_t i = 0; i < arm.size(0); ++i) rounded.insert(static_cast<int>(std::lround(1e4 * arm[i].item<double>())));
    return rounded;
  };
  const std::set<int> learned = angles(PoseShare::kLearned), held_out = angles(PoseShare::kHeldOut);
  EXPECT_GT(learned.size(), 8u);
  EXPECT_EQ(held_out.size(), 4u);
  for (const int angle : held_out) EXPECT_EQ(learned.count(angle), 0u) << angle;
}

/// The label at a joint's pixel is a place of that side of the body, in mirrored poses too.
TEST(PretrainSamples, LeftIsLeftAndRightIsRight) {
  const PretrainSources sources = Sources(20);
  const SurfaceMap surface(sources.templates[0]);
  const AvatarPack pack = DrawSamples(sources, Small(), PoseShare::kLearned, 1, 60, Threads(2)).pack;
  const at::Tensor px = ProjectPinhole(pack.intrinsics, pack.joints_in_cam);
  int right = 0, wrong = 0;
  for (const auto& [joint, side] : {std::pair{4, 1}, {5, 1}, {7, 1}, {8, 1}, {10, -1}, {11, -1}, {13, -1}, {14, -1}}) {
    for (int64_t i = 0; i < pack.size(); ++i) {
      const auto x = static_cast<int64_t>(std::lround(px[i][joint][0].item<double>()));
      const auto y = static_cast<int64_t>(std::lround(px[i][joint][1].item<double>()));
      if (x < 0 || y < 0 || x >= 48 || y >= 48) continue;
      const int part = pack.part[i][y][x].item<int>();
      if (part == 0) continue;
      const double rest_x = surface.At(part, pack.uv[i][0][y][x].item<double>(), pack.uv[i][1][y][x].item<double>()).x();
      ++(rest_x * side > 0.02 ? right : wrong);
    }
  }
  EXPECT_GT(right, 300);
  EXPECT_LT(wrong, 0.2 * right) << "those that another limb hides";
}

TEST(PretrainSamples, ShapesVaryWithinTheRange) {
  const body::BodyTemplate body = body::MakeMannequin(1.75, 0.4);
  Rng rng(1);
  double least = 1e9, most = 0;
  for (int k = 0; k < 20; ++k) {
    const body::BodyTemplate shaped = RandomShape(body, 0.12, rng);
    const double depth = shaped.vertices.row(1).maxCoeff() - shaped.vertices.row(1).minCoeff();
    least = std::min(least, depth), most = std::max(most, depth);
  }
  EXPECT_GT(most, 1.1 * least);
  EXPECT_EQ(RandomShape(body, 0, rng).vertices.cols(), body.vertices.cols());
  EXPECT_LT((RandomShape(body, 0, rng).vertices - body.vertices).cwiseAbs().maxCoeff(), 1e-6);
}

TEST(PretrainSamples, OptionsBeyondTheirRangeAreNamed) {
  PretrainSampleOptions options;
  options.min_elevation_deg = 60;
  EXPECT_THAT(MessageOf<UsageError>([&] { Validate(options); }), HasSubstr("'min-elevation-deg'"));
  options = {};
  options.max_extent = 0.3;
  EXPECT_THAT(MessageOf<UsageError>([&] { Validate(options); }), HasSubstr("'min-extent'"));
  EXPECT_NO_THROW(Validate(PretrainSampleOptions()));
}

TEST(SurfaceMap, KnowsWhereTheCornersOfTheFacesLie) {
  const body::BodyTemplate body = body::MakeMannequin(1.75, 0.5);
  const SurfaceMap surface(body);
  std::vector<float> distances;
  for (Eigen::Index f = 0; f < body.faces.cols(); f += 7) {
    const Eigen::Vector2f uv = (body.face_uv.col(3 * f) + body.face_uv.col(3 * f + 1) + body.face_uv.col(3 * f + 2)) / 3;
    const Eigen::Vector3f x =
        (body.vertices.col(body.faces(0, f)) + body.vertices.col(body.faces(1, f)) + body.vertices.col(body.faces(2, f))) / 3;
    distances.push_back((surface.At(body.face_part[static_cast<size_t>(f)], uv[0], uv[1]) - x).norm());
  }
  std::sort(distances.begin(), distances.end());
  EXPECT_LT(distances[distances.size() / 2], 0.006);
  EXPECT_LT(distances[distances.size() * 99 / 100], 0.03);
}

TEST(LabelScore, ComparesWithTheTruth) {
  const PretrainSources sources = Sources(10);
  const PretrainSamples samples = DrawSamples(sources, Small(), PoseShare::kLearned, 0, 6, Threads(1));
  const std::vector<SurfaceMap> surfaces = {SurfaceMap(sources.templates[0])};
  const LabelScore same = CompareLabels(samples.pack.part, samples.pack.uv, samples, surfaces);
  EXPECT_EQ(same.samples, 6);
  EXPECT_EQ(same.part_accuracy, 1);
  EXPECT_EQ(same.mask_iou, 1);
  EXPECT_EQ(same.uv_error, 0);
  EXPECT_EQ(same.surface_mm, 0);
  at::Tensor shifted = samples.pack.uv.clone();
  shifted.select(1, 0).add_(0.1);
  const LabelScore beside = CompareLabels(samples.pack.part, shifted, samples, surfaces);
  EXPECT_NEAR(beside.uv_error, 0.05, 1e-4);
  EXPECT_GT(beside.surface_mm, 5);
  EXPECT_LT(beside.surface_mm, 100);
  at::Tensor half = samples.pack.part.clone();
  half.slice(1, 24, 48).zero_();
  const LabelScore cut = CompareLabels(half, samples.pack.uv, samples, surfaces);
  const double kept = (half > 0).sum().item<double>() / (samples.pack.part > 0).sum().item<double>();
  EXPECT_NEAR(cut.part_accuracy, kept, 1e-9);
  EXPECT_LT(cut.mask_iou, 0.8);
  const LabelScore none = CompareLabels(at::zeros_like(half), samples.pack.uv, samples, surfaces);
  EXPECT_EQ(none.part_accuracy, 0);
  EXPECT_TRUE(std::isnan(none.uv_error) && std::isnan(none.surface_mm));
}

}  // namespace
}  // namespace mvstudio::avatar
