#include <ATen/ATen.h>

#include <filesystem>

#include "avatar/nets/model.h"
#include "avatar/nets/sequence.h"
#include "avatar/run/evaluate/baselines.h"
#include "avatar/run/evaluate/evaluate.h"
#include "avatar/run/evaluate/evaluate_groups.h"
#include "avatar/scores/image_scores.h"
#include "core/disk/paths.h"
#include "core/error.h"
#include "tests/avatar/panoptic_fixture.h"
#include "tests/avatar/script_nets.h"
#include "tests/support/message_of.h"
#include "tests/support/test.h"

namespace mvstudio::avatar {
namespace {

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

TEST_F(EvaluateRun, SaysWhatTheNetworkAddsToItsTemplate) {
  EvaluateOptions options;
  options.images = 0, options.renders = 0, options.other_images = 0, options.features = "gabor";
  config_.pack.template_input_px = 64;
  WriteRunConfig(config_, run() + "/config.json");
  ModelOptions model;
  model.width = 4, model.downs = 2, model.encoder_blocks = model.decoder_blocks = 1, model.texture_px = 8;
  model.prior = Prior::kTemplate;
  AvatarModel avatar = MakeModel(model, 64, {-0.5, 0.5}, 1);
  const auto save = [&] { WriteTensorFile(ModelToTensors(avatar), run() + "/checkpoint.safetensors"); };
  save();
  const Evaluation fresh = Evaluate(run(), options, {});
  ASSERT_TRUE(fresh.template_alone.has_value());
  EXPECT_EQ(fresh.template_alone->mean.bbox.ssim, fresh.holdout.mean.bbox.ssim) << "a fresh network adds nothing";
  EXPECT_GT(fresh.template_alone->mean.mask_iou, 0.9) << "the person is the template";
  for (at::Tensor& parameter : avatar.generator->parameters()) parameter.data().add_(0.3 * at::randn_like(parameter));
  save();
  const Evaluation other = Evaluate(run(), options, {});
  EXPECT_EQ(other.template_alone->mean.bbox.ssim, fresh.holdout.mean.bbox.ssim);
  EXPECT_NE(other.holdout.mean.bbox.ssim, fresh.holdout.mean.bbox.ssim);
  EXPECT_THAT(ToJsonText(other), HasSubstr("\"template_alone\""));
  options.score_size = 96;  // maps stay at the network's size
  EXPECT_GT(Evaluate(run(), options, {}).template_alone->mean.mask_iou, 0.9);
}

TEST_F(EvaluateRun, ScoresHeldOutCamerasInHeldOutFramesBesideTheBaselines) {
  EvaluateOptions options;
  options.images = 2, options.other_images = 4, options.features = "gabor";
  double now = 0;
  const Evaluation e = Evaluate(run(), options, {}, [&] { return now += 3; });
  EXPECT_EQ(e.holdout_kind, "held-out cameras in held-out frames");
  EXPECT_EQ(e.holdout.mean.n, 6);
  EXPECT_EQ(e.mean_image.mean.n, 6);
  EXPECT_FALSE(e.template_alone.has_value()) << "a network of bones has none";
  EXPECT_DOUBLE_EQ(e.seconds_per_image, 0.5);
  ASSERT_EQ(e.per_camera.size(), 2u);
  EXPECT_EQ(e.per_camera[0].name, "00_01");
  EXPECT_NEAR(e.holdout.mean.bbox.ssim, (e.per_camera[0].mean.bbox.ssim + e.per_camera[1].mean.bbox.ssim) / 2, 1e-12);
  EXPECT_GT(e.nearest_pose.mean.bbox.ssim, e.holdout.mean.bbox.ssim) << "an untrained avatar loses";
  ASSERT_TRUE(e.holdout.fd.has_value());
  EXPECT_EQ(e.holdout.fd->n, 6);
  for (const auto& [key, value] : std::map<std::string, double>{{"ssim", e.holdout.mean.bbox.ssim},
                                                                {"full.ssim", e.holdout.mean.full.ssim},
                                                                {"masked.psnr_db", e.holdout.mean.masked.psnr_db},
                                                                {"mask_iou", e.holdout.mean.mask_iou},
                                                                {"boundary_f", e.holdout.mean.boundary_f}}) {
    EXPECT_LE(e.intervals.at(key).low, value) << key;
    EXPECT_GE(e.intervals.at(key).high, value) << key;
  }
  ASSERT_EQ(e.per_motion.size(), 1u);
  EXPECT_EQ(e.per_motion[0].name, "6-8");
  EXPECT_DOUBLE_EQ(e.per_motion[0].mean.bbox.ssim, e.holdout.mean.bbox.ssim);
  EXPECT_DOUBLE_EQ(e.per_motion[0].flicker, e.flicker);
  EXPECT_EQ(e.other_splits.size(), 3u);
  ASSERT_EQ(e.strips.size(), 4u);
  for (const ImageStrip& strip : e.strips) {
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

TEST_F(EvaluateRun, AMethodWithMemoryHasItsPastInThinnedSplitsToo) {
  ModelOptions model;
  model.method = Method::kV2v;
  model.width = 4, model.downs = 2, model.encoder_blocks = model.decoder_blocks = 1;
  AvatarModel avatar = MakeModel(model, 64, {-0.5, 0.5}, 1);
  for (at::Tensor& parameter : avatar.generator->parameters()) parameter.data().mul_(3);  // flat before training
  WriteTensorFile(ModelToTensors(avatar), run() + "/checkpoint.safetensors");
  EvaluateOptions options;
  options.images = 0, options.other_images = 2, options.features = "gabor";
  const Evaluation e = Evaluate(run(), options, {});
  TrainingSetOptions pack = config_.pack;
  pack.template_maps = false;
  pack.cameras = config_.split.holdout_cameras;
  const auto ssim_of_frame_3 = [&](const std::vector<int>& frames) {
    pack.frames = frames;
    const AvatarPack some = BuildTrainingSet(data_, pack, {}).pack;
    const RenderedPack rendered = RenderPack(avatar, some, 1);
    double sum = 0;
    for (int64_t i = 0; i < some.size(); ++i) {
      if (some.frame[i].item<int64_t>() != 3) continue;
      const auto one = [i](const at::Tensor& t) { return t.slice(0, i, i + 1); };
      sum += ScoreImages(EightBit(one(OnBlack(some))), one(some.masks), EightBit(one(rendered.images)),
                         one(rendered.masks).to(at::kDouble))[0]
                 .bbox.ssim;
    }
    return sum / 2;
  };
  const double own = e.other_splits.at("held-out cameras in training frames").mean.bbox.ssim;
  EXPECT_EQ(e.other_splits.at("held-out cameras in training frames").mean.n, 2) << "frame 3 of 0 to 5 of both cameras";
  EXPECT_NEAR(own, ssim_of_frame_3({1, 2, 3}), 1e-9);
  EXPECT_GT(std::abs(own - ssim_of_frame_3({3})), 1e-6) << "the past matters";
}

TEST_F(EvaluateRun, NetsOfTheUserAndMotionsHaveTheirScores) {
  SaveDetector(folder_.path() + "/detector.pt");
  SaveImageDistance(folder_.path() + "/lpips.pt");
  EvaluateOptions options;
  options.images = 1, options.other_images = 4, options.renders = 4;
  options.features = folder_.path() + "/detector.pt", options.lpips = folder_.path() + "/lpips.pt";
  options.motions = "early=6-7,late=8-8";
  const Evaluation e = Evaluate(run(), options, {});
  EXPECT_EQ(e.distance_name, "FD (detector.pt)");
  EXPECT_GT(e.holdout.lpips, 0);
  EXPECT_LT(e.nearest_pose.lpips, e.holdout.lpips) << "an untrained avatar loses";
  ASSERT_EQ(e.per_motion.size(), 2u);
  EXPECT_EQ(e.per_motion[0].mean.n, 4);
  EXPECT_EQ(e.per_motion[1].mean.n, 2);
  EXPECT_NEAR(e.holdout.mean.bbox.ssim, (4 * e.per_motion[0].mean.bbox.ssim + 2 * e.per_motion[1].mean.bbox.ssim) / 6, 1e-12);
  EXPECT_NEAR(e.holdout.lpips, (e.per_camera[0].lpips + e.per_camera[1].lpips) / 2, 1e-12);
  const std::string json = ToJsonText(e);
  for (const char* key : {"\"lpips\"", "\"lpips_ci95\"", "FD (detector.pt)", "\"early\"", "\"protocol_sha256\""})
    EXPECT_THAT(json, HasSubstr(key));
  EXPECT_EQ(FilesMatching(run() + "/eval/render/*.png").size(), 4u);
  EXPECT_EQ(FilesMatching(run() + "/eval/truth/*.png").size(), 4u);
  const Image truth = dataset::ReadImage(FilesMatching(run() + "/eval/truth/*.png")[0]);
  EXPECT_EQ(truth.width, 64);
  options.motions = "never=20-30";
  EXPECT_THAT(MessageOf<UsageError>([&] { Evaluate(run(), options, {}); }), HasSubstr("never=20-30"));
}

TEST_F(EvaluateRun, ScoresTheImagesThatExistAndCountsTheOthers) {
  EvaluateOptions options;
  options.images = 1, options.other_images = 4, options.renders = 0, options.features = "gabor";
  const Evaluation whole = Evaluate(run(), options, {});
  EXPECT_EQ(whole.missing.asked(), 6);
  EXPECT_EQ(whole.missing.missing(), 0);
  const auto remove_image = [&](const char* camera, int frame) {
    ASSERT_TRUE(std::filesystem::remove(data_.ImagePath(camera, frame))) << camera << " " << frame;
  };
  remove_image("00_01", 7);
  std::filesystem::remove(data_.MaskPath("00_03", 8));
  for (const char* camera : {"00_01", "00_03"}) {  // of the training frames only the second is left
    for (const int frame : {0, 1, 3, 4, 5}) remove_image(camera, frame);
  }
  for (int frame = 0; frame < 6; ++frame) remove_image(whole.nearest_camera.at("00_01").c_str(), frame);
  const Evaluation e = Evaluate(run(), options, {});
  EXPECT_EQ(e.holdout.mean.n, 4);
  EXPECT_TRUE(e.skipped.empty());
  EXPECT_EQ(e.missing.asked(), 6);
  EXPECT_EQ(e.missing.by_camera.at("00_01").no_image, std::set<int>{7});
  EXPECT_EQ(e.missing.by_camera.at("00_03").no_mask, std::set<int>{8});
  EXPECT_EQ(e.per_camera.at(0).mean.n, 2);
  EXPECT_EQ(e.other_splits.at("held-out cameras in training frames").mean.n, 2) << "frame 2 of both, chosen among what exists";
  EXPECT_NE(e.nearest_camera.at("00_01"), whole.nearest_camera.at("00_01")) << "it has no training picture any more";
  EXPECT_NE(e.protocol.sha256, whole.protocol.sha256) << "other pictures were scored";
  EXPECT_THAT(ToJsonText(e),
              AllOf(HasSubstr("\"missing\":{\"asked\":6,\"missing\":2"), HasSubstr("camera 00_01, frame 7: no image")));
  options.motions = "gone=7-7,rest=8-8";
  EXPECT_EQ(Evaluate(run(), options, {}).per_motion.at(0).mean.n, 1) << "of 00_03";
  remove_image("00_03", 7);
  EXPECT_THAT(MessageOf<UsageError>([&] { Evaluate(run(), options, {}); }), HasSubstr("gone=7-7"));
  remove_image("00_03", 6);
  EXPECT_THAT(MessageOf<FormatError>([&] { Evaluate(run(), options, {}); }), HasSubstr("of camera 00_03: leave it out"));
  options.motions = "", options.cameras = "00_01";
  EXPECT_EQ(Evaluate(run(), options, {}).holdout.mean.n, 2);
}

TEST_F(EvaluateRun, ScoresOfOneSizeMeetTheSameTruth) {
  EvaluateOptions options;
  options.images = 1, options.other_images = 0, options.renders = 1, options.features = "gabor";
  const Evaluation own = Evaluate(run(), options, {});
  options.score_size = 96;
  const Evaluation larger = Evaluate(run(), options, {});
  EXPECT_EQ(dataset::ReadImage(FilesMatching(run() + "/eval/render/*.png")[0]).width, 96);
  EXPECT_EQ(larger.size_px, 96);
  // The crops show the same: masks agree as well as at the avatar's own size, but for rounding of the outlines.
  EXPECT_NEAR(larger.nearest_pose.mean.mask_iou, own.nearest_pose.mean.mask_iou, 0.03);
  EXPECT_NEAR(larger.holdout.mean.mask_iou, own.holdout.mean.mask_iou, 0.03);
  EXPECT_NE(larger.protocol.sha256, own.protocol.sha256);
}

TEST_F(EvaluateRun, TheProtocolIsOfTheScoringNotOfTheTraining) {
  EvaluateOptions options;
  options.images = 0, options.other_images = 4, options.renders = 0, options.features = "gabor";
  const EvaluationProtocol first = Evaluate(run(), options, {}).protocol;
  EXPECT_EQ(ReadFile(run() + "/protocol.json"), first.json_text);
  // The dataset elsewhere, other training cameras and another network: the same protocol, another split of training cameras.
  std::filesystem::copy(dataset(), folder_.path() + "/moved", std::filesystem::copy_options::recursive);
  RunConfig other = config_;
  other.dataset = folder_.path() + "/moved";
  other.split.train_cameras.pop_back();
  WriteRunConfig(other, run() + "/config.json");
  const EvaluationProtocol same = Evaluate(run(), options, {}).protocol;
  EXPECT_EQ(same.sha256, first.sha256);
  EXPECT_NE(same.json_text, first.json_text);
  // A held-out mask with another content, and other held-out frames.
  const std::string mask = folder_.path() + "/moved/masks/00_01/00_01_00000006.png";
  Image changed = dataset::ReadImage(mask, true);
  changed.pixels[0] = 255;
  dataset::WriteImage(changed, mask);
  EXPECT_NE(Evaluate(run(), options, {}).protocol.sha256, first.sha256);
  other.dataset = dataset(), other.split.holdout_frames = {7, 8};
  WriteRunConfig(other, run() + "/config.json");
  EXPECT_NE(Evaluate(run(), options, {}).protocol.sha256, first.sha256);
}

TEST(Motions, AreNamedRangesOrRunsOfFrames) {
  const auto runs = ParseMotions("", {4, 0, 2, 20, 22, 50});
  ASSERT_EQ(runs.size(), 3u);
  EXPECT_EQ(runs[0].name, "0-4") << "every second frame is consecutive here";
  EXPECT_EQ(runs[2].name, "50");
  const auto clips = ParseMotions("", {5, 6, 7, 8}, {2, 7, 30});
  ASSERT_EQ(clips.size(), 2u) << "another clip begins at 7";
  EXPECT_EQ(clips[0].name, "5-6");
  const auto named = ParseMotions("a=0-4,20-22", {0, 2, 4, 20, 22});
  EXPECT_EQ(named[0].name, "a");
  EXPECT_EQ(named[1].name, "20-22");
  for (const char* bad : {"a", "a=", "=1-2", "a=2-1", "a=1-2x", "a=1"})
    EXPECT_THROW(ParseMotions(bad, {1, 2}), UsageError) << bad;
}

TEST_F(EvaluateRun, BaselinesTakeTheNearestCameraAndPose) {
  const auto nearest = NearestTrainingCameras(data_, config_.split, 0);
  EXPECT_THAT(nearest.at("00_01"), ::testing::AnyOf("00_00", "00_02")) << "72 degrees to either side";
  EXPECT_EQ(nearest.at("00_00"), "00_00");
  TrainingSetOptions crop = config_.pack;
  crop.template_maps = false;
  crop.cameras = {"00_00"}, crop.frames = config_.split.train_frames;
  const AvatarPack train = BuildTrainingSet(data_, crop, {}).pack;
  // A training image's own camera and pose are in the set: it must find itself.
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
              AllOf(HasSubstr("/nowhere/dataset"), HasSubstr("option 'dataset'")));
  EvaluateOptions options;
  options.dataset = dataset(), options.other_images = 0, options.images = 0;
  EXPECT_NO_THROW(Evaluate(run(), options, {}));
  std::filesystem::remove(run() + "/checkpoint.safetensors");
  EXPECT_THAT(MessageOf<IoError>([&] { Evaluate(run(), options, {}); }),
              AllOf(HasSubstr("checkpoint.safetensors"), HasSubstr("begin it again")));
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
