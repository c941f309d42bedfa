#include <ATen/ATen.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "avatar/io/baselines.h"
#include "avatar/io/evaluate.h"
#include "avatar/io/strips.h"
#include "avatar/model.h"
#include "core/error.h"
#include "tests/avatar/panoptic_fixture.h"
#include "tests/support/message_of.h"

namespace mvstudio::avatar {
namespace {

using mvstudio::testing::MessageOf;
using ::testing::AllOf;
using ::testing::HasSubstr;

/// A dataset of 5 cameras and 9 frames and an untrained avatar for it.
class EvaluateRun : public ::testing::Test {
 protected:
  EvaluateRun() : folder_("evaluate") {
    WriteMannequinDataset(dataset(), 5, 9, 128);
    data_ = dataset::OpenPanopticDataset(dataset());
    config_.dataset = dataset();
    config_.pack.size_px = 64;
    config_.pack.person = 0;
    config_.half_extent_m = config_.pack.half_extent_m = 1.2;
    config_.split = SplitDataset(data_, 0, {"00_01", "00_03"}, {6, 7, 8});
    MakeFolder(run());
    WriteRunConfig(config_, run() + "/config.json");
    ModelOptions options;
    options.width = 4, options.downs = 2, options.encoder_blocks = options.decoder_blocks = 1, options.texture_px = 8;
    WriteTensorFile(ModelToTensors(MakeModel(options, 64, {-0.5, 0.5}, 1)), run() + "/checkpoint.safetensors");
  }
  std::string dataset() const { return folder_.path() + "/dataset"; }
  std::string run() const { return folder_.path() + "/avatar"; }

  TemporaryFolder folder_;
  dataset::PanopticDataset data_;
  RunConfig config_;
};

TEST_F(EvaluateRun, ScoresHeldOutCamerasInHeldOutFramesBesideTheBaselines) {
  EvaluateOptions options;
  options.pictures = 2, options.other_pictures = 4, options.features = "gabor";
  double now = 0;
  const Evaluation e = Evaluate(run(), options, {}, [&] { return now += 3; });
  EXPECT_EQ(e.holdout_kind, "held-out cameras in held-out frames");
  EXPECT_EQ(e.holdout.mean.n, 6);
  EXPECT_EQ(e.mean_image.mean.n, 6);
  EXPECT_DOUBLE_EQ(e.seconds_per_picture, 0.5);
  ASSERT_EQ(e.per_camera.size(), 2u);
  EXPECT_EQ(e.per_camera[0].name, "00_01");
  EXPECT_NEAR(e.holdout.mean.bbox.ssim, (e.per_camera[0].mean.bbox.ssim + e.per_camera[1].mean.bbox.ssim) / 2, 1e-12);
  EXPECT_GT(e.nearest_pose.mean.bbox.ssim, e.holdout.mean.bbox.ssim) << "an untrained avatar loses";
  ASSERT_TRUE(e.holdout.fd.has_value());
  EXPECT_EQ(e.holdout.fd->n, 6);
  EXPECT_LE(e.ssim_interval.low, e.holdout.mean.bbox.ssim);
  EXPECT_GE(e.ssim_interval.high, e.holdout.mean.bbox.ssim);
  EXPECT_EQ(e.other_splits.size(), 3u);
  ASSERT_EQ(e.strips.size(), 4u);
  for (const PictureStrip& strip : e.strips) {
    const Image image = dataset::ReadImage(strip.path);
    EXPECT_EQ(image.height, 128);
    EXPECT_EQ(image.width, 4 * 128 + 3 * 4);
  }
  for (const char* key : {"\"holdout\"", "\"mask_iou\"", "\"fd\"", "gabor-stats-v1", "\"mean_image\"", "\"nearest_pose\"",
                          "\"per_camera\"", "\"convention\""}) {
    EXPECT_THAT(ToJsonText(e), HasSubstr(key));
  }
  EXPECT_THAT(ToTable(e), HasSubstr("baseline: nearest pose"));
}

TEST_F(EvaluateRun, BaselinesTakeTheNearestCameraAndPose) {
  const auto nearest = NearestTrainingCameras(data_, config_.split, 0);
  EXPECT_THAT(nearest.at("00_01"), ::testing::AnyOf("00_00", "00_02")) << "72 degrees to either side";
  EXPECT_EQ(nearest.at("00_00"), "00_00");
  PackOptions crop = config_.pack;
  crop.template_maps = false;
  crop.cameras = {"00_00"}, crop.frames = config_.split.train_frames;
  const AvatarPack train = BuildPack(data_, crop, {}).pack;
  // A training picture's own camera and pose are in the set: it must find itself.
  const Baselines baselines = MakeBaselines(data_, config_.split, config_.pack, train, {});
  EXPECT_TRUE(at::allclose(baselines.nearest_pose.images, OnBlack(train)));
  EXPECT_TRUE(at::allclose(baselines.mean_image.images[0], OnBlack(train).mean(0)));
}

TEST_F(EvaluateRun, MissingThingsAreNamed) {
  EXPECT_THAT(MessageOf<IoError>([&] { Evaluate(folder_.path() + "/none", {}, {}); }), HasSubstr("none"));
  RunConfig moved = config_;
  moved.dataset = "/nowhere/dataset";
  WriteRunConfig(moved, run() + "/config.json");
  EXPECT_THAT(MessageOf<IoError>([&] { Evaluate(run(), {}, {}); }),
              AllOf(HasSubstr("/nowhere/dataset"), HasSubstr("--dataset")));
  EvaluateOptions options;
  options.dataset = dataset(), options.other_pictures = 0, options.pictures = 0;
  EXPECT_NO_THROW(Evaluate(run(), options, {}));
  std::filesystem::remove(run() + "/checkpoint.safetensors");
  EXPECT_THAT(MessageOf<IoError>([&] { Evaluate(run(), options, {}); }),
              AllOf(HasSubstr("checkpoint.safetensors"), HasSubstr("resume")));
}

TEST_F(EvaluateRun, FramesOfAnotherDatasetAreRefused) {
  config_.split.holdout_frames = {6, 77};
  WriteRunConfig(config_, run() + "/config.json");
  EXPECT_THAT(MessageOf<UsageError>([&] { Evaluate(run(), {}, {}); }), HasSubstr("frame 77"));
  config_.split.holdout_frames.clear(), config_.split.holdout_cameras.clear();
  WriteRunConfig(config_, run() + "/config.json");
  EXPECT_THAT(MessageOf<UsageError>([&] { Evaluate(run(), {}, {}); }), HasSubstr("nothing was held out"));
}

TEST(PoseDistance, IsMeanSquaredAndRelativeToTheBodyCentre) {
  const at::Tensor a = at::rand({19, 3}), valid = at::ones({19}, at::kBool);
  EXPECT_NEAR(PoseDistance(a, valid, a + 2, valid), 0, 1e-10);
  at::Tensor b = a.clone();
  b[5][0] += 0.3;
  EXPECT_NEAR(PoseDistance(a, valid, b, valid), 0.09 / 19, 1e-7);
  at::Tensor hidden = valid.clone();
  hidden[5] = false;
  EXPECT_NEAR(PoseDistance(a, valid, b, hidden), 0, 1e-12);
  EXPECT_TRUE(std::isinf(PoseDistance(a, valid, b, at::zeros({19}, at::kBool))));
}

}  // namespace
}  // namespace mvstudio::avatar
