#include "avatar/nets/transfer.h"

#include <ATen/ATen.h>

#include "avatar/maps/template_maps.h"
#include "avatar/train/train.h"
#include "core/error.h"
#include "tests/avatar/synthetic_pack.h"
#include "tests/support/test.h"

/// Networks that begin with the weights of another, of the same method or not.
namespace mvstudio::avatar {
namespace {

using ::testing::Contains;
using ::testing::UnorderedElementsAre;

ModelOptions Tiny(Method method, Prior prior = Prior::kNone) {
  ModelOptions o;
  o.method = method, o.prior = prior;
  o.width = 4, o.downs = 2, o.encoder_blocks = 1, o.decoder_blocks = 1;
  return o;
}

AvatarModel ModelOf(const ModelOptions& options, uint64_t seed = 7) { return MakeModel(options, 32, {-0.4, 0.5}, seed); }

at::Tensor Weight(const AvatarModel& model, const std::string& name) {
  return ModelToTensors(model).tensors.at("generator." + name);
}

TEST(StartFrom, TheSameMethodTakesEverything) {
  for (const Method method : {Method::kTna, Method::kDirect, Method::kV2v}) {
    const AvatarModel from = ModelOf(Tiny(method));
    const StartNetwork start = StartFrom(from, from.options, 32, 1);
    EXPECT_THAT(start.partly, IsEmpty());
    EXPECT_THAT(start.fresh, IsEmpty());
    EXPECT_TRUE(start.initialised);
    const auto a = from.generator->parameters(), b = start.model.generator->parameters();
    ASSERT_EQ(a.size(), b.size());
    for (size_t i = 0; i < a.size(); ++i) EXPECT_TRUE(at::equal(a[i], b[i])) << ToString(method) << " " << i;
    EXPECT_EQ(start.model.depth.near_m, -0.4);
  }
}

TEST(StartFrom, AnotherMethodTakesAllButTheHeads) {
  const AvatarModel tna = ModelOf(Tiny(Method::kTna));
  const StartNetwork start = StartFrom(tna, Tiny(Method::kDirect), 32, 1);
  EXPECT_THAT(start.fresh, UnorderedElementsAre("mask_decoder.head", "colour_decoder.head"));
  EXPECT_THAT(start.partly, IsEmpty());
  EXPECT_THAT(start.taken, Contains("stem.0"));
  EXPECT_THAT(start.taken, Contains("mask_decoder.ups.0.1"));
  EXPECT_TRUE(at::equal(Weight(start.model, "stem.0.weight"), Weight(tna, "stem.0.weight")));
  EXPECT_TRUE(at::equal(Weight(start.model, "mask_decoder.ups.1.1.weight"), Weight(tna, "part_decoder.ups.1.1.weight")));
  EXPECT_TRUE(at::equal(Weight(start.model, "colour_decoder.ups.1.1.weight"), Weight(tna, "uv_decoder.ups.1.1.weight")));
  EXPECT_FALSE(at::equal(Weight(start.model, "colour_decoder.ups.1.1.weight"), Weight(tna, "part_decoder.ups.1.1.weight")));
  EXPECT_TRUE(start.initialised) << "this method has no initialisation";
  EXPECT_FALSE(StartFrom(start.model, Tiny(Method::kTna), 32, 1).initialised) << "it has learned no parts";
}

TEST(StartFrom, InputChannelsThatTheOtherHasNotBeginAtZero) {
  const AvatarModel tna = ModelOf(Tiny(Method::kTna));
  const StartNetwork start = StartFrom(tna, Tiny(Method::kV2v), 32, 1);
  EXPECT_THAT(start.partly, UnorderedElementsAre("stem.0"));
  const at::Tensor stem = Weight(start.model, "stem.0.weight");
  const int64_t bones = tna.options.inputs;
  ASSERT_EQ(stem.size(1), bones + 3 * kNumPrevious);
  EXPECT_TRUE(at::equal(stem.narrow(1, 0, bones), Weight(tna, "stem.0.weight")));
  EXPECT_EQ(stem.narrow(1, bones, 3 * kNumPrevious).abs().max().item<float>(), 0);
}

TEST(StartFrom, ChannelsOfTheTemplateAndOfEarlierImagesAreNotMixedUp) {
  const AvatarModel direct = ModelOf(Tiny(Method::kDirect, Prior::kTemplate));
  ModelOptions to = Tiny(Method::kV2v, Prior::kTemplate);
  to.template_colours = false;
  const StartNetwork start = StartFrom(direct, to, 32, 1);
  const int64_t common = to.inputs + NumTemplateChannels(to);
  const at::Tensor stem = Weight(start.model, "stem.0.weight");
  ASSERT_EQ(NumTemplateChannels(direct.options), NumTemplateChannels(to) + 3);
  EXPECT_TRUE(at::equal(stem.narrow(1, 0, common), Weight(direct, "stem.0.weight").narrow(1, 0, common)));
  EXPECT_EQ(stem.slice(1, common).abs().max().item<float>(), 0);
  const StartNetwork back = StartFrom(start.model, direct.options, 32, 1);
  const at::Tensor colours = Weight(back.model, "stem.0.weight").slice(1, common);
  EXPECT_EQ(colours.abs().max().item<float>(), 0);
}

TEST(StartFrom, OtherSizesAreRefused) {
  ModelOptions wider = Tiny(Method::kTna);
  wider.width = 6;
  EXPECT_THROW(StartFrom(ModelOf(Tiny(Method::kTna)), wider, 32, 1), ContractViolation);
}

TEST(StartFrom, DirectTrainsFromPartsWithoutAnInitialisation) {
  const AvatarPack pack = MakeSyntheticPack(4, 32, 4);
  TrainOptions options;
  options.steps = 3, options.save_every = 100;
  Trainer trainer(pack, StartFrom(ModelOf(Tiny(Method::kTna)), Tiny(Method::kDirect), 32, 1), options, {nullptr, 1, 1});
  EXPECT_EQ(trainer.Run(nullptr, nullptr).steps_done, 3);
}

/// As the sets of a pretraining: what is drawn next does not depend on where the run was interrupted.
TEST(ReplaceImages, GoesOnAsAResumedRunDoes) {
  const AvatarPack first = MakeSyntheticPack(4, 32, 4), second = MakeSyntheticPack(4, 32, 5);
  TrainOptions options;
  options.steps = 0, options.init_steps = 4, options.batch = 2;
  const RunContext run{nullptr, 1, 1};
  Trainer whole(first, Tiny(Method::kTna), options, run);
  whole.Run(nullptr, nullptr, 2);
  const TensorFile half = whole.Checkpoint();
  whole.ReplaceImages(second);
  whole.Run(nullptr, nullptr);
  Trainer resumed(second, half, "half", options, run);
  resumed.Run(nullptr, nullptr);
  const TensorFile a = whole.Checkpoint(), b = resumed.Checkpoint();
  for (const auto& [name, tensor] : a.tensors) EXPECT_TRUE(at::equal(tensor, b.tensors.at(name))) << name;
  Trainer without(first, Tiny(Method::kTna), options, run);
  without.Run(nullptr, nullptr);
  EXPECT_FALSE(at::equal(without.Checkpoint().tensors.at("generator.stem.0.weight"), a.tensors.at("generator.stem.0.weight")));
  EXPECT_THROW(whole.ReplaceImages(MakeSyntheticPack(4, 16, 5)), ContractViolation);
  EXPECT_THROW(whole.ReplaceImages(MakeSyntheticPack(3, 32, 5)), ContractViolation);
}

}  // namespace
}  // namespace mvstudio::avatar
