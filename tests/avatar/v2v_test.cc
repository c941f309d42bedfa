#include <ATen/ATen.h>
#include <torch/torch.h>

#include <cmath>
#include <filesystem>

#include "avatar/nets/discriminator.h"
#include "avatar/nets/feature_net.h"
#include "avatar/nets/sequence.h"
#include "avatar/train/train.h"
#include "core/error.h"
#include "tests/avatar/synthetic_pack.h"
#include "tests/support/one_thread.h"
#include "tests/support/test.h"

/// The video-to-video baseline: memory, flow, discriminators; and the perceptual loss.
namespace mvstudio::avatar {
namespace {

ModelOptions TinyVideo() {
  ModelOptions o;
  o.method = Method::kV2v;
  o.width = 4, o.downs = 2, o.encoder_blocks = o.decoder_blocks = 1, o.texture_px = 8;
  return o;
}

TrainOptions TinyTraining(int steps) {
  TrainOptions o;
  o.steps = steps, o.init_steps = 0, o.batch = 2, o.save_every = 1000, o.report_every = 1, o.validate_images = 0;
  o.critic_width = 4, o.critic_layers = 1, o.critic_scales = 2;
  return o;
}

/// Rows 0, 1, 2 of camera 0 are frames 5, 6, 7; row 3 is frame 6 of camera 1.
AvatarPack FourRows() {
  AvatarPack pack = MakeSyntheticPack(4, 16, 4);
  pack.cameras = {"cam_0", "cam_1"};
  pack.camera_idx = at::tensor({0, 0, 0, 1}, at::kLong);
  pack.frame = at::tensor({5, 6, 7, 6}, at::kLong);
  return pack;
}

TEST(Sequence, PreviousRowsAreOfTheSameCameraAndTheFrameBefore) {
  EXPECT_EQ(PreviousRows(FourRows()), (std::vector<int64_t>{-1, 0, 1, -1}));
  AvatarPack gap = FourRows();
  gap.frame = at::tensor({5, 10, 20, 10}, at::kLong);
  EXPECT_EQ(PreviousRows(gap), (std::vector<int64_t>{-1, -1, 1, -1})) << "steps of 5 and 10: the upper median";
  gap.frame_step = 5;
  EXPECT_EQ(PreviousRows(gap), (std::vector<int64_t>{-1, 0, -1, -1})) << "the pack says what is consecutive";
}

TEST(Sequence, ACutHasNoPast) {
  AvatarPack pack = FourRows();
  pack.cuts = {6};
  EXPECT_EQ(PreviousRows(pack), (std::vector<int64_t>{-1, -1, 1, -1}));
  EXPECT_EQ(Select(pack, {1, 2}).cuts, pack.cuts);
  pack.cuts = {5, 8};
  EXPECT_EQ(PreviousRows(pack), (std::vector<int64_t>{-1, 0, 1, -1}));
}

TEST(Sequence, RendersFrameByFrameWhateverTheBatch) {
  const AvatarPack pack = FourRows();
  AvatarModel model = MakeModel(TinyVideo(), 16, {-0.5, 0.5}, 3);
  const RenderedPack one = RenderPack(model, pack, 1), many = RenderPack(model, pack, 8);
  EXPECT_TRUE(at::allclose(one.images, many.images, 0, 1e-6));
  at::Tensor past = at::zeros({1, 6, 16, 16});
  for (int64_t i = 0; i < 3; ++i) {  // camera 0 by hand
    const Rendering r = Render(model, PosesOf(Select(pack, {i})), 16, 16, {}, past);
    EXPECT_TRUE(at::allclose(r.image[0], one.images[i], 0, 1e-6)) << i;
    past = at::cat({r.image, past.slice(1, 0, 3)}, 1);
  }
  const Rendering fresh = Render(model, PosesOf(Select(pack, {2})), 16, 16);
  EXPECT_FALSE(at::allclose(fresh.image[0], one.images[2], 0, 1e-4)) << "the past must matter";
}

TEST(Warp, MovesByTheFlowAndHasTheGradientOfFiniteDifferences) {
  const at::Tensor image = at::rand({1, 3, 8, 9}, at::kDouble);
  EXPECT_TRUE(at::allclose(Warp(image, at::zeros({1, 2, 8, 9}, at::kDouble)), image, 0, 1e-12));
  at::Tensor flow = at::zeros({1, 2, 8, 9}, at::kDouble);
  flow.select(1, 0).fill_(2);
  EXPECT_TRUE(at::allclose(Warp(image, flow).slice(3, 0, 7), image.slice(3, 2, 9), 0, 1e-12));
  flow = (0.3 + 0.4 * at::rand({1, 2, 8, 9}, at::kDouble)).requires_grad_();
  const at::Tensor weights = at::rand({1, 3, 8, 9}, at::kDouble);
  (Warp(image, flow) * weights).sum().backward();
  const at::NoGradGuard no_gradients;
  for (const int64_t i : {0, 40, 71, 72, 100, 143}) {
    at::Tensor plus = flow.detach().clone(), minus = plus.clone();
    plus.flatten()[i] += 1e-6, minus.flatten()[i] -= 1e-6;
    const double numeric = ((Warp(image, plus) - Warp(image, minus)) * weights).sum().item<double>() / 2e-6;
    EXPECT_NEAR(flow.grad().flatten()[i].item<double>(), numeric, 1e-6) << i;
  }
}

TEST(Discriminator, ScalesLayersAndLosses) {
  Discriminator critic(5, 4, 2, 2, 1);
  const at::Tensor image = at::rand({2, 5, 32, 32});
  const PatchFeatures features = critic->forward(image);
  ASSERT_EQ(features.size(), 2u);
  ASSERT_EQ(features[0].size(), 4u);
  EXPECT_EQ(features[0].back().size(1), 1);
  EXPECT_GT(features[0].back().size(2), features[1].back().size(2));
  EXPECT_EQ(FeatureMatching(features, features).item<float>(), 0);
  const PatchFeatures ones = {{at::full({1, 1, 2, 2}, 3.0), at::ones({1, 1, 2, 2})}};
  const PatchFeatures zeros = {{at::zeros({1, 1, 2, 2}), at::zeros({1, 1, 2, 2})}};
  EXPECT_FLOAT_EQ(PatchLoss(ones, true).item<float>(), 0);
  EXPECT_FLOAT_EQ(PatchLoss(ones, false).item<float>(), 1);
  EXPECT_FLOAT_EQ(PatchLoss(zeros, true).item<float>(), 1);
  EXPECT_FLOAT_EQ(FeatureMatching(ones, zeros).item<float>(), 3) << "scores do not count";
}

TEST(Video, ResumingIsBitExact) {
  AvatarPack pack = MakeSyntheticPack(6, 16, 4);
  const std::string path = (std::filesystem::temp_directory_path() / "mvstudio_video_resume_test.safetensors").string();
  const TrainOptions options = TinyTraining(5);
  Trainer whole(pack, TinyVideo(), options, OneThread(7));
  ASSERT_EQ(whole.Run(nullptr, nullptr).status, Status::kOk);
  Trainer first(pack, TinyVideo(), options, OneThread(7));
  first.Run(nullptr, nullptr, 2);
  WriteTensorFile(first.Checkpoint(), path);
  const TensorFile file = ReadTensorFile(path);
  Trainer second(pack, file, path, TrainOptionsFrom(file, path), OneThread(7));
  second.Run(nullptr, nullptr);
  const TensorFile a = whole.Checkpoint(), b = second.Checkpoint();
  ASSERT_EQ(a.tensors.size(), b.tensors.size());
  for (const auto& [name, tensor] : a.tensors) EXPECT_TRUE(at::equal(tensor, b.tensors.at(name))) << name;
  std::filesystem::remove(path);
}

TEST(Video, LearnsAFewImagesByHeartAndTrainsItsCritic) {
  const AvatarPack pack = MakeSyntheticPack(6, 32, 3);
  TrainOptions options = TinyTraining(220);
  options.learning_rate = 3e-3;
  options.jitter_scale = options.jitter_shift = options.jitter_roll_deg = 0;
  Trainer trainer(pack, TinyVideo(), options, OneThread(7));
  const TensorFile before = trainer.Checkpoint();
  const TrainReport report = trainer.Run(nullptr, nullptr);
  ASSERT_EQ(report.status, Status::kOk) << report.message;
  EXPECT_LT(report.history.back()["l1"], 0.5 * report.history.front()["l1"]);
  for (const char* column : {"gan", "features", "discriminator"}) EXPECT_GT(report.history.back()[column], 0) << column;
  bool moved = false;
  const TensorFile after = trainer.Checkpoint();
  for (const auto& [name, tensor] : before.tensors)
    moved |= name.rfind("critic.", 0) == 0 && !at::equal(tensor, after.tensors.at(name));
  EXPECT_TRUE(moved);
}

TEST(Train, NoLearningRateLeavesEveryByte) {
  const AvatarPack pack = MakeSyntheticPack(6, 16, 4);
  for (const char* method : {"tna", "direct", "v2v"}) {
    ModelOptions model = TinyVideo();
    FromString(method, &model.method);
    TrainOptions options = TinyTraining(3);
    options.learning_rate = options.texture_learning_rate = 0;
    Trainer trainer(pack, model, options, OneThread(7));
    trainer.Run(nullptr, nullptr, 1);
    const TensorFile before = ModelToTensors(trainer.model());
    trainer.Run(nullptr, nullptr);
    const TensorFile after = ModelToTensors(trainer.model());
    for (const auto& [name, tensor] : before.tensors)
      EXPECT_TRUE(at::equal(tensor, after.tensors.at(name))) << method << " " << name;
  }
}

/// Levels of known value: the image, and its squares at half the size.
class SquareNet : public FeatureNet {
 public:
  explicit SquareNet(std::string sha256 = "") : sha256_(std::move(sha256)) {}
  std::string name() const override { return "square"; }
  std::string sha256() const override { return sha256_; }
  std::vector<at::Tensor> Levels(const at::Tensor& rgb) const override { return {rgb, at::avg_pool2d(rgb, 2).square()}; }

 private:
  std::string sha256_;
};

TEST(Perceptual, IsTheMeanOverLevelsAndHasAGradientOnOneSideOnly) {
  const SquareNet net;
  at::Tensor a = at::full({1, 3, 4, 4}, 0.5).requires_grad_(), b = at::full({1, 3, 4, 4}, 0.25).requires_grad_();
  const at::Tensor loss = PerceptualLoss(net, a, b, at::full({1, 1, 4, 4}, 1.0 / 16));
  EXPECT_FLOAT_EQ(loss.item<float>(), (0.25f + (0.25f - 0.0625f)) / 2);
  loss.backward();
  EXPECT_TRUE(a.grad().defined());
  EXPECT_FALSE(b.grad().defined());
  EXPECT_TRUE(at::allclose(net.Pooled(b), at::full({1, 3}, 0.0625)));
}

TEST(Perceptual, ActivationsWeighAsThePixelsBelowThem) {
  const SquareNet net;
  const at::Tensor truth = at::zeros({1, 3, 4, 4});
  at::Tensor on = truth.clone(), beside = truth.clone(), weights = at::full({1, 1, 4, 4}, 1.0 / 40);
  weights.slice(2, 0, 2) *= 4;  // the person's
  on.slice(2, 0, 2).fill_(0.5), beside.slice(2, 2, 4).fill_(0.5);
  EXPECT_NEAR(PerceptualLoss(net, on, truth, weights).item<double>(), 0.8 * (0.5 + 0.25) / 2, 1e-6);
  EXPECT_NEAR(PerceptualLoss(net, beside, truth, weights).item<double>(), 0.2 * (0.5 + 0.25) / 2, 1e-6);
}

TEST(Perceptual, ARunGoesOnWithItsOwnNet) {
  const AvatarPack pack = MakeSyntheticPack(6, 16, 4);
  Trainer trainer(pack, TinyVideo(), TinyTraining(2), OneThread(7), std::make_shared<SquareNet>());
  const TrainReport report = trainer.Run(nullptr, nullptr);
  EXPECT_GT(report.history.back()["perceptual"], 0);
  const TensorFile file = trainer.Checkpoint();
  EXPECT_THROW(Trainer(pack, file, "x", TinyTraining(3), OneThread(7)), UsageError);
  EXPECT_NO_THROW(Trainer(pack, file, "x", TinyTraining(3), OneThread(7), std::make_shared<SquareNet>()));
  EXPECT_THROW(Trainer(pack, file, "x", TinyTraining(3), OneThread(7), std::make_shared<SquareNet>("other weights")),
               UsageError);
}

TEST(Perceptual, FilesThatAreNoNetsAreRefused) {
  EXPECT_THROW(LoadTorchScriptNet("/does/not/exist.pt"), IoError);
  EXPECT_THROW(LoadTorchScriptNet("/etc/hostname"), FormatError);
}

}  // namespace
}  // namespace mvstudio::avatar
