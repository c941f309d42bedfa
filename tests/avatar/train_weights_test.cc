#include <torch/torch.h>

#include <cmath>
#include <filesystem>

#include "avatar/train/train.h"
#include "core/error.h"
#include "tests/avatar/synthetic_pack.h"
#include "tests/support/one_thread.h"
#include "tests/support/test.h"

/// Which weights a training hands out (averages, best check), texels that stay as they are, and transfer to another person.
namespace mvstudio::avatar {
namespace {

ModelOptions TinyModel(const char* method = "tna") {
  ModelOptions o;
  FromString(method, &o.method);
  o.width = 4, o.downs = 2, o.encoder_blocks = o.decoder_blocks = 1, o.texture_px = 16, o.bone_half_width_px = 4;
  return o;
}

TrainOptions TinyTraining(int init_steps, int steps) {
  TrainOptions o;
  o.init_steps = init_steps, o.steps = steps, o.batch = 2, o.learning_rate = 3e-3, o.report_every = 1, o.save_every = 2;
  o.validate_images = 2;
  o.critic_width = 4, o.critic_layers = 1, o.device = "cpu";
  return o;
}

void ExpectSameFile(const TensorFile& a, const TensorFile& b, const std::string& what) {
  EXPECT_EQ(a.metadata, b.metadata) << what;
  ASSERT_EQ(a.tensors.size(), b.tensors.size()) << what;
  for (const auto& [name, tensor] : a.tensors) EXPECT_TRUE(at::equal(tensor, b.tensors.at(name))) << what << " " << name;
}

TEST(Ema, IsTheRecursionOverTheWeightsOfEachStep) {
  const AvatarPack pack = MakeSyntheticPack(6, 16, 4);
  TrainOptions options = TinyTraining(2, 6);
  options.ema = 0.6;
  Trainer trainer(pack, TinyModel(), options, OneThread(3));
  std::vector<at::Tensor> weights, textures;
  trainer.Run(nullptr, [&](int64_t, const HistoryRow*) {
    weights.push_back(trainer.model().generator->parameters()[0].detach().clone());
    textures.push_back(trainer.model().textures.detach().clone());
    return true;
  });
  ASSERT_EQ(weights.size(), 8u);
  at::Tensor mean = weights[0].to(at::kDouble), mean_texture = textures[2].to(at::kDouble);
  for (size_t i = 1; i < weights.size(); ++i) {
    const auto n = static_cast<double>(i + 1);
    const double stays = std::min(0.6, (1 + n) / (10 + n));
    mean = stays * mean + (1 - stays) * weights[i].to(at::kDouble);
    if (i > 2) mean_texture = stays * mean_texture + (1 - stays) * textures[i].to(at::kDouble);
  }
  const AvatarModel handed = ModelFromTensors(trainer.Checkpoint(), "x");
  EXPECT_TRUE(at::allclose(handed.generator->parameters()[0].to(at::kDouble), mean, 1e-6, 1e-8));
  EXPECT_TRUE(at::allclose(handed.textures.to(at::kDouble), mean_texture, 1e-6, 1e-7));
  EXPECT_FALSE(at::equal(handed.textures, trainer.model().textures));
  trainer.UseHanded([&](AvatarModel& model) {
    EXPECT_TRUE(at::equal(model.textures, handed.textures));
    EXPECT_TRUE(at::equal(model.generator->parameters()[0], handed.generator->parameters()[0]));
  });
  EXPECT_TRUE(at::equal(trainer.model().textures, textures.back())) << "only borrowed";
}

TEST(Handed, ResumingWithAveragesAndBestWeightsIsBitExact) {
  const AvatarPack pack = MakeSyntheticPack(6, 16, 4), validation = MakeSyntheticPack(2, 16, 9);
  const std::string path = (std::filesystem::temp_directory_path() / "mvstudio_handed_test.safetensors").string();
  for (const bool averages : {true, false}) {
    for (const int patience : averages ? std::vector<int>{0, 50} : std::vector<int>{50}) {
      TrainOptions options = TinyTraining(2, 6);
      options.ema = averages ? 0.9 : 0, options.patience = patience, options.learning_rate = 0.05;
      const auto train = [&](Trainer& trainer, int64_t until) { trainer.Run(&validation, nullptr, until); };
      Trainer whole(pack, TinyModel(), options, OneThread(3));
      train(whole, -1);
      for (const int64_t interruption : {1, 6}) {
        Trainer first(pack, TinyModel(), options, OneThread(3));
        train(first, interruption);
        WriteTensorFile(first.Checkpoint(), path);
        const TensorFile file = ReadTensorFile(path);
        Trainer second(pack, file, path, TrainOptionsFrom(file, path), OneThread(3));
        ExpectSameFile(first.Checkpoint(), second.Checkpoint(), "at once");
        train(second, -1);
        ExpectSameFile(whole.Checkpoint(), second.Checkpoint(), "interrupted at " + std::to_string(interruption));
      }
    }
  }
  std::filesystem::remove(path);
}

TEST(Patience, EndsEarlyAndHandsOutTheWeightsOfTheBestCheck) {
  const AvatarPack pack = MakeSyntheticPack(6, 16, 4), validation = MakeSyntheticPack(2, 16, 9);
  for (const char* method : {"tna", "v2v"}) {
    TrainOptions options = TinyTraining(2, 200);
    options.patience = 3, options.learning_rate = 0.3, options.clip_norm = 0;  // soon ruins the network
    Trainer trainer(pack, TinyModel(method), options, OneThread(3));
    const TrainReport report = trainer.Run(&validation, nullptr);
    ASSERT_TRUE(report.ended_early) << method;
    EXPECT_EQ(report.steps_done, report.best_step + 3 * options.save_every) << method;
    EXPECT_NE(report.message.find("step " + std::to_string(report.best_step) + " are kept"), std::string::npos)
        << report.message;
    Trainer again(pack, TinyModel(method), options, OneThread(3));
    again.Run(&validation, nullptr, report.best_step);
    const AvatarModel handed = ModelFromTensors(trainer.Checkpoint(), "x");
    const std::vector<at::Tensor> a = handed.generator->parameters(), b = again.model().generator->parameters();
    for (size_t i = 0; i < a.size(); ++i) EXPECT_TRUE(at::equal(a[i], b[i])) << method << i;
    const auto score = [&](const HistoryRow& row) {
      return options.weight_l1 * row["l1"] + options.weight_ssim * row["ssim"] + options.weight_mask * row["mask"];
    };
    double best = 1e9;
    for (const HistoryRow& row : report.history) {
      if (row.phase == "validation") best = std::min(best, score(row));
    }
    for (const HistoryRow& row : report.history) {
      if (row.phase != "validation" || row.step != report.best_step) continue;
      EXPECT_DOUBLE_EQ(score(row), best);
    }
  }
}

TEST(Patience, AScoreThatIsNotFiniteIsNeverTheBest) {
  const AvatarPack pack = MakeSyntheticPack(6, 16, 4), validation = MakeSyntheticPack(2, 16, 9);
  TrainOptions options = TinyTraining(0, 200);
  options.patience = 3;
  ModelOptions model = TinyModel("direct");
  model.norm = NormLayer::kBatch;
  Trainer trainer(pack, model, options, OneThread(3));
  const auto fill = [&](double value) {  // the running statistics, which training steps do not look at
    torch::NoGradGuard no_grad;
    for (const at::Tensor& buffer : trainer.model().generator->buffers()) {
      if (buffer.is_floating_point()) at::Tensor(buffer).fill_(value);
    }
  };
  const TrainReport report = trainer.Run(&validation, [&](int64_t, const HistoryRow*) {
    fill(std::nan(""));
    return true;
  });
  EXPECT_EQ(report.status, Status::kOk) << report.message;
  EXPECT_TRUE(report.ended_early);
  EXPECT_EQ(report.best_step, -1);
  EXPECT_EQ(report.steps_done, 3 * options.save_every);
  EXPECT_NE(report.message.find("no check had a finite one"), std::string::npos) << report.message;
  fill(1);
  const TensorFile file = trainer.Checkpoint();
  EXPECT_TRUE(Trainer(pack, file, "x", TrainOptionsFrom(file, "x"), OneThread(3)).Run(&validation, nullptr).ended_early);
}

TEST(Textures, AreThereWhenTheInitialisationEnds) {
  const AvatarPack pack = MakeSyntheticPack(6, 16, 4);
  Trainer trainer(pack, TinyModel(), TinyTraining(4, 6), OneThread(3));
  std::vector<double> spread;
  trainer.Run(nullptr, [&](int64_t, const HistoryRow*) {
    spread.push_back(trainer.model().textures.detach().std().item<double>());
    return true;
  });
  EXPECT_EQ(spread[2], 0) << "grey";
  EXPECT_GT(spread[3], 0.05) << "a check or a checkpoint of this step has colours";
}

TEST(Freeze, TexelsThatNoImageShowsKeepTheirBytes) {
  const AvatarPack pack = MakeSyntheticPack(4, 16, 4);
  TrainOptions options = TinyTraining(30, 20);
  for (const bool freeze : {true, false}) {
    options.freeze_unseen = freeze;
    Trainer trainer(pack, TinyModel(), options, OneThread(3));
    trainer.Run(nullptr, nullptr, 31);
    const at::Tensor first = trainer.model().textures.detach().clone();
    const at::Tensor unseen = (trainer.model().seen == 0).unsqueeze(1).expand({24, 3, 16, 16});
    ASSERT_GT(unseen.sum().item<int64_t>(), 100);
    ASSERT_LT(unseen.sum().item<int64_t>(), unseen.numel());
    trainer.Run(nullptr, nullptr);
    const at::Tensor changed = trainer.model().textures.detach() != first;
    EXPECT_GT(changed.logical_and(unseen.logical_not()).sum().item<int64_t>(), 100);
    EXPECT_EQ(changed.logical_and(unseen).any().item<bool>(), !freeze);
  }
}

/// After too short an initialisation the network sees few parts; all that the first guess shows have colours nevertheless.
TEST(Textures, PartsThatTheNetworkDoesNotKnowYetHaveTheColoursOfTheFirstGuess) {
  const AvatarPack pack = MakeSyntheticPack(4, 16, 4);
  TrainOptions options = TinyTraining(1, 1);
  options.learning_rate = options.texture_learning_rate = 0;
  Trainer trainer(pack, TinyModel(), options, OneThread(3));
  trainer.Run(nullptr, nullptr);
  for (int64_t part = 1; part <= 24; ++part) {
    const bool shown = (pack.part == part).any().item<bool>();
    EXPECT_TRUE(!shown || trainer.model().seen[part - 1].max().item<float>() > 0) << part;
  }
}

TEST(Transfer, KeepsTheNetworkAndAveragesNewTextures) {
  const AvatarPack first = MakeSyntheticPack(6, 16, 4), second = MakeSyntheticPack(5, 32, 8);
  AvatarModel from;
  TrainTna(first, nullptr, TinyModel(), TinyTraining(30, 10), OneThread(3), nullptr, &from);
  TrainOptions options = TinyTraining(-1, 3);
  options.learning_rate = options.texture_learning_rate = 0;
  ModelOptions to = from.options;
  to.texture_px = 12;
  Trainer trainer(second, StartFrom(from, to, second.size_px, 1), options, OneThread(3));
  EXPECT_EQ(trainer.model().step, 0);
  const TrainReport report = trainer.Run(nullptr, nullptr);
  EXPECT_EQ(report.steps_done, 3) << "no initialisation";
  const std::vector<at::Tensor> a = from.generator->parameters(), b = trainer.model().generator->parameters();
  for (size_t i = 0; i < a.size(); ++i) EXPECT_TRUE(at::equal(a[i], b[i])) << i;
  EXPECT_EQ(trainer.model().depth.near_m, from.depth.near_m);
  EXPECT_EQ(trainer.model().textures.size(2), 12);
  EXPECT_GT((trainer.model().seen > 0).sum().item<int64_t>(), 50);
  EXPECT_GT(trainer.model().textures.detach().std().item<double>(), 0.05) << "colours, not grey";
  const TensorFile checkpoint = trainer.Checkpoint();
  Trainer resumed(second, checkpoint, "x", TrainOptionsFrom(checkpoint, "x"), OneThread(3));
  ExpectSameFile(checkpoint, resumed.Checkpoint(), "transfer");
}

TEST(Device, WhatTheMachineHasNotIsSaid) {
  const AvatarPack pack = MakeSyntheticPack(2, 16, 4);
  TrainOptions options = TinyTraining(1, 1);
  options.amp = true;
  EXPECT_THROW(Trainer(pack, TinyModel(), options, OneThread(3)), UsageError);
  options.amp = false, options.device = "tpu";
  EXPECT_THROW(Trainer(pack, TinyModel(), options, OneThread(3)), UsageError);
  EXPECT_EQ(ResolveDevice("cpu"), "cpu");
  if (torch::cuda::is_available()) {
    EXPECT_EQ(ResolveDevice("auto"), "cuda");
  } else {
    EXPECT_EQ(ResolveDevice("auto"), "cpu");
    EXPECT_THROW(ResolveDevice("cuda"), MissingToolError);
  }
  options.device = "auto";
  Trainer trainer(pack, TinyModel(), options, OneThread(3));
  EXPECT_EQ(TrainOptionsFrom(trainer.Checkpoint(), "x").device, "auto") << "another machine may have what this one has not";
}

}  // namespace
}  // namespace mvstudio::avatar
