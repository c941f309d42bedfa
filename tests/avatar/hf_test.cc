#include <ATen/ATen.h>

#include <cmath>

#include "avatar/maps/spread_labels.h"
#include "avatar/maps/texture.h"
#include "avatar/nets/neural_texture.h"
#include "avatar/nets/reference_renderer.h"
#include "avatar/train/train.h"
#include "core/error.h"
#include "tests/avatar/synthetic_pack.h"
#include "tests/support/message_of.h"
#include "tests/support/one_thread.h"
#include "tests/support/test.h"

/// Method `hf`: neural texture, renderer and training.
namespace mvstudio::avatar {
namespace {

constexpr int kSize = 32;

/// Bodies in colours that are not those of the images, and references that are.
AvatarPack Pack(int64_t count = 8) {
  AvatarPack pack = MakeSyntheticPack(count, kSize, 1, 0.05);
  at::Tensor part = pack.part.clone(), uv = pack.uv.clone();
  for (int64_t i = 0; i < pack.size(); ++i) SpreadLabels(kSize, nullptr, part[i].data_ptr<uint8_t>(), uv[i].data_ptr<float>());
  const at::Tensor cover = at::avg_pool2d((pack.part > 0).unsqueeze(1).to(at::kFloat), 3, 1, 1);
  pack.template_maps = at::cat({cover, part.unsqueeze(1).to(at::kFloat), uv}, 1).contiguous();
  pack.template_colours = (255 - pack.images).clone();
  const at::Tensor person = (pack.masks > 0).unsqueeze(1);
  pack.references = at::cat({pack.images * person, person.to(at::kByte) * 255}, 1).contiguous();
  return pack;
}

ModelOptions Tiny(int references = 2) {
  ModelOptions o;
  o.method = Method::kHf, o.prior = Prior::kTemplate;
  o.width = 4, o.downs = 2, o.texture_px = 8, o.neural_channels = 6, o.references = references;
  return o;
}

TrainOptions Steps(int steps) {
  TrainOptions o;
  o.steps = steps, o.batch = 2, o.report_every = 1, o.validate_images = 0;
  return o;
}

at::Tensor Colours(int64_t size) { return at::rand({24, 3, size, size}) * 2 - 1; }

TEST(SampleCharts, AgreesWithTheTexturesOfOtherMethods) {
  at::manual_seed(1);
  const at::Tensor texture = at::rand({24, 3, 8, 8}), part = at::randint(1, 25, {2, 5, 7}, at::kLong);
  const at::Tensor uv = at::rand({2, 2, 5, 7}) * 2.4 - 1.2;  // beyond the edges too
  const at::Tensor parts = at::one_hot(part - 1, 24).permute({0, 3, 1, 2}).to(at::kFloat);
  const at::Tensor sampled = SampleCharts(texture, parts, uv);
  const at::Tensor probability = at::cat({at::zeros({2, 1, 5, 7}), parts}, 1);
  const at::Tensor all_uv = at::cat({uv.slice(1, 0, 1).expand({2, 24, 5, 7}), uv.slice(1, 1, 2).expand({2, 24, 5, 7})}, 1);
  const at::Tensor expected = 2 * SampleTextures(texture, probability, all_uv, at::zeros({3})) - 1;  // to [-1, 1] again
  EXPECT_LT((sampled - expected).abs().max().item<float>(), 2e-5f) << "coordinates of 24 * 8 rows are rounded";
  EXPECT_EQ(SampleCharts(texture, at::zeros_like(parts), uv).count_nonzero().item<int64_t>(), 0);
}

TEST(ReferenceRenderer, OfThePapersSizeHasItsParameters) {
  // 25.6 million with references and 16.3 without in the authors' network, whose input has 16 channels and its output 3.
  ModelOptions o;
  o.method = Method::kHf, o.prior = Prior::kTemplate, o.width = 64, o.downs = 5, o.skips = false;
  EXPECT_NEAR(static_cast<double>(NumParameters(o)), 25.6e6, 0.1e6);
  o.references = 0;
  EXPECT_NEAR(static_cast<double>(NumParameters(o)), 16.3e6, 0.1e6);
}

TEST(ReferenceRenderer, TakesEverySizeThatItsStepsDivide) {
  for (const bool skips : {true, false})
    for (const int downs : {1, 2, 3})
      for (const int references : {0, 3}) {
        ModelOptions o = Tiny(references);
        o.downs = downs, o.skips = skips;
        ReferenceRenderer net(o);
        const at::Tensor out = net->forward(at::rand({2, NumRendererChannels(o), 16, 24}));
        EXPECT_EQ(out.sizes(), at::IntArrayRef({2, 4, 16, 24})) << skips << downs << references;
      }
  const ModelOptions o = Tiny();
  AvatarModel model = MakeModel(o, kSize, {-0.5, 0.5}, 1);
  EXPECT_THROW(model.generator->forward(at::zeros({1, NumRendererChannels(o), 30, 32})), ContractViolation);
}

TEST(Hf, BeginsAsTheFittedBody) {
  const AvatarPack pack = Pack();
  ModelOptions direct = Tiny();
  direct.method = Method::kDirect, direct.encoder_blocks = direct.decoder_blocks = 1;
  AvatarModel body = MakeModel(direct, kSize, {-0.5, 0.5}, 1), hf = MakeModel(Tiny(), kSize, {-0.5, 0.5}, 1);
  const Rendering a = Render(body, PosesOf(pack), kSize, kSize), b = Render(hf, PosesOf(pack), kSize, kSize);
  EXPECT_TRUE(a.image.equal(b.image));
  EXPECT_TRUE(a.mask_prob.equal(b.mask_prob));
  const at::Tensor image = pack.template_colours.to(at::kFloat) / 255 * pack.template_maps.slice(1, 0, 1);
  EXPECT_LT((b.image - image).abs().max().item<float>(), 1e-5f);
  hf.generator->train();
  const at::Tensor maps = NetworkInput(hf, pack.joints_in_cam, pack.joint_valid, {}, kSize, kSize, PosesOf(pack).body);
  const auto [mask, colour] = Predict(hf, maps);  // now through all layers
  EXPECT_LT((CleanImage(hf, mask, colour, at::zeros({3})) - image).abs().max().item<float>(), 1e-5f);
}

TEST(Hf, GradientsReachTheLearnedChannelsAndNeverTheColours) {
  const AvatarPack pack = Pack(4);
  AvatarModel model = MakeModel(Tiny(), kSize, {-0.5, 0.5}, 1);
  SetBodyTextures(model, Colours(8));
  for (at::Tensor& weight : model.generator->parameters()) weight.data().add_(0.1 * at::randn_like(weight));
  const at::Tensor maps = NetworkInput(model, pack.joints_in_cam, pack.joint_valid, {}, kSize, kSize, PosesOf(pack).body);
  const auto [mask, colour] = Predict(model, maps);
  (mask.square().sum() + colour.square().sum()).backward();
  ASSERT_TRUE(model.learned.grad().defined());
  EXPECT_GT(model.learned.grad().abs().sum().item<float>(), 0);
  EXPECT_FALSE(model.textures.requires_grad());
  EXPECT_FALSE(model.textures.grad().defined());
  // Parts that no pixel shows get none: the synthetic people have kNumBones parts.
  EXPECT_EQ(model.learned.grad().slice(0, kNumBones).count_nonzero().item<int64_t>(), 0);
}

TEST(Hf, TrainingLeavesTheColoursAsTheyAre) {
  const AvatarPack pack = Pack();
  Trainer trainer(pack, Tiny(), Steps(30), OneThread());
  const at::Tensor colours = Colours(8);
  trainer.SetBodyTextures(colours);
  const TrainReport report = trainer.Run(nullptr, {});
  ASSERT_EQ(report.status, Status::kOk);
  EXPECT_TRUE(trainer.model().textures.equal(colours));
  EXPECT_GT(trainer.model().learned.detach().abs().max().item<float>(), 1e-3f);
  EXPECT_LT(report.history.back()["l1"], 0.8 * report.history.front()["l1"]);
}

TEST(Hf, TheReferencesCarryWhatTheBodyLacks) {
  // The body's colours are the images' negatives: with references the network copies, without it must learn each.
  const auto l1_of = [](int references) {
    Trainer trainer(Pack(), Tiny(references), Steps(60), OneThread());
    return trainer.Run(nullptr, {}).history.back()["l1"];
  };
  const double with = l1_of(2), without = l1_of(0);
  EXPECT_LT(with, without);
}

TEST(Hf, ResumesToTheSameBytes) {
  const AvatarPack pack = Pack();
  const auto fresh = [&] {
    Trainer trainer(pack, Tiny(), Steps(6), OneThread());
    at::manual_seed(3);
    trainer.SetBodyTextures(Colours(8));
    return trainer;
  };
  Trainer whole = fresh(), first = fresh();
  whole.Run(nullptr, {});
  first.Run(nullptr, {}, 3);
  const TensorFile half = first.Checkpoint();
  Trainer second(pack, half, "half", Steps(6), OneThread());
  second.Run(nullptr, {});
  const TensorFile a = whole.Checkpoint(), b = second.Checkpoint();
  ASSERT_EQ(a.tensors.size(), b.tensors.size());
  for (const auto& [name, tensor] : a.tensors) EXPECT_TRUE(tensor.equal(b.tensors.at(name))) << name;
  EXPECT_EQ(a.metadata, b.metadata);
  EXPECT_TRUE(a.tensors.count("neural_textures") && a.tensors.count("adam_textures.first.neural_textures"));
}

TEST(Hf, CheckpointsComeBackAndDamagedOnesAreRefused) {
  AvatarModel model = MakeModel(Tiny(), kSize, {-0.5, 0.5}, 1);
  SetBodyTextures(model, Colours(16));
  EXPECT_EQ(model.textures.size(2), 8) << "resampled";
  model.learned.data().normal_();
  const TensorFile good = ModelToTensors(model);
  const AvatarModel back = ModelFromTensors(good, "file");
  EXPECT_TRUE(back.learned.equal(model.learned) && back.textures.equal(model.textures));
  EXPECT_EQ(back.options.references, 2);
  const auto refusal = [&](const std::string& name, const at::Tensor& value) {
    TensorFile bad = good;
    bad.tensors[name] = value;
    return MessageOf<FormatError>([&] { ModelFromTensors(bad, "file"); });
  };
  EXPECT_THAT(refusal("neural_textures", at::zeros({24, 2, 8, 8})), HasSubstr("neural_textures"));
  EXPECT_THAT(refusal("neural_textures", at::full({24, 3, 8, 8}, std::nan(""))), HasSubstr("not finite"));
  TensorFile bad = good;
  bad.tensors.erase("neural_textures");
  EXPECT_THAT(MessageOf<FormatError>([&] { ModelFromTensors(bad, "file"); }), HasSubstr("neural_textures"));
  bad = good, bad.metadata["model.references"] = "-3";
  EXPECT_THAT(MessageOf<FormatError>([&] { ModelFromTensors(bad, "file"); }), HasSubstr("references"));
}

TEST(Hf, ANetworkThatAddsTooLittleIsLeftOut) {
  AvatarPack pack = Pack();
  pack.template_colours = pack.images.clone();  // nothing is left to learn
  pack.template_maps.select(1, 0).copy_(pack.masks.to(at::kFloat) / 255);
  TrainOptions options = Steps(4);
  options.validate_images = 2, options.save_every = 4, options.least_gain = 0.01;
  Trainer trainer(pack, Tiny(), options, OneThread());
  const TrainReport report = trainer.Run(&pack, {});
  EXPECT_TRUE(std::isfinite(report.gain));
  EXPECT_TRUE(report.network_off);
  AvatarModel handed = ModelFromTensors(trainer.Checkpoint(), "file");
  const Rendering r = Render(handed, PosesOf(pack), kSize, kSize);
  const at::Tensor body = pack.images.to(at::kFloat) / 255 * pack.template_maps.slice(1, 0, 1);
  EXPECT_LT((r.image - body).abs().max().item<float>(), 1e-5f);
}

TEST(Hf, TheRendererMovesToAnotherPersonWithoutTheTexture) {
  Trainer first(Pack(), Tiny(), Steps(5), OneThread());
  first.Run(nullptr, {});
  ModelOptions wanted = Tiny();
  wanted.texture_px = 12, wanted.references = 3;
  const StartNetwork start = StartFrom(first.model(), wanted, kSize, 9);
  EXPECT_TRUE(start.fresh.empty() && start.partly.empty());
  EXPECT_EQ(start.model.learned.count_nonzero().item<int64_t>(), 0);
  EXPECT_EQ(start.model.learned.size(2), 12);
  const auto weights = first.model().generator->named_parameters();
  for (const auto& item : start.model.generator->named_parameters())
    EXPECT_TRUE(item.value().equal(weights[item.key()])) << item.key();
}

TEST(Hf, PeopleInTurnsTrainOneRendererWithTexturesOfTheirOwn) {
  AvatarPack other = Pack();
  other.images = other.images.flip(1).contiguous();
  std::vector<Trainer> people;
  people.emplace_back(Pack(), Tiny(), Steps(4), OneThread());
  people.emplace_back(other, Tiny(), Steps(4), OneThread());
  for (int64_t step = 0; step < 8; ++step) {
    Trainer& own = people[static_cast<size_t>(step % 2)];
    if (step > 0) own.TakeNetwork(people[static_cast<size_t>((step + 1) % 2)]);
    ASSERT_EQ(own.Run(nullptr, {}, own.model().step + 1).status, Status::kOk);
  }
  EXPECT_EQ(people[0].model().generator.ptr(), people[1].model().generator.ptr());
  EXPECT_EQ(people[1].Checkpoint().metadata.at("adam.step"), "8") << "moments of all steps";
  EXPECT_EQ(people[1].Checkpoint().metadata.at("adam_textures.step"), "4");
  EXPECT_FALSE(people[0].model().learned.equal(people[1].model().learned));
  // One person alone in turns is a training as any other.
  std::vector<Trainer> same;
  for (int i = 0; i < 2; ++i) same.emplace_back(Pack(), Tiny(), Steps(3), OneThread());
  same[0].Run(nullptr, {});
  for (int i = 0; i < 3; ++i) same[1].Run(nullptr, {}, same[1].model().step + 1);
  EXPECT_TRUE(same[0].model().learned.equal(same[1].model().learned));
  ModelOptions wider = Tiny();
  wider.width = 5;
  Trainer of_other_size(Pack(), wider, Steps(1), OneThread());
  EXPECT_THROW(of_other_size.TakeNetwork(people[0]), ContractViolation);
}

TEST(Hf, WhatItNeedsIsAskedFor) {
  AvatarPack pack = Pack();
  pack.references = at::Tensor();
  EXPECT_THAT(MessageOf<UsageError>([&] { Trainer(pack, Tiny(), Steps(1), OneThread()); }), HasSubstr("references"));
  EXPECT_NO_THROW(Trainer(pack, Tiny(0), Steps(1), OneThread()));
  ModelOptions o = Tiny();
  o.prior = Prior::kNone;
  EXPECT_THROW(Validate(o), UsageError);
  o = Tiny(), o.neural_channels = 3;
  EXPECT_THAT(MessageOf<UsageError>([&] { Validate(o); }), HasSubstr("neural-channels"));
  o = Tiny(), o.references = 33;
  EXPECT_THROW(Validate(o), UsageError);
}

}  // namespace
}  // namespace mvstudio::avatar
