#include <filesystem>

#include "avatar/body/body_template.h"
#include "avatar/train/train.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "stages/nets/avatar_pretrain.h"
#include "tests/avatar/panoptic_fixture.h"
#include "tests/support/folder_state.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

/// A pretraining in its folder: kept, continued, replaced.
namespace mvstudio::stages {
namespace {

namespace fs = std::filesystem;

PretrainInput Input() {
  PretrainInput input;
  input.sources.templates.push_back(body::MakeMannequin(1.75, 0.4));
  input.templates = {"mannequin"};
  avatar::MotionClip clip;
  for (int i = 0; i < 10; ++i) {
    dataset::Coco19Pose pose;
    pose.x_in_world = body::PosedCoco19(input.sources.templates[0], avatar::SwingPose(input.sources.templates[0], 0.1 * i));
    pose.valid.fill(true);
    clip.frames.push_back(i), clip.poses.push_back(pose);
  }
  HoldOutBlocks(&clip);
  input.sources.clips.push_back(clip);
  input.motions.push_back({"swing", true, clip.frames, 1, 10, 2});
  return input;
}

PretrainOptions Tiny(int steps) {
  PretrainOptions o;
  o.model.width = 4, o.model.downs = 2, o.model.encoder_blocks = o.model.decoder_blocks = 1;
  o.sample.size_px = 32;
  o.samples = 3, o.scored = 4;  // three become four, two steps of two
  o.train.init_steps = steps, o.train.save_every = 100;
  return o;
}

/// Cancels after some advances.
class Canceller : public ProgressSink {
 public:
  explicit Canceller(int after) : left_(after) {}
  void Advance(int64_t, const std::string&) override { --left_; }
  bool Cancelled() const override { return left_ <= 0; }

 private:
  int left_;
};

avatar::TensorFile Weights(const std::string& folder) { return avatar::ReadTensorFile(folder + "/checkpoint.safetensors"); }

TEST(AvatarPretrain, IsKeptContinuedAndReplacedOnlyWhenAsked) {
  const TempDir folder;
  const std::string out = folder / "net", other = folder / "other";
  const PretrainInput input = Input();
  Canceller cancel(3);
  EXPECT_THROW(Pretrain(input, Tiny(7), out, false, false, {&cancel, 1, 1}), CancelledError);
  EXPECT_TRUE(fs::exists(out + "/checkpoint.safetensors"));
  Put(out + "/notes.txt", "mine");
  const CommandResult rest = Pretrain(input, Tiny(7), out, false, false, {nullptr, 1, 1});
  EXPECT_EQ(rest.metrics["steps"], 7);
  EXPECT_EQ(rest.metrics["cached"], false);
  const CommandResult whole = Pretrain(input, Tiny(7), other, false, false, {nullptr, 1, 1});
  const avatar::TensorFile a = Weights(out), b = Weights(other);
  for (const auto& [name, tensor] : a.tensors) EXPECT_TRUE(at::equal(tensor, b.tensors.at(name))) << name;
  EXPECT_EQ(rest.metrics["scores"], whole.metrics["scores"]);
  EXPECT_EQ(whole.metrics["scores"]["held_out"]["samples"], 4);

  const auto before = fs::last_write_time(out + "/checkpoint.safetensors");
  const CommandResult again = Pretrain(input, Tiny(7), out, false, false, {nullptr, 1, 1});
  EXPECT_EQ(again.metrics["cached"], true);
  EXPECT_EQ(again.metrics["scores"], whole.metrics["scores"]);
  EXPECT_EQ(ReadFile(out + "/pretrain.json"), ReadFile(other + "/pretrain.json")) << "no times, no threads";
  EXPECT_EQ(fs::last_write_time(out + "/checkpoint.safetensors"), before);
  EXPECT_THAT(MessageOf<UsageError>([&] {
                Pretrain(input, Tiny(8), out, false, false, {nullptr, 1, 1});
              }),
              HasSubstr("with other arguments"));
  EXPECT_THROW(Pretrain(input, Tiny(7), out, false, false, {nullptr, 1, 2}), UsageError) << "another seed";
  EXPECT_EQ(Pretrain(input, Tiny(2), out, true, false, {nullptr, 1, 1}).metrics["steps"], 2);
  EXPECT_EQ(ReadFile(out + "/notes.txt"), "mine");
}

TEST(AvatarPretrain, ItsFolderIsNotATrainedAvatars) {
  const TempDir folder;
  const std::string out = folder / "run";
  WriteFileAtomic(out + "/checkpoint.safetensors", std::string("weights"));
  EXPECT_THAT(MessageOf<UsageError>([&] {
                Pretrain(Input(), Tiny(2), out, false, false, {nullptr, 1, 1});
              }),
              HasSubstr("holds a trained avatar"));
  WriteFileAtomic(out + "/pretrain.json", std::string("{\"schema\": 3}"));
  EXPECT_THROW(Pretrain(Input(), Tiny(2), out, false, false, {nullptr, 1, 1}), FormatError);
  WriteFileAtomic(out + "/pretrain.json",
                  std::string(R"({"schema": "mvstudio.avatar-pretraining/1", "arguments_sha256": "", "finished": true})"));
  EXPECT_THROW(Pretrain(Input(), Tiny(2), out, false, false, {nullptr, 1, 1}), FormatError) << "no result";
}

TEST(AvatarPretrain, LearnsPartsOfPosesThatItHasNotSeen) {
  const TempDir folder;
  PretrainOptions options = Tiny(300);
  options.samples = 64, options.scored = 24;
  options.model.width = 8, options.train.learning_rate = 3e-3;
  const PretrainInput input = Input();
  const auto score = [&](int steps) {
    options.train.init_steps = steps;
    return Pretrain(input, options, folder / std::to_string(steps), false, false, {nullptr, 1, 1})
        .metrics["scores"]["held_out"];
  };
  const auto first = score(1), later = score(300);
  EXPECT_GT(later["part_accuracy"].get<double>(), first["part_accuracy"].get<double>() + 0.1);
  EXPECT_GT(later["mask_iou"].get<double>(), 0.6);
}

TEST(AvatarPretrain, OptionsOfOtherTrainingsAreNotItsOwn) {
  std::vector<std::string> names;
  const PretrainOptions options;
  VisitConstFields([&](const std::string& name, const auto&, const std::string&) { names.push_back(name); }, options);
  for (const char* used : {"steps", "samples", "size", "width", "batch", "learning-rate", "weight-part"})
    EXPECT_EQ(std::count(names.begin(), names.end(), used), 1) << used;
  for (const char* unused : {"method", "prior", "weight-l1", "init-steps", "patience", "texture-px"})
    EXPECT_EQ(std::count(names.begin(), names.end(), unused), 0) << unused;
  PretrainOptions bad = Tiny(0);
  EXPECT_THAT(MessageOf<UsageError>([&] { Validate(bad); }), HasSubstr("option 'steps'"));
  bad = Tiny(1), bad.samples = 0;
  EXPECT_THAT(MessageOf<UsageError>([&] { Validate(bad); }), HasSubstr("option 'samples'"));
}

TEST(PretrainInput, PosesOfDatasetsWithFrames) {
  const TempDir folder;
  avatar::WriteMannequinDataset(folder / "data", 1, 6, 32);
  const PretrainInput input = ReadPretrainInput("", (folder / "data") + ":0-1+4," + (folder / "data"), "mannequin", 19);
  ASSERT_EQ(input.motions.size(), 2u);
  EXPECT_EQ(input.motions[0].frames, (std::vector<int>{0, 1, 4}));
  EXPECT_EQ(input.motions[1].poses, 6);
  EXPECT_EQ(input.motions[1].held_out, 1);
  EXPECT_EQ(ToJson(input.motions, folder / "net", true)[0]["path"], "../data");
  EXPECT_EQ(ToJson(input.motions, folder / "net", false)[0]["frames"], "0-1,4");
  PretrainInput other = input;
  other.sources.clips[0].poses[0].x_in_world(0, 0) += 1e-9;
  EXPECT_NE(DigestOf(other.sources), DigestOf(input.sources));
  const auto read = [&](const std::string& motion, const std::string& poses) {
    return ReadPretrainInput(motion, poses, "mannequin", 19);
  };
  EXPECT_THAT(MessageOf<UsageError>([&] { read("", ""); }), HasSubstr("option 'motion'"));
  EXPECT_THAT(MessageOf<UsageError>([&] { read("", (folder / "data") + ":"); }), HasSubstr("no frames behind the colon"));
  EXPECT_THAT(MessageOf<UsageError>([&] { read("", (folder / "data") + ":x"); }), HasSubstr("is not a frame number"));
  EXPECT_THAT(MessageOf<IoError>([&] { read(folder / "data", ""); }), HasSubstr("no .bvh file"));
}

TEST(SeenPoses, AreToldOfHeldOutFramesAlone) {
  const TempDir folder;
  fs::create_directories(folder / "data");
  Put(folder / "net/pretrain.json",
      R"({"sources": [{"kind": "dataset", "path": "../data", "frames": "0-9,20"}, {"kind": "animation", "path": "../data", "frames": "50"}]})");
  avatar::RunConfig config;
  config.dataset = folder / "data";
  config.split.holdout_frames = {8, 9, 10, 50}, config.split.validation_frames = {20};
  const auto notice = SeenPoses(folder / "net", config);
  ASSERT_TRUE(notice.has_value());
  EXPECT_THAT(notice->text, HasSubstr("8-9,20"));
  config.split.holdout_frames = {10}, config.split.validation_frames.clear();
  EXPECT_FALSE(SeenPoses(folder / "net", config).has_value());
  EXPECT_FALSE(SeenPoses(folder / "another", config).has_value());
  Put(folder / "net/pretrain.json", R"({"sources": [{"kind": "dataset", "path": "../data", "frames": "x"}]})");
  EXPECT_THROW(SeenPoses(folder / "net", config), FormatError);
}

}  // namespace
}  // namespace mvstudio::stages
