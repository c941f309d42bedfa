#include <torch/torch.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <functional>
#include <thread>

#include "avatar/train/train.h"
#include "core/error.h"
#include "tests/avatar/synthetic_pack.h"
#include "tests/support/message_of.h"
#include "tests/support/one_thread.h"
#include "tests/support/test.h"

/// Several ranks are threads here; as processes they do the same (tests/cli).
namespace mvstudio::avatar {
namespace {

ModelOptions TinyModel(const std::string& method) {
  ModelOptions o;
  FromString(method, &o.method);
  o.width = 8, o.downs = 2, o.encoder_blocks = o.decoder_blocks = 1, o.texture_px = 16, o.bone_half_width_px = 4;
  return o;
}

TrainOptions TinyTraining(int batch) {
  TrainOptions o;
  o.init_steps = 4, o.steps = 6, o.batch = batch, o.report_every = 5, o.validate_images = 2, o.save_every = 3;
  o.critic_width = 4, o.critic_layers = 1, o.device = "cpu";
  return o;
}

std::string Rendezvous(const std::string& name) {
  const std::string path =
      (std::filesystem::temp_directory_path() / ("mvstudio_ranks_" + name + std::to_string(getpid()))).string();
  std::filesystem::remove(path);
  return path;
}

/// Calls `work` once for each rank, each in its own thread.
void WithRanks(int size, const std::string& name, const std::function<void(std::shared_ptr<const Ranks>)>& work) {
  const std::string path = Rendezvous(name);
  std::vector<std::thread> threads;
  for (int rank = 0; rank < size; ++rank) threads.emplace_back([=] { work(JoinRanks({rank, size, path, true, {}})); });
  for (std::thread& thread : threads) thread.join();
  std::filesystem::remove(path);
}

/// Relative. Biases before an instance norm do nothing, and their gradients are rounding alone: only `gradients` count them.
double Difference(const TensorFile& a, const TensorFile& b, const std::string& prefix, bool gradients = false) {
  double difference = 0, size = 0;
  for (const auto& [name, tensor] : a.tensors) {
    const bool bias = name.size() > 4 && name.compare(name.size() - 4, 4, "bias") == 0;
    if (name.rfind(prefix, 0) != 0 || (bias && !gradients)) continue;
    difference += (tensor - b.tensors.at(name)).to(at::kDouble).square().sum().item<double>();
    size += tensor.to(at::kDouble).square().sum().item<double>();
  }
  return size > 0 ? std::sqrt(difference / size) : 0;
}

TEST(Ranks, SumAndBroadcast) {
  WithRanks(3, "sum", [](const std::shared_ptr<const Ranks>& ranks) {
    at::Tensor values = at::full({5}, ranks->rank() + 1.0, at::kDouble), first = at::full({2, 2}, 7.0f + ranks->rank());
    ranks->Sum(values);
    EXPECT_TRUE(at::equal(values, at::full({5}, 6.0, at::kDouble)));
    ranks->Broadcast(first);
    EXPECT_TRUE(at::equal(first, at::full({2, 2}, 7.0f)));
  });
}

/// Such a file is what ranks leave that are killed while they train: here a copy of it, and theirs have ended.
TEST(Ranks, WhatKilledOnesLeftInTheFileIsPassedOver) {
  const std::string path = Rendezvous("left"), left = path + ".copy";
  const auto train = [](int size, const std::string& file, const std::function<void()>& meanwhile) {
    std::vector<std::thread> threads;
    for (int rank = 0; rank < size; ++rank) {
      threads.emplace_back([=] {
        const auto ranks = JoinRanks({rank, size, file, true, {}});
        at::Tensor values = at::full({3}, rank + 1.0, at::kDouble);
        ranks->Sum(values);
        EXPECT_EQ(values[0].item<double>(), size * (size + 1) / 2.0);
        if (rank == 0) meanwhile();
        ranks->Sum(values);  // none ends before
      });
    }
    for (std::thread& thread : threads) thread.join();
  };
  train(3, path, [&] { std::filesystem::copy_file(path, left); });
  for (const int size : {3, 2, 3}) train(size, left, [] {});
  std::filesystem::remove(path), std::filesystem::remove(left);
}

/// The first moments are a tenth of the gradient after one step.
TEST(Ranks, GradientsOfTwoAreThoseOfTheDoubleBatch) {
  const AvatarPack pack = MakeSyntheticPack(7, 32, 4);
  for (const char* method : {"tna", "direct", "v2v"}) {
    for (const int64_t begin : {0, 3, 6}) {  // in the initialisation, and after it
      TensorFile start;
      {
        Trainer trainer(pack, TinyModel(method), TinyTraining(4), OneThread(3));
        trainer.Run(nullptr, nullptr, begin);
        start = trainer.Checkpoint();
        for (auto& [name, tensor] : start.tensors) {
          if (name.rfind("adam", 0) == 0) tensor = at::zeros_like(tensor);
        }
      }
      const auto step = [&](int batch, const std::shared_ptr<const Ranks>& ranks) {
        Trainer trainer(pack, start, "start", TinyTraining(batch), OneThread(3));
        if (ranks) trainer.Join(ranks);
        trainer.Run(nullptr, nullptr, begin + 1);
        return trainer.Checkpoint();
      };
      const TensorFile straight = step(4, nullptr);
      std::vector<TensorFile> files(2);
      WithRanks(2, "step", [&](const std::shared_ptr<const Ranks>& ranks) { files[ranks->rank()] = step(2, ranks); });
      for (const char* prefix : {"adam.first.", "adam_textures.first.", "adam_critic.first."})
        EXPECT_LT(Difference(straight, files[0], prefix, true), 1e-5) << method << " " << begin << " " << prefix;
      for (const auto& [name, tensor] : files[0].tensors) EXPECT_TRUE(at::equal(tensor, files[1].tensors.at(name))) << name;
    }
  }
}

/// Small steps: Adam makes a whole step of a gradient that is nothing but rounding, which large ones would let grow.
TEST(Ranks, WeightsOfTwoAreThoseOfTheDoubleBatch) {
  const AvatarPack pack = MakeSyntheticPack(7, 32, 4), validation = MakeSyntheticPack(2, 32, 9);
  const auto options = [](int batch) {
    TrainOptions o = TinyTraining(batch);
    o.learning_rate = 1e-5, o.texture_learning_rate = 1e-4;
    return o;
  };
  for (const char* method : {"tna", "v2v"}) {
    Trainer one(pack, TinyModel(method), options(4), OneThread(3));
    const TensorFile begin = one.Checkpoint();
    const TrainReport report = one.Run(&validation, nullptr);
    ASSERT_EQ(report.status, Status::kOk);
    std::vector<TensorFile> files(2);
    std::vector<TrainReport> reports(2);
    WithRanks(2, method, [&](const std::shared_ptr<const Ranks>& ranks) {
      Trainer trainer(pack, TinyModel(method), options(2), OneThread(3));
      trainer.Join(ranks);
      reports[ranks->rank()] = trainer.Run(&validation, nullptr);
      files[ranks->rank()] = trainer.Checkpoint();
    });
    const TensorFile straight = one.Checkpoint();
    for (const char* prefix : {"generator.", "textures", "critic."})
      EXPECT_LT(Difference(straight, files[0], prefix), 1e-5) << method << " " << prefix;
    EXPECT_GT(Difference(straight, begin, "generator."), 1e-3) << "they have moved a hundred times as far";
    ASSERT_EQ(reports[0].history.size(), report.history.size());
    for (size_t i = 0; i < report.history.size(); ++i) {
      for (size_t k = 0; k < kLossColumns.size(); ++k) {
        const double expected = report.history[i].values[k];
        EXPECT_NEAR(reports[0].history[i].values[k], expected, 1e-4 * (1 + expected)) << method << " " << kLossColumns[k];
        EXPECT_EQ(reports[0].history[i].values[k], reports[1].history[i].values[k]);
      }
    }
  }
}

TEST(Ranks, OneThatFailsOrIsStoppedEndsAll) {
  const AvatarPack pack = MakeSyntheticPack(6, 16, 4);
  WithRanks(2, "stop", [&](const std::shared_ptr<const Ranks>& ranks) {
    Trainer trainer(pack, TinyModel("tna"), TinyTraining(2), OneThread(3));
    trainer.Join(ranks);
    const TrainReport stopped =
        trainer.Run(nullptr, [&](int64_t step, const HistoryRow*) { return !(ranks->rank() == 1 && step == 3); });
    EXPECT_EQ(stopped.steps_done, 4) << "the others hear of it in the next step";
  });
  WithRanks(2, "nan", [&](const std::shared_ptr<const Ranks>& ranks) {
    Trainer trainer(pack, TinyModel("tna"), TinyTraining(2), OneThread(3));
    trainer.Join(ranks);
    trainer.Run(nullptr, nullptr, 2);
    {
      torch::NoGradGuard no_grad;
      if (ranks->rank() == 1) trainer.model().generator->parameters()[0].flatten()[0] = std::nan("");
    }
    const at::Tensor before = trainer.model().generator->parameters()[2].detach().clone();
    const TrainReport report = trainer.Run(nullptr, nullptr);
    EXPECT_EQ(report.status, Status::kNonFiniteInput);
    EXPECT_EQ(report.steps_done, 0);
    EXPECT_THAT(report.message, ::testing::HasSubstr("frame "));
    EXPECT_TRUE(at::equal(trainer.model().generator->parameters()[2], before));
  });
}

TEST(Ranks, ThoseThatDifferAndPlacesThatCannotBeAreRefused) {
  EXPECT_THROW(JoinRanks({2, 2, Rendezvous("x"), true, {}}), UsageError);
  EXPECT_THROW(JoinRanks({0, 2, "", true, {}}), UsageError);
  int calls = 0;
  RankPlace alone{1, 2, Rendezvous("alone"), true, [&] {
                    if (++calls == 3) throw CancelledError("enough");
                  }};
  EXPECT_THROW(JoinRanks(alone), CancelledError);
  std::filesystem::remove(alone.rendezvous);
  const AvatarPack pack = MakeSyntheticPack(6, 16, 4);
  WithRanks(2, "differ", [&](const std::shared_ptr<const Ranks>& ranks) {
    Trainer trainer(pack, TinyModel("tna"), TinyTraining(2 + ranks->rank()), OneThread(3));
    EXPECT_THROW(trainer.Join(ranks), UsageError);
  });
  WithRanks(2, "rates", [&](const std::shared_ptr<const Ranks>& ranks) {
    TrainOptions options = TinyTraining(2);
    options.learning_rate *= 1 + ranks->rank();
    Trainer trainer(pack, TinyModel("tna"), options, OneThread(3));
    const std::string text = mvstudio::testing::MessageOf<UsageError>([&] { trainer.Join(ranks); });
    EXPECT_THAT(text,
                ::testing::AllOf(::testing::HasSubstr("training options"), ::testing::Not(::testing::HasSubstr("pictures"))));
  });
  AvatarPack other = pack;
  other.images = pack.images.clone();
  other.images[3][1][8][8] += 1;
  WithRanks(2, "pictures", [&](const std::shared_ptr<const Ranks>& ranks) {
    Trainer trainer(ranks->rank() == 0 ? pack : other, TinyModel("tna"), TinyTraining(2), OneThread(3));
    EXPECT_THAT(mvstudio::testing::MessageOf<UsageError>([&] { trainer.Join(ranks); }),
                ::testing::HasSubstr("differ in pictures:"));
  });
}

TEST(Ranks, GoOnWithAsManyImagesAStepAsBefore) {
  const AvatarPack pack = MakeSyntheticPack(6, 16, 4);
  TensorFile file;
  WithRanks(2, "before", [&](const std::shared_ptr<const Ranks>& ranks) {
    Trainer trainer(pack, TinyModel("tna"), TinyTraining(2), OneThread(3));
    trainer.Join(ranks);
    trainer.Run(nullptr, nullptr, 5);
    if (ranks->rank() == 0) file = trainer.Checkpoint();
  });
  EXPECT_EQ(RanksFrom(file, "x"), 2);
  TrainOptions options = TrainOptionsFrom(file, "x");
  Trainer alone(pack, file, "x", options, OneThread(3));
  EXPECT_THAT(mvstudio::testing::MessageOf<UsageError>([&] { alone.Run(nullptr, nullptr); }),
              ::testing::HasSubstr("option 'ranks' as before, 2"));
  options.batch = 4;
  EXPECT_EQ(Trainer(pack, file, "x", options, OneThread(3)).Run(nullptr, nullptr).steps_done, 5) << "the same pictures";
}

}  // namespace
}  // namespace mvstudio::avatar
