#include "avatar/train/train.h"

#include <torch/torch.h>

#include <cmath>
#include <filesystem>

#include "avatar/train/batch.h"
#include "core/error.h"
#include "tests/avatar/synthetic_pack.h"
#include "tests/support/one_thread.h"
#include "tests/support/test.h"

namespace mvstudio::avatar {
namespace {

ModelOptions TinyModel() {
  ModelOptions o;
  o.width = 8, o.downs = 2, o.encoder_blocks = 1, o.decoder_blocks = 1, o.head_kernel = 3, o.texture_px = 16,
  o.bone_half_width_px = 4;
  return o;
}

TrainOptions TinyTraining(int init_steps, int steps) {
  TrainOptions o;
  o.init_steps = init_steps, o.steps = steps, o.batch = 4, o.learning_rate = 3e-3, o.report_every = 10, o.validate_images = 0;
  return o;
}

TEST(Generator, PublishedNetworksHaveThePublishedNumberOfParameters) {
  ModelOptions paper = PaperModel();
  EXPECT_EQ(NumParameters(paper), 17167552);
  paper.inputs = 27;
  EXPECT_EQ(NumParameters(paper), 17176960);
  paper.norm = NormLayer::kInstance, paper.upsample = Upsampling::kNearest;
  EXPECT_EQ(NumParameters(paper), 15645440);
}

TEST(Generator, ShapesFollowTheInputAndSmallImagesAreRefused) {
  for (const NormLayer norm : {NormLayer::kBatch, NormLayer::kInstance}) {
    for (const Upsampling upsample : {Upsampling::kTransposed, Upsampling::kNearest}) {
      ModelOptions o = TinyModel();
      o.norm = norm, o.upsample = upsample;
      Generator generator(o, 1);
      const auto [parts, uv] = generator->forward(at::zeros({2, 36, 16, 24}));
      EXPECT_EQ(parts.sizes(), at::IntArrayRef({2, 25, 16, 24}));
      EXPECT_EQ(uv.sizes(), at::IntArrayRef({2, 48, 16, 24}));
      EXPECT_THROW(generator->forward(at::zeros({1, 36, 18, 16})), ContractViolation);
      EXPECT_THROW(generator->forward(at::zeros({1, 36, 4, 4})), ContractViolation);
    }
  }
}

TEST(Generator, SameSeedGivesTheSameWeights) {
  const Generator a(TinyModel(), 5), b(TinyModel(), 5), c(TinyModel(), 6);
  EXPECT_TRUE(at::equal(a->parameters()[0], b->parameters()[0]));
  EXPECT_FALSE(at::equal(a->parameters()[0], c->parameters()[0]));
  EXPECT_NEAR(a->parameters()[0].std().item<double>(), 0.02, 0.002);
}

TEST(Batch, JitterMovesImagesAndKeyPointsAlike) {
  const AvatarPack pack = MakeSyntheticPack(3, 64, 2, 0.07);
  TrainOptions o = TinyTraining(0, 1);
  o.jitter_scale = 0.2, o.jitter_shift = 0.1, o.jitter_roll_deg = 30;
  const AvatarModel model = MakeModel(TinyModel(), 64, {-1, 1}, 1);
  for (int64_t step = 0; step < 5; ++step) {
    const TrainBatch batch = MakeBatch(pack, model, o, {0, 1, 2}, true, 9, step);
    const at::Tensor drawn = batch.maps.slice(1, 0, 18).amax(1) > -0.95;  // bones are thinner than the painted limbs
    const at::Tensor inside = drawn.logical_and(batch.mask > 0.5).sum(), all = drawn.sum();
    EXPECT_GT(inside.item<double>() / all.item<double>(), 0.97) << step;
    EXPECT_LT(((batch.part > 0).to(at::kFloat) - batch.mask).abs().mean().item<double>(), 0.03)
        << step;  // labels move with the mask
  }
}

TEST(Batch, EveryImageComesOnceAnEpoch) {
  std::vector<int> seen(7, 0);
  for (int64_t step = 0; step < 7; ++step) {
    for (const int64_t i : ImagesOfStep(7, 2, 3, step)) ++seen[i];
  }
  for (const int count : seen) EXPECT_EQ(count, 2);
  EXPECT_EQ(ImagesOfStep(3, 8, 1, 0).size(), 8u);
}

TEST(Batch, LabelsAreFittedToTheMask) {
  AvatarPack pack = MakeSyntheticPack(1, 32, 1);
  pack.masks.zero_(), pack.part.zero_(), pack.uv.zero_();
  pack.masks[0].slice(0, 4, 20).slice(1, 4, 20).fill_(255);
  pack.part[0].slice(0, 10, 30).slice(1, 10, 14).fill_(3);
  pack.uv[0].slice(1, 10, 30).slice(2, 10, 14).fill_(0.5);
  FitLabelsToMasks(pack, 1);
  EXPECT_TRUE(at::equal(pack.part > 0, pack.masks > 0));
  EXPECT_EQ(pack.part[0][4][19].item<int>(), 3);
  EXPECT_FLOAT_EQ(pack.uv[0][1][19][4].item<float>(), 0.5f);
  EXPECT_FLOAT_EQ(pack.uv[0][1][25][12].item<float>(), 0.0f);
}

TEST(Train, LearnsAFewImagesByHeart) {
  const AvatarPack pack = MakeSyntheticPack(8, 32, 3);
  for (const char* method : {"tna", "direct"}) {
    ModelOptions model = TinyModel();
    FromString(method, &model.method);
    TrainOptions options = TinyTraining(40, 60);
    options.jitter_scale = options.jitter_shift = options.jitter_roll_deg = 0;
    AvatarModel trained;
    const TrainReport report = TrainTna(pack, nullptr, model, options, OneThread(), nullptr, &trained);
    ASSERT_EQ(report.status, Status::kOk) << report.message;
    EXPECT_EQ(trained.step, 100);
    const Rendering r = Render(trained, PosesOf(pack), 32, 32);
    const at::Tensor truth = pack.images.to(at::kFloat) / 255, mask = pack.masks > 0;
    const double error = (r.image - truth).abs().mean().item<double>(), black = truth.mean().item<double>();
    EXPECT_LT(error, 0.35 * black) << method;
    const at::Tensor predicted = r.mask_prob > 0.5;
    const double both = predicted.logical_and(mask).sum().item<double>(),
                 either = predicted.logical_or(mask).sum().item<double>();
    EXPECT_GT(both / either, 0.75) << method;
    EXPECT_TRUE(at::isfinite(r.image).all().item<bool>());
  }
}

TEST(Train, ResumingIsBitExact) {
  const AvatarPack pack = MakeSyntheticPack(6, 16, 4);
  const std::string path = (std::filesystem::temp_directory_path() / "mvstudio_resume_test.safetensors").string();
  for (const char* norm : {"instance", "batch"}) {
    ModelOptions model = TinyModel();
    FromString(norm, &model.norm);
    for (const int64_t interruption : {2, 3, 5}) {  // within the initialisation, at its end, after it
      const TrainOptions options = TinyTraining(3, 5);
      Trainer whole(pack, model, options, OneThread());
      whole.Run(nullptr, nullptr);
      Trainer first(pack, model, options, OneThread());
      first.Run(nullptr, nullptr, interruption);
      WriteTensorFile(first.Checkpoint(), path);
      const TensorFile file = ReadTensorFile(path);
      Trainer second(pack, file, path, TrainOptionsFrom(file, path), OneThread());
      EXPECT_EQ(second.model().step, interruption);
      second.Run(nullptr, nullptr);
      const TensorFile a = whole.Checkpoint(), b = second.Checkpoint();
      EXPECT_EQ(a.metadata, b.metadata);
      ASSERT_EQ(a.tensors.size(), b.tensors.size());
      for (const auto& [name, tensor] : a.tensors)
        EXPECT_TRUE(at::equal(tensor, b.tensors.at(name))) << name << " " << interruption;
    }
  }
  std::filesystem::remove(path);
}

TEST(Train, NonFiniteLossStopsAndKeepsTheWeights) {
  const AvatarPack pack = MakeSyntheticPack(6, 16, 4);
  for (const bool in_network : {true, false}) {
    ModelOptions model = TinyModel();
    model.norm = NormLayer::kBatch;
    Trainer trainer(pack, model, TinyTraining(1, 5), OneThread());
    trainer.Run(nullptr, nullptr, 2);
    {
      torch::NoGradGuard no_grad;
      if (in_network) {
        trainer.model().generator->parameters()[0].flatten()[0] = std::nan("");
      } else {
        trainer.model().textures.fill_(std::nan(""));
      }
    }
    const TensorFile before = trainer.Checkpoint();
    const TrainReport report = trainer.Run(nullptr, nullptr);
    EXPECT_EQ(report.status, Status::kNonFiniteInput);
    EXPECT_NE(report.message.find("camera cam_0"), std::string::npos) << report.message;
    EXPECT_NE(report.message.find("frame "), std::string::npos);
    const TensorFile after = trainer.Checkpoint();
    for (const auto& [name, tensor] : before.tensors) {
      if (!at::isfinite(tensor).all().item<bool>()) continue;
      EXPECT_TRUE(at::equal(tensor, after.tensors.at(name))) << name;
    }
    EXPECT_EQ(trainer.model().step, 2);
  }
}

TEST(Train, OptionsThatDoNotFitAreRefused) {
  const AvatarPack pack = MakeSyntheticPack(2, 30, 4);
  EXPECT_THROW(Trainer(pack, TinyModel(), TinyTraining(1, 1), OneThread()), UsageError);  // 30 is no multiple of 4
  ModelOptions model = TinyModel();
  model.inputs = 20;
  EXPECT_THROW(Trainer(MakeSyntheticPack(2, 32, 4), model, TinyTraining(1, 1), OneThread()), UsageError);
  model = TinyModel();
  model.prior = Prior::kAuto;
  EXPECT_THROW(MakeModel(model, 32, {0, 1}, 1), UsageError);
  EXPECT_THROW(SetFieldFromText(model, "norm", "group"), UsageError);
  TrainOptions options = TinyTraining(1, 1);
  options.learning_rate = 1;
  EXPECT_THROW(Trainer(MakeSyntheticPack(2, 32, 4), TinyModel(), options, OneThread()), UsageError);
}

TEST(Model, CheckpointsThatDoNotFitAreRefused) {
  const AvatarModel model = MakeModel(TinyModel(), 32, {-1, 1}, 1);
  TensorFile file = ModelToTensors(model);
  file.tensors["textures"][0][0][0][0] = std::nan("");
  EXPECT_THROW(ModelFromTensors(file, "x"), FormatError);
  file = ModelToTensors(model);
  file.metadata["model.width"] = "9";
  EXPECT_THROW(ModelFromTensors(file, "x"), FormatError);
  file.metadata["model.width"] = "many";
  EXPECT_THROW(ModelFromTensors(file, "x"), FormatError);
  file = ModelToTensors(model);
  file.metadata["format"] = "other/1";
  EXPECT_THROW(ModelFromTensors(file, "x"), FormatError);
  EXPECT_THROW(Trainer(MakeSyntheticPack(2, 32, 4), ModelToTensors(model), "x", TinyTraining(1, 1), OneThread()), FormatError);
}

TEST(Model, RenderingRefusesPosesThatAreNotFinite) {
  AvatarModel model = MakeModel(TinyModel(), 32, {-1, 1}, 1);
  AvatarPack pack = MakeSyntheticPack(1, 32, 4);
  const Rendering r = Render(model, PosesOf(pack), 32, 32, at::ones({3}));
  EXPECT_EQ(r.image.sizes(), at::IntArrayRef({1, 3, 32, 32}));
  EXPECT_EQ(r.uv.sizes(), at::IntArrayRef({1, 2, 32, 32}));
  pack.joints_in_cam[0][0][0] = std::nan("");
  EXPECT_THROW(Render(model, PosesOf(pack), 32, 32), ContractViolation);
}

}  // namespace
}  // namespace mvstudio::avatar
