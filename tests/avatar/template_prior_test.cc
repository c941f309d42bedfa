#include <ATen/ATen.h>

#include <cmath>

#include "avatar/maps/spread_labels.h"
#include "avatar/maps/template_maps.h"
#include "avatar/nets/sequence.h"
#include "avatar/train/batch.h"
#include "avatar/train/train.h"
#include "core/error.h"
#include "tests/avatar/synthetic_pack.h"
#include "tests/support/message_of.h"
#include "tests/support/one_thread.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::avatar {
namespace {

constexpr int kSize = 32;

/// Raw template maps that agree with the pack's labels.
at::Tensor MapsOf(const AvatarPack& pack) {
  at::Tensor part = pack.part.clone(), uv = pack.uv.clone();
  for (int64_t i = 0; i < pack.size(); ++i) SpreadLabels(kSize, nullptr, part[i].data_ptr<uint8_t>(), uv[i].data_ptr<float>());
  return at::cat({(pack.part > 0).unsqueeze(1).to(at::kFloat), part.unsqueeze(1).to(at::kFloat), uv}, 1).contiguous();
}

AvatarPack Pack(int64_t count = 8) {
  AvatarPack pack = MakeSyntheticPack(count, kSize, 1, 0.05);
  pack.template_maps = MapsOf(pack);
  // Smooth borders, and colours of the body that are not those of the images.
  pack.template_maps.select(1, 0).copy_(at::avg_pool2d(pack.template_maps.slice(1, 0, 1), 3, 1, 1).squeeze(1));
  pack.template_colours = (255 - pack.images).clone();
  return pack;
}

/// The template's image on black: (n, 3, H, W).
at::Tensor BodyImages(const AvatarPack& pack) {
  return pack.template_colours.to(at::kFloat) / 255 * pack.template_maps.slice(1, 0, 1);
}

ModelOptions Tiny(const std::string& method) {
  ModelOptions o;
  FromString(method, &o.method);
  o.prior = Prior::kTemplate;
  o.width = 4, o.downs = 2, o.encoder_blocks = o.decoder_blocks = 1, o.texture_px = 16, o.bone_half_width_px = 16;
  return o;
}

TrainOptions Steps(int steps) {
  TrainOptions o;
  o.steps = steps, o.batch = 2, o.report_every = 1, o.validate_images = 0, o.critic_width = 2, o.critic_layers = 1,
  o.critic_scales = 1;
  return o;
}

Rendering RenderRow(AvatarModel& model, const AvatarPack& pack, int64_t row) {
  return Render(model, PosesOf(Select(pack, {row})), kSize, kSize);
}

TEST(TemplateChannels, HoldCoverCoordinatesAndOneOfTheParts) {
  at::Tensor raw = at::zeros({1, 4, 1, 3});
  raw[0][0][0][0] = 1, raw[0][1][0][0] = 24, raw[0][2][0][0] = 0.25, raw[0][3][0][0] = 1;
  raw[0][0][0][1] = 0.5, raw[0][1][0][1] = 1, raw[0][2][0][1] = 0.5, raw[0][3][0][1] = 0;
  const at::Tensor c = TemplateChannels(raw);
  ASSERT_EQ(c.sizes(), at::IntArrayRef({1, 27, 1, 3}));
  EXPECT_EQ(c[0][1][0][0].item<float>(), -0.5f);
  EXPECT_EQ(c[0][2][0][0].item<float>(), 1);
  EXPECT_EQ(c[0][2][0][1].item<float>(), -1);
  EXPECT_EQ(c[0][26][0][0].item<float>(), 1) << "part 24";
  EXPECT_EQ(c[0][3][0][1].item<float>(), 1) << "part 1";
  EXPECT_TRUE(at::equal(c.slice(1, 3).sum(1), at::tensor({1.f, 1.f, 0.f}).view({1, 1, 3})));
  EXPECT_EQ(c.select(3, 2).abs().sum().item<float>(), 0) << "no template, nothing known";
}

TEST(TemplateChannels, TheAnswerOfANetworkThatSaysNothingHasTheClosedForm) {
  at::Tensor raw = at::zeros({1, 4, 1, 1});
  raw[0][0] = 0.7, raw[0][1] = 5, raw[0][2] = 0.8, raw[0][3] = 0.1;
  at::Tensor logits = at::zeros({1, 25, 1, 1}), uv = at::zeros({1, 48, 1, 1});
  AddTemplate(Tiny("tna"), TemplateChannels(raw), &logits, &uv);
  const at::Tensor prob = at::softmax(logits, 1).flatten();
  EXPECT_NEAR(prob[0].item<double>(), 0.3, 1e-6) << "the parts share the cover";
  EXPECT_NEAR(prob[5].item<double>(), 0.7 / (1 + 23 * std::exp(-12.0)), 1e-6);
  EXPECT_NEAR(uv[0][4].item<double>(), 0.6, 1e-6);
  EXPECT_NEAR(uv[0][24 + 4].item<double>(), -0.8, 1e-6);
  EXPECT_EQ(uv.count_nonzero().item<int64_t>(), 2);
  ModelOptions fast = Tiny("tna");
  fast.spread_parts = false;
  logits.zero_(), uv = at::zeros({1, 48, 1, 1});
  AddTemplate(fast, TemplateChannels(raw), &logits, &uv);
  const at::Tensor held = at::softmax(logits, 1).flatten();
  const double person = 0.7 / 0.3, others = 23 * std::exp(-8.0), total = 1 + person + others;
  EXPECT_NEAR(held[0].item<double>(), 1 / total, 1e-6);
  EXPECT_NEAR(held[5].item<double>(), person / total, 1e-6);
  EXPECT_NEAR(CoordinatesOf(fast, uv)[0][4].item<double>(), 0.6, 1e-6);
  at::Tensor mask = at::zeros({1, 1, 1, 1}), colour = at::zeros({1, 3, 1, 1});
  ModelOptions direct = Tiny("direct");
  const at::Tensor colours = at::tensor({0.0f, 0.4f, 1.0f}).view({1, 3, 1, 1});
  AddTemplate(direct, TemplateChannels(raw, colours), &mask, &colour);
  EXPECT_NEAR(CleanAlpha(at::sigmoid(mask)).item<double>(), 0.7, 1e-6);
  EXPECT_TRUE(at::equal(colour, colours));
  direct.template_colours = false;
  mask.zero_(), colour.zero_();
  AddTemplate(direct, TemplateChannels(raw), &mask, &colour);
  EXPECT_NEAR(at::sigmoid(mask).item<double>(), 0.7, 1e-6);
  EXPECT_EQ(colour.count_nonzero().item<int64_t>(), 0);
}

/// A row of 96 px: part 2 up to pixel 39, part 7 from there on.
at::Tensor TwoParts() {
  at::Tensor raw = at::ones({1, 4, 1, 96});
  raw.select(1, 1).fill_(7).slice(2, 0, 40).fill_(2);
  raw.select(1, 2).copy_(at::arange(96).view({1, 1, 96}) / 96.0);
  return raw;
}

TEST(TemplateChannels, APartBesideTheVisibleOneHasTheCoordinatesOfItsNearestPixelAndFallsWithItsDistance) {
  at::Tensor logits = at::zeros({1, 25, 1, 96}), uv = at::zeros({1, 48, 1, 96});
  AddTemplate(Tiny("tna"), TemplateChannels(TwoParts()), &logits, &uv);
  const auto beside = [&](int x, int part, int visible) {
    return (logits[0][part][0][x] - logits[0][visible][0][x]).item<float>();
  };
  EXPECT_NEAR(beside(38, 7, 2), -1 - 3 * 2, 1e-4);
  EXPECT_NEAR(beside(40, 2, 7), -1 - 3, 1e-4);
  EXPECT_NEAR(beside(60, 2, 7), -12, 1e-4) << "far away";
  EXPECT_NEAR(uv[0][1][0][60].item<double>(), 2 * 39 / 96.0 - 1, 1e-6);
  EXPECT_NEAR(uv[0][6][0][60].item<double>(), 2 * 60 / 96.0 - 1, 1e-6);
  EXPECT_EQ(uv[0][10].count_nonzero().item<int64_t>(), 0) << "a part that is nowhere";
}

TEST(TemplateChannels, ANetworkMovesCoordinatesAtTheChartsEdgeAsFarAsInItsMiddle) {
  at::Tensor raw = at::ones({1, 4, 1, 3}), logits = at::zeros({1, 25, 1, 3});
  raw.select(1, 2).copy_(at::tensor({0.0f, 0.5f, 1.0f}).view({1, 1, 3}));
  const at::Tensor output = at::zeros({1, 48, 1, 3}).requires_grad_();
  at::Tensor uv = output;
  AddTemplate(Tiny("tna"), TemplateChannels(raw), &logits, &uv);
  uv.sum().backward();
  EXPECT_TRUE(at::equal(output.grad(), at::ones_like(output)));
}

TEST(TemplateChannels, BlackAndWhiteAreCorrectedAsEasilyAsGrey) {
  at::Tensor raw = at::ones({1, 4, 1, 3}), mask = at::zeros({1, 1, 1, 3});
  const at::Tensor colours = at::tensor({0.0f, 0.5f, 1.0f}).view({1, 1, 1, 3}).expand({1, 3, 1, 3});
  const at::Tensor output = at::zeros({1, 3, 1, 3}).requires_grad_();
  at::Tensor colour = output;
  AddTemplate(Tiny("direct"), TemplateChannels(raw, colours), &mask, &colour);
  colour.sum().backward();
  EXPECT_TRUE(at::equal(output.grad(), at::ones_like(output)));
}

TEST(SpreadLabels, TakesTheNearestLabelAndKeepsToTheMask) {
  std::vector<uint8_t> part(25, 0), masked(25, 0), mask(25, 255);
  std::vector<float> uv(50, 0.f), masked_uv(50, 0.f);
  part[0] = masked[0] = 3, uv[0] = masked_uv[0] = 0.25f, uv[25] = masked_uv[25] = 0.75f;
  part[24] = masked[24] = 7;
  for (int x = 0; x < 5; ++x) mask[2 * 5 + x] = 0;  // the middle row is outside
  mask[24] = 0;
  SpreadLabels(5, nullptr, part.data(), uv.data());
  SpreadLabels(5, mask.data(), masked.data(), masked_uv.data());
  for (int y = 0; y < 5; ++y) {
    for (int x = 0; x < 5; ++x) {
      const int p = 5 * y + x;
      EXPECT_TRUE(part[p] == (x + y <= 4 ? 3 : 7) || (x + y == 4 && part[p] == 7)) << x << ", " << y;
      EXPECT_EQ(masked[p], y < 2 ? 3 : 0) << x << ", " << y;
      EXPECT_EQ(masked_uv[25 + p], y < 2 ? 0.75f : 0.f);
    }
  }
  std::vector<uint8_t> none(25, 0);
  SpreadLabels(5, nullptr, none.data(), uv.data());
  EXPECT_EQ(none, std::vector<uint8_t>(25, 0)) << "nothing to spread";
}

TEST(TemplatePrior, WithoutAStepTheAvatarIsTheTemplateInAveragedColours) {
  const AvatarPack pack = Pack();
  Trainer trainer(pack, Tiny("tna"), Steps(0), OneThread());
  const TrainReport report = trainer.Run(nullptr, {});
  EXPECT_EQ(report.steps_done, 0);
  for (int64_t row = 0; row < pack.size(); ++row) {
    const Rendering r = RenderRow(trainer.model(), pack, row);
    const at::Tensor cover = pack.template_maps[row][0], person = (cover == 1).to(at::kFloat);
    EXPECT_TRUE(at::equal(r.part[0].masked_select(cover == 1), pack.part[row].masked_select(cover == 1))) << row;
    EXPECT_LT(((r.uv[0] - pack.uv[row]) * person).abs().max().item<double>(), 1e-5);
    EXPECT_TRUE(at::equal(r.mask_prob[0] > 0.5, cover > 0.5));
    const at::Tensor truth = pack.images[row].to(at::kFloat) / 255;
    EXPECT_LT(((r.image[0] - truth).abs().mean(0) * person).sum().item<double>() / person.sum().item<double>(), 0.02)
        << "colours depend on part and coordinates alone";
  }
}

TEST(TemplatePrior, ANetworkThatAddsTooLittleIsLeftOut) {
  const AvatarPack pack = Pack(), validation = Pack(4);
  for (const char* method : {"tna", "direct"}) {
    TrainOptions options = Steps(6);
    options.validate_images = 4, options.least_gain = 0;
    Trainer kept(pack, Tiny(method), options, OneThread());
    EXPECT_TRUE(std::isnan(kept.Run(&validation, {}).gain)) << method;
    options.least_gain = 1;
    Trainer judged(pack, Tiny(method), options, OneThread());
    const TrainReport report = judged.Run(&validation, {});
    EXPECT_TRUE(std::isfinite(report.gain) && report.network_off) << method;
    Trainer start(pack, Tiny(method), Steps(0), OneThread());
    start.Run(nullptr, {});
    const TensorFile file = judged.Checkpoint();
    AvatarModel handed = ModelFromTensors(file, "file");
    EXPECT_TRUE(at::equal(RenderRow(handed, pack, 1).image, RenderRow(start.model(), pack, 1).image)) << method;
    for (const auto& [name, tensor] : ModelToTensors(kept.model()).tensors) {  // training went on as without a judge
      const auto live = file.tensors.find("live." + name);
      EXPECT_TRUE(at::equal(live == file.tensors.end() ? file.tensors.at(name) : live->second, tensor)) << name;
    }
    Trainer again(pack, file, "file", options, OneThread());
    EXPECT_TRUE(again.Run(&validation, {}).network_off) << "resumed at its end";
  }
}

TEST(TemplatePrior, ANetworkThatWasNotTrainedIsNotRun) {
  const ModelOptions options = Tiny("tna");
  Generator generator(options, 1);
  generator->eval();
  const at::Tensor maps = at::rand({2, options.inputs + NumTemplateChannels(options), 16, 24});
  const auto [first, second] = generator->forward(maps);  // recorded, so run
  const at::NoGradGuard no_gradients;
  const auto [quick_first, quick_second] = generator->forward(maps);
  EXPECT_TRUE(at::equal(first, quick_first));
  EXPECT_TRUE(at::equal(second, quick_second));
  for (at::Tensor& parameter : generator->parameters()) parameter.data().fill_(0.1);
  EXPECT_GT(generator->forward(maps).first.abs().max().item<double>(), 0);
}

TEST(TemplatePrior, DirectBeginsAtTheBodyInItsColours) {
  const AvatarPack pack = Pack();
  for (const char* method : {"direct", "v2v"}) {
    Trainer trainer(pack, Tiny(method), Steps(0), OneThread());
    const RenderedPack rendered = RenderPack(trainer.model(), pack, 3);  // v2v: with its past
    EXPECT_LT((rendered.images - BodyImages(pack)).abs().max().item<double>(), 1e-6) << method;
    EXPECT_LT((CleanAlpha(rendered.masks) - pack.template_maps.select(1, 0)).abs().max().item<double>(), 1e-6) << method;
  }
}

TEST(TemplatePrior, WithoutColoursDirectBeginsWithTheTemplatesOutline) {
  AvatarPack pack = Pack();
  pack.template_maps = MapsOf(pack), pack.template_colours = at::Tensor();
  for (const char* method : {"direct", "v2v"}) {
    ModelOptions options = Tiny(method);
    EXPECT_THAT(MessageOf<UsageError>([&] { Trainer(pack, options, Steps(0), OneThread()); }),
                AllOf(HasSubstr("option 'template-colours'"), HasSubstr("option 'fit'")));
    options.template_colours = false;
    Trainer trainer(pack, options, Steps(0), OneThread());
    const Rendering r = RenderRow(trainer.model(), pack, 0);
    EXPECT_LT((CleanAlpha(r.mask_prob[0]) - (pack.part[0] > 0).to(at::kFloat)).abs().max().item<double>(), 1e-6) << method;
  }
}

TEST(TemplatePrior, CheckpointsThatDoNotSayAreOfNetworksThatLearnedTheColours) {
  const AvatarPack pack = Pack();
  ModelOptions options = Tiny("direct");
  options.template_colours = false;
  AvatarModel older = MakeModel(options, kSize, {-0.5, 0.5}, 1);
  TensorFile file = ModelToTensors(older);
  ASSERT_EQ(file.metadata.erase("model.template-colours"), 1u);
  AvatarModel read = ModelFromTensors(file, "older");
  EXPECT_FALSE(read.options.template_colours);
  EXPECT_TRUE(at::equal(RenderRow(read, pack, 0).image, RenderRow(older, pack, 0).image));
  EXPECT_TRUE(
      ModelFromTensors(ModelToTensors(MakeModel(Tiny("direct"), kSize, {-0.5, 0.5}, 1)), "new").options.template_colours);
}

TEST(TemplatePrior, DirectImprovesOnTheColoursOfTheBody) {
  const AvatarPack pack = Pack();
  ModelOptions options = Tiny("direct");
  options.width = 8;
  TrainOptions training = Steps(40);
  training.learning_rate = 3e-3;
  Trainer trainer(pack, options, training, OneThread());
  const TrainReport report = trainer.Run(nullptr, {});
  EXPECT_LT(report.history.back()["l1"], 0.7 * report.history.front()["l1"]);
}

class TemplatePriorMethods : public ::testing::TestWithParam<const char*> {};

TEST_P(TemplatePriorMethods, TrainsAndResumesBitExactly) {
  const AvatarPack pack = Pack();
  Trainer straight(pack, Tiny(GetParam()), Steps(6), OneThread());
  const TrainReport report = straight.Run(nullptr, {});
  ASSERT_EQ(report.steps_done, 6);
  EXPECT_EQ(report.history.front().phase, "train") << "there is no initialisation unless asked for";
  Trainer first(pack, Tiny(GetParam()), Steps(6), OneThread());
  first.Run(nullptr, {}, 3);
  const TensorFile half = first.Checkpoint();
  Trainer second(pack, half, "half", TrainOptionsFrom(half, "half"), OneThread());
  second.Run(nullptr, {});
  const TensorFile a = straight.Checkpoint(), b = second.Checkpoint();
  ASSERT_EQ(a.tensors.size(), b.tensors.size());
  for (const auto& [name, tensor] : a.tensors) EXPECT_TRUE(at::equal(tensor, b.tensors.at(name))) << name;
  EXPECT_EQ(a.metadata.at("model.prior"), "template");
}
INSTANTIATE_TEST_SUITE_P(All, TemplatePriorMethods, ::testing::Values("tna", "direct", "v2v"));

TEST(TemplatePrior, TrainingImprovesOnTheTemplate) {
  AvatarPack pack = Pack();
  // A template that is too thin: the network has to learn the rest.
  pack.template_maps.select(1, 0).copy_(-at::max_pool2d(-pack.template_maps.slice(1, 0, 1), 3, 1, 1).squeeze(1));
  ModelOptions options = Tiny("tna");
  options.width = 8;
  TrainOptions training = Steps(40);
  training.learning_rate = 3e-3, training.jitter_scale = training.jitter_shift = training.jitter_roll_deg = 0;
  Trainer trainer(pack, options, training, OneThread());
  const TrainReport report = trainer.Run(nullptr, {});
  EXPECT_LT(report.history.back()["mask"], 0.5 * report.history.front()["mask"]);
}

TEST(TemplatePrior, TheMapsMoveWithTheImages) {
  AvatarPack pack = Pack();
  pack.template_maps = MapsOf(pack);
  pack.template_colours = pack.images.clone();
  AvatarModel direct = MakeModel(Tiny("direct"), kSize, {-0.5, 0.5}, 1);
  AvatarModel model = MakeModel(Tiny("tna"), kSize, {-0.5, 0.5}, 1);
  TrainOptions options;
  options.jitter_scale = 0.2, options.jitter_shift = 0.1, options.jitter_roll_deg = 20;
  const TrainBatch still = MakeBatch(pack, model, options, {0, 1, 2}, false, 1, 0);
  const TrainBatch moved = MakeBatch(pack, model, options, {0, 1, 2}, true, 1, 0);
  EXPECT_FALSE(at::equal(still.part, moved.part));
  for (const TrainBatch* batch : {&still, &moved}) {
    const at::Tensor channels = batch->maps.slice(1, 36), parts = channels.slice(1, 3).argmax(1) + 1;
    const at::Tensor person = batch->part > 0;
    EXPECT_TRUE(at::equal(parts.masked_select(person), batch->part.masked_select(person)));
    const at::Tensor uv = (channels.slice(1, 1, 3) - batch->uv) * person.unsqueeze(1);
    EXPECT_LT(uv.abs().max().item<double>(), 1e-6);
    EXPECT_LT((channels.select(1, 0) - batch->mask).abs().max().item<double>(), 1e-6) << "both moved as smooth quantities";
  }
  const TrainBatch coloured = MakeBatch(pack, direct, options, {0, 1, 2}, true, 1, 0);
  const at::Tensor same = (coloured.maps.slice(1, 36 + 27) - coloured.image).abs() < 1e-6;
  EXPECT_GT(same.to(at::kFloat).mean().item<double>(), 0.97) << "colours go on beyond the edge";
}

TEST(TemplatePrior, WhatDoesNotFitIsSaid) {
  const AvatarPack with = Pack();
  AvatarPack without = with, small = with;
  without.template_maps = at::Tensor();
  small.template_maps = at::zeros({with.size(), 4, 16, 16});
  ModelOptions bones = Tiny("tna");
  bones.prior = Prior::kNone;
  const auto message = [](const AvatarPack& pack, const ModelOptions& options) {
    return MessageOf<UsageError>([&] { Trainer(pack, options, Steps(1), OneThread()); });
  };
  EXPECT_THAT(message(without, Tiny("tna")), AllOf(HasSubstr("option 'prior' template needs"), HasSubstr("template maps")));
  EXPECT_THAT(message(small, Tiny("tna")), HasSubstr("option 'prior' template needs"));
  EXPECT_THAT(message(with, bones), HasSubstr("option 'prior' none takes no"));
  AvatarModel model = MakeModel(Tiny("tna"), kSize, {-0.5, 0.5}, 1);
  EXPECT_THROW(Render(model, PosesOf(without), kSize, kSize), ContractViolation);
  bones.prior = Prior::kAuto;
  EXPECT_THAT(MessageOf<UsageError>([&] { Validate(bones); }), HasSubstr("option 'prior' must be none or template"));
  EXPECT_THAT(MessageOf<UsageError>([&] { FromString("all", &bones.prior); }), HasSubstr("must be none or template"));
}

TEST(TemplatePrior, PacksKeepTheMapsAndRefuseBadOnes) {
  mvstudio::testing::TempDir folder;
  AvatarPack pack = Pack(3);
  SavePack(pack, folder.path() + "/pack.safetensors");
  EXPECT_TRUE(at::equal(LoadPack(folder.path() + "/pack.safetensors").template_maps, pack.template_maps));
  EXPECT_TRUE(at::equal(Select(pack, {2, 0}).template_maps[0], pack.template_maps[2]));
  AvatarPack other = pack;
  other.template_maps = at::zeros({3, 4, 16, 16});  // a network of another size than the images that are compared
  EXPECT_NO_THROW(Validate(other));
  for (const auto& [channel, value, what] : {std::tuple<int, double, const char*>{0, 1.5, "cover"},
                                             {1, 25, "part"},
                                             {1, 2.5, "part"},
                                             {2, std::nan(""), "coordinate"}}) {
    other.template_maps = pack.template_maps.clone();
    other.template_maps[1][channel][0][0] = value;
    EXPECT_THAT(MessageOf<ContractViolation>([&] { Validate(other); }), AllOf(HasSubstr("camera cam_01"), HasSubstr(what)));
  }
  other.template_maps = at::zeros({3, 3, 32, 32});
  EXPECT_THROW(Validate(other), ContractViolation);
}

}  // namespace
}  // namespace mvstudio::avatar
