#include <ATen/ATen.h>

#include <filesystem>

#include "avatar/nets/sequence.h"
#include "avatar/run/pack/frame_runs.h"
#include "avatar/run/pack/iuv.h"
#include "avatar/run/pack/run_config.h"
#include "avatar/run/pack/split_side.h"
#include "avatar/run/pack/training_set.h"
#include "core/error.h"
#include "tests/avatar/panoptic_fixture.h"
#include "tests/support/message_of.h"
#include "tests/support/test.h"

namespace mvstudio::avatar {
namespace {

class TrainingSetTest : public ::testing::Test {
 protected:
  TrainingSetTest() : folder_("training_set") {
    WriteMannequinDataset(folder_.path(), 4, 6, 160);
    data_ = dataset::OpenPanopticDataset(folder_.path());
  }
  TemporaryFolder folder_;
  dataset::PanopticDataset data_;
};

TEST_F(TrainingSetTest, CropsHaveTheTemplateOnThePerson) {
  TrainingSetOptions options;
  options.size_px = 96;
  options.fit_shape = false;
  const TrainingSet result = BuildTrainingSet(data_, options, {});
  const AvatarPack& pack = result.pack;
  Validate(pack);
  ASSERT_EQ(pack.size(), 24);
  EXPECT_EQ(result.person, 0);
  EXPECT_TRUE(result.skipped.empty());
  EXPECT_GT(result.template_iou, 0.93) << "the same body rendered at another resolution";
  // Colours are 10 x part, 255 u, 255 v of the same body: they must agree with the maps away from chart borders.
  const at::Tensor part = pack.part.to(at::kFloat).unsqueeze(1);
  const at::Tensor inner =
      at::max_pool2d(part, 3, 1, 1).eq(part).logical_and((-at::max_pool2d(-part, 3, 1, 1)).eq(part)).squeeze(1);
  const at::Tensor person = pack.masks.gt(0).logical_and(pack.part > 0).logical_and(inner);
  const at::Tensor same =
      (pack.images.select(1, 0).to(at::kFloat) / 10).round().eq(pack.part.to(at::kFloat)).logical_and(person);
  EXPECT_GT(same.sum().item<double>() / person.sum().item<double>(), 0.85);
  const at::Tensor du = (pack.images.select(1, 1).to(at::kFloat) / 255 - pack.uv.select(1, 0)).abs().masked_select(same);
  EXPECT_LT(du.median().item<double>(), 0.05);
}

TEST_F(TrainingSetTest, TemplateMapsAreTheTemplateWithSmoothBorders) {
  TrainingSetOptions options;
  options.size_px = 96, options.fit_shape = false, options.template_input_px = 96;
  const AvatarPack pack = BuildTrainingSet(data_, options, {}).pack;
  Validate(pack);
  const at::Tensor cover = pack.template_maps.select(1, 0), part = pack.template_maps.select(1, 1);
  const at::Tensor labelled = pack.part > 0, inner = cover == 1;
  EXPECT_NEAR(cover.sum().item<double>() / labelled.sum().item<double>(), 1, 0.01) << "the same area";
  EXPECT_TRUE(inner.logical_or(cover == 0).logical_or((cover > 0).logical_and(cover < 1)).all().item<bool>());
  EXPECT_GT((cover > 0).logical_and(cover < 1).sum().item<int64_t>(), 50 * pack.size()) << "borders are smooth";
  const at::Tensor both = inner.logical_and(labelled);
  const at::Tensor same = (part == pack.part.to(at::kFloat)).logical_and(both);
  EXPECT_GT(same.sum().item<double>() / both.sum().item<double>(), 0.93) << "parts differ along their borders alone";
  const at::Tensor du = (pack.template_maps.select(1, 2) - pack.uv.select(1, 0)).abs().masked_select(same);
  EXPECT_LT(du.median().item<double>(), 0.01);
  EXPECT_GT(part.min().item<float>(), 0) << "labels go on outside the person";
  // In another size than the images', and nothing of it without the option.
  options.template_input_px = 32, options.template_maps = false;
  const AvatarPack small = BuildTrainingSet(data_, options, {}).pack;
  EXPECT_EQ(small.template_maps.sizes(), at::IntArrayRef({pack.size(), 4, 32, 32}));
  EXPECT_NEAR(9 * small.template_maps.select(1, 0).sum().item<double>() / cover.sum().item<double>(), 1, 0.01);
  EXPECT_EQ(small.part.sum().item<int64_t>(), 0);
  options.template_input_px = 0;
  EXPECT_FALSE(BuildTrainingSet(data_, options, {}).pack.template_maps.defined());
}

TEST_F(TrainingSetTest, TheFittedBodysColoursAndCoverAreItsImage) {
  body::TexturedPerson person;
  person.person.body = body::MakeMannequin(1.75, 0.5);
  person.textures = body::MannequinTextures(16, 1);
  TrainingSetOptions options;
  options.size_px = 64, options.template_input_px = 64, options.template_colours = true;
  options.cameras = {"00_00", "00_02"}, options.frames = {1, 4};
  options.fitted = std::make_shared<const body::TexturedPerson>(person);
  const AvatarPack pack = BuildTrainingSet(data_, options, {}).pack;
  Validate(pack);
  const at::Tensor shown = pack.template_colours.to(at::kFloat) * pack.template_maps.slice(1, 0, 1);
  const at::Tensor image = pack.body_images.slice(1, 0, 3).to(at::kFloat);
  EXPECT_LE((shown - image).abs().max().item<double>(), 1.01) << "two roundings";
  EXPECT_GT(image.max().item<double>() - image.min().item<double>(), 100);
  const at::Tensor beyond = at::logical_and(pack.template_maps.select(1, 0) == 0,
                                            at::max_pool2d(pack.template_maps.slice(1, 0, 1), 3, 1, 1).squeeze(1) > 0);
  EXPECT_GT(pack.template_colours.sum(1, false, at::kInt).masked_select(beyond).min().item<int>(), 0)
      << "colours go on outside";
  options.template_input_px = 32;  // an evaluation at another size than the network's
  EXPECT_EQ(BuildTrainingSet(data_, options, {}).pack.template_colours.sizes(), at::IntArrayRef({4, 3, 32, 32}));
  options.template_colours = false;
  EXPECT_FALSE(BuildTrainingSet(data_, options, {}).pack.template_colours.defined());
}

TEST_F(TrainingSetTest, JointsProjectOntoThePersonAndKeepTheirLengths) {
  TrainingSetOptions options;
  options.size_px = 96;
  options.template_maps = false;
  const AvatarPack pack = BuildTrainingSet(data_, options, {}).pack;
  EXPECT_EQ(pack.part.sum().item<int64_t>(), 0);
  for (int64_t i = 0; i < pack.size(); ++i) {
    const at::Tensor x = pack.joints_in_cam[i];
    const at::Tensor px =
        x.slice(1, 0, 2) / x.slice(1, 2, 3) * pack.intrinsics[i].slice(0, 0, 2) + pack.intrinsics[i].slice(0, 2, 4);
    for (const int j : {0, 2, 6, 12, 7, 13}) {  // neck, body centre, hips, knees: inside the body
      const int64_t u = std::lround(px[j][0].item<double>()), v = std::lround(px[j][1].item<double>());
      EXPECT_EQ(pack.masks[i][v][u].item<int>(), 255) << ImageName(pack, i) << ", joint " << j;
    }
    const dataset::Coco19Pose& pose = data_.poses.at(static_cast<int>(pack.frame[i].item<int64_t>())).at(0);
    EXPECT_NEAR((x[7] - x[6]).norm().item<double>(), (pose.x_in_world.col(7) - pose.x_in_world.col(6)).norm(), 1e-5);
  }
}

TEST_F(TrainingSetTest, AMetreHasOneSizeInAllCrops) {
  TrainingSetOptions options;
  options.size_px = 64;
  options.template_maps = false;
  const TrainingSet result = BuildTrainingSet(data_, options, {});
  for (int64_t i = 0; i < result.pack.size(); ++i) {
    const double depth = result.pack.joints_in_cam[i][2][2].item<double>();
    const double px_per_m = result.pack.intrinsics[i][0].item<double>() / depth;
    EXPECT_NEAR(px_per_m, options.fill * 32 / result.half_extent_m, 0.12 * px_per_m);
  }
}

TEST_F(TrainingSetTest, SplitsAndRefusesWhatIsNotThere) {
  const DatasetSplit split = SplitDataset(data_, -1, {"00_02"}, {4, 5});
  EXPECT_THAT(split.train_cameras, ElementsAre("00_00", "00_01", "00_03"));
  EXPECT_THAT(split.holdout_cameras, ElementsAre("00_02"));
  EXPECT_THAT(split.train_frames, ElementsAre(0, 1, 2, 3));
  EXPECT_THAT(split.holdout_frames, ElementsAre(4, 5));
  const DatasetSplit few = SplitDataset(data_, -1, {"00_02"}, {4, 5}, {"00_00", "00_03"});
  EXPECT_EQ(few.train_cameras, (std::vector<std::string>{"00_00", "00_03"}));
  EXPECT_EQ(few.holdout_cameras, split.holdout_cameras);
  EXPECT_THAT(MessageOf<UsageError>([&] { SplitDataset(data_, -1, {"00_02"}, {}, {"00_02"}); }), HasSubstr("held out"));
  EXPECT_THAT(MessageOf<UsageError>([&] { SplitDataset(data_, -1, {"00_09"}, {}); }),
              AllOf(HasSubstr("'00_09'"), HasSubstr("00_03")));
  EXPECT_THAT(MessageOf<UsageError>([&] { SplitDataset(data_, -1, {}, {80}); }),
              AllOf(HasSubstr("frame 80"), HasSubstr("0 to 5")));
  EXPECT_THAT(MessageOf<UsageError>([&] { SplitDataset(data_, -1, {}, {0, 1, 2, 3, 4, 5}); }), HasSubstr("every frame"));
  EXPECT_THAT(MessageOf<UsageError>([&] {
                SplitDataset(data_, -1, {"00_00", "00_01", "00_02", "00_03"}, {});
              }),
              HasSubstr("every camera"));
  EXPECT_THAT(MessageOf<UsageError>([&] { ChoosePerson(data_, 7); }), HasSubstr("person 7"));
}

TEST_F(TrainingSetTest, MissingImagesAndMasksAreLeftOutAndCounted) {
  TrainingSetOptions options;
  options.size_px = 64;
  options.fit_shape = false;
  const TrainingSet whole = BuildTrainingSet(data_, options, {});
  EXPECT_EQ(whole.missing.missing(), 0);
  std::filesystem::remove(data_.MaskPath("00_01", 3));
  for (const int frame : {1, 2, 4, 5}) std::filesystem::remove(data_.ImagePath("00_02", frame));
  const TrainingSet sparse = BuildTrainingSet(data_, options, {});
  EXPECT_TRUE(sparse.skipped.empty());
  EXPECT_EQ(sparse.missing.asked(), 24);
  EXPECT_THAT(sparse.missing.by_camera.at("00_01").no_mask, ElementsAre(3));
  EXPECT_THAT(sparse.missing.by_camera.at("00_02").no_image, ElementsAre(1, 2, 4, 5));
  std::vector<int64_t> kept;
  for (int64_t i = 0; i < whole.pack.size(); ++i) {
    const std::string& camera = whole.pack.cameras[whole.pack.camera_idx[i].item<int64_t>()];
    if (!sparse.missing.Has(camera, whole.pack.frame[i].item<int>())) kept.push_back(i);
  }
  const AvatarPack rest = Select(whole.pack, kept);
  ASSERT_EQ(sparse.pack.size(), 19);
  EXPECT_EQ(sparse.pack.cameras, rest.cameras);
  EXPECT_EQ(sparse.half_extent_m, whole.half_extent_m);
  for (const auto tensor : {&AvatarPack::images, &AvatarPack::masks, &AvatarPack::joints_in_cam, &AvatarPack::intrinsics,
                            &AvatarPack::part, &AvatarPack::uv, &AvatarPack::camera_idx, &AvatarPack::frame})
    EXPECT_TRUE(at::equal(sparse.pack.*tensor, rest.*tensor));
}

TEST_F(TrainingSetTest, WithoutAnyImageItSaysWhatIsMissing) {
  for (int frame = 0; frame < 6; ++frame) std::filesystem::remove(data_.ImagePath("00_02", frame));
  TrainingSetOptions options;
  options.size_px = 64, options.template_maps = false;
  options.cameras = {"00_02"};
  EXPECT_THAT(MessageOf<FormatError>([&] { BuildTrainingSet(data_, options, {}); }), HasSubstr("00_02: 6 of 6"));
}

TEST_F(TrainingSetTest, RefusesSidesWithTooFewImages) {
  const DatasetSplit split = SplitDataset(data_, 0, {"00_03"}, {4, 5});
  EXPECT_EQ(TrainingSide(split).frames, split.train_frames);
  EXPECT_EQ(HoldoutSide(split).kind, "held-out cameras in held-out frames");
  EXPECT_EQ(RequireImages(data_, TrainingSide(split), kMostMissing).missing(), 0);
  const auto refused = [&](const SplitSide& side) {
    return MessageOf<FormatError>([&] { RequireImages(data_, side, side.kind[0] == 't' ? kMostMissing : 1); });
  };
  std::filesystem::remove(data_.ImagePath("00_03", 4));
  EXPECT_EQ(RequireImages(data_, HoldoutSide(split)).missing(), 1);
  EXPECT_EQ(FramesWithImages(data_, HoldoutSide(split)), std::vector<int>({5}));
  std::filesystem::remove(data_.MaskPath("00_03", 5));
  EXPECT_THAT(refused(HoldoutSide(split)), AllOf(HasSubstr("held-out cameras"), HasSubstr("no image with a mask is left")));
  for (const int frame : {0, 1}) {
    for (const char* camera : {"00_00", "00_01", "00_02"}) std::filesystem::remove(data_.ImagePath(camera, frame));
  }
  EXPECT_EQ(RequireImages(data_, TrainingSide(split), kMostMissing).missing(), 6) << "half of 12";
  std::filesystem::remove(data_.ImagePath("00_01", 2));
  EXPECT_THAT(refused(TrainingSide(split)), AllOf(HasSubstr("more than half"), HasSubstr("00_01: 3 of 4")));
  std::filesystem::remove(data_.ImagePath("00_01", 3));
  EXPECT_THAT(refused(TrainingSide(split)), HasSubstr("camera 00_01: leave it out"));
}

TEST_F(TrainingSetTest, TimeStepsWithoutThePersonAreOnNeitherSide) {
  data_.poses.at(2).clear();                           // an empty scene
  data_.poses.at(5) = {{7, data_.poses.at(5).at(0)}};  // somebody else
  const DatasetSplit split = SplitDataset(data_, 0, {"00_02"}, {4, 5});
  EXPECT_THAT(split.train_frames, ElementsAre(0, 1, 3));
  EXPECT_THAT(split.holdout_frames, ElementsAre(4));
  EXPECT_EQ(FramesWithout(data_, 0), 2);
  EXPECT_EQ(FramesOfPerson(data_, 0), std::vector<int>({0, 1, 3, 4}));
  EXPECT_THAT(MessageOf<UsageError>([&] { SplitDataset(data_, 0, {"00_02"}, {2, 5}); }), HasSubstr("in none of the frames"));
  TrainingSetOptions options;
  options.size_px = 64, options.template_maps = false;
  options.cameras = {"00_00"}, options.person = 0;
  const AvatarPack pack = BuildTrainingSet(data_, options, {}).pack;
  EXPECT_EQ(pack.size(), 4);
  EXPECT_EQ(PreviousRows(pack), (std::vector<int64_t>{-1, 0, -1, 2})) << "frame 2 is not bridged";
}

TEST_F(TrainingSetTest, AHardCutAndMissingFramesAreNotBridged) {
  for (int frame = 3; frame < 6; ++frame) data_.poses.at(frame).at(0).x_in_world.row(0).array() += 0.7;  // still in view
  EXPECT_EQ(CutsOf(data_, 0), std::vector<int>({3}));
  TrainingSetOptions options;
  options.size_px = 64, options.template_maps = false;
  options.cameras = {"00_00"};
  for (int frame = 3; frame < 6; ++frame)  // the person of the images did not move: any mask will do
    dataset::WriteImage(Image(160, 160, 1, 255), data_.MaskPath("00_00", frame));
  const AvatarPack pack = BuildTrainingSet(data_, options, {}).pack;
  ASSERT_EQ(pack.size(), 6);
  EXPECT_EQ(pack.cuts, std::vector<int64_t>({3}));
  EXPECT_EQ(PreviousRows(pack), (std::vector<int64_t>{-1, 0, 1, -1, 3, 4}));
  for (const int frame : {1, 2, 4}) std::filesystem::remove(data_.ImagePath("00_00", frame));
  const AvatarPack sparse = BuildTrainingSet(data_, options, {}).pack;
  EXPECT_EQ(sparse.frame_step, 1) << "of the frames that were asked for, not of the rows 0, 3, 5";
  EXPECT_EQ(PreviousRows(sparse), (std::vector<int64_t>{-1, -1, -1}));
  const std::string path = folder_.path() + "/pack.safetensors";
  SavePack(pack, path);
  EXPECT_EQ(LoadPack(path).cuts, pack.cuts);
  EXPECT_EQ(LoadPack(path).frame_step, 1);
}

TEST_F(TrainingSetTest, AnImageOfAnotherSizeIsNamed) {
  dataset::WriteImage(Image(80, 160, 3), data_.ImagePath("00_02", 1));
  TrainingSetOptions options;
  options.size_px = 64;
  options.template_maps = false;
  EXPECT_THAT(MessageOf<FormatError>([&] { BuildTrainingSet(data_, options, {}); }),
              AllOf(HasSubstr("camera 00_02, frame 1"), HasSubstr("80x160")));
}

TEST_F(TrainingSetTest, AnEmptyMaskIsSkippedAndReported) {
  dataset::WriteImage(Image(160, 160, 1), data_.MaskPath("00_02", 1));
  TrainingSetOptions options;
  options.size_px = 64;
  options.template_maps = false;
  const TrainingSet result = BuildTrainingSet(data_, options, {});
  EXPECT_EQ(result.pack.size(), 23);
  ASSERT_EQ(result.skipped.size(), 1u);
  EXPECT_THAT(result.skipped[0], AllOf(HasSubstr("camera 00_02, frame 1"), HasSubstr("mask is empty")));
}

TEST_F(TrainingSetTest, DoesNotDependOnTheNumberOfThreads) {
  TrainingSetOptions options;
  options.size_px = 64;
  options.fit_images = 4;
  RunContext one, three;
  one.num_threads = 1, three.num_threads = 3;
  const TrainingSet a = BuildTrainingSet(data_, options, one), b = BuildTrainingSet(data_, options, three);
  EXPECT_TRUE(at::equal(a.pack.images, b.pack.images));
  EXPECT_TRUE(at::equal(a.pack.uv, b.pack.uv));
  EXPECT_EQ(a.shape.girth, b.shape.girth);
}

/// The fixture's images hold part and coordinates as colours: turned into DensePose's files, they must give the template's
/// maps.
TEST_F(TrainingSetTest, DensePoseMapsReplaceTheTemplate) {
  const std::string folder = folder_.path() + "/iuv";
  for (const auto& camera : data_.rig.cameras) {
    for (int frame = 0; frame < 6; ++frame) {
      const std::string& name = camera.camera.name;
      const Image image = dataset::ReadImage(data_.ImagePath(name, frame)),
                  mask = dataset::ReadImage(data_.MaskPath(name, frame));
      Image iuv(image.width, image.height, 3);
      for (size_t i = 0; i < iuv.pixels.size(); i += 3) {
        if (mask.pixels[i] == 0) continue;
        const uint8_t part = image.pixels[i] / 10, u = image.pixels[i + 1], v = image.pixels[i + 2];
        const bool blue_first = name != "00_01";  // both orders of channels
        iuv.pixels[i] = blue_first ? v : part, iuv.pixels[i + 1] = u, iuv.pixels[i + 2] = blue_first ? part : v;
      }
      if (frame < 5 || name != "00_02") dataset::WriteImage(iuv, IuvPath(folder, name, data_.ImagePath(name, frame)));
    }
  }
  TrainingSetOptions options;
  options.size_px = 96, options.fit_shape = false;
  const TrainingSet posed = BuildTrainingSet(data_, options, {});
  options.iuv = folder;
  const TrainingSet labelled = BuildTrainingSet(data_, options, {});
  EXPECT_THAT(labelled.skipped, ElementsAre(AllOf(HasSubstr("camera 00_02, frame 5"), HasSubstr("no IUV map"))));
  ASSERT_EQ(labelled.pack.size(), posed.pack.size() - 1);
  EXPECT_GT(labelled.template_iou, 0.97) << "they are cut from the same mask";
  const at::Tensor kept = (posed.pack.camera_idx != 2).logical_or(posed.pack.frame != 5).nonzero().squeeze(1);
  const at::Tensor part = posed.pack.part.index_select(0, kept), uv = posed.pack.uv.index_select(0, kept);
  const at::Tensor person = (part > 0).logical_and(labelled.pack.part > 0),
                   same = part.eq(labelled.pack.part).logical_and(person);
  EXPECT_GT(same.sum().item<double>() / person.sum().item<double>(), 0.9);
  const at::Tensor difference = (labelled.pack.uv - uv).abs().amax(1).masked_select(same);
  EXPECT_LT(difference.median().item<double>(), 0.05);

  const std::string first = IuvPath(folder, "00_00", data_.ImagePath("00_00", 0));
  dataset::WriteImage(Image(160, 160, 3, 90), first);
  EXPECT_THAT(MessageOf<FormatError>([&] { BuildTrainingSet(data_, options, {}); }),
              AllOf(HasSubstr(first), HasSubstr("parts 0 to 24")));
  dataset::WriteImage(Image(80, 80, 3, 0), first);
  EXPECT_THAT(MessageOf<FormatError>([&] { BuildTrainingSet(data_, options, {}); }), HasSubstr("80x80"));
}

TEST(RunConfig, SurvivesARoundTrip) {
  const TemporaryFolder folder("run_config");
  RunConfig config;
  config.dataset = "/data/a b";
  config.pack.size_px = 96, config.pack.fill = 0.9, config.pack.person = 3;
  config.half_extent_m = 1.2345678901234567;
  config.shape.girth = {1.1, 0.9, 1.3, 1};
  config.template_iou = 0.83;
  config.split = {{"00_00"}, {"00_01"}, {1, 2}, {3}, {"00_02"}, {4, 5}};
  config.pack.iuv = "/data/iuv";
  const std::string path = folder.path() + "/config.json";
  WriteRunConfig(config, path);
  const RunConfig read = ReadRunConfig(path);
  EXPECT_EQ(read.dataset, config.dataset);
  EXPECT_EQ(read.half_extent_m, config.half_extent_m);
  EXPECT_EQ(read.pack.half_extent_m, config.half_extent_m);
  EXPECT_EQ(read.shape.girth, config.shape.girth);
  EXPECT_EQ(read.split.holdout_cameras, config.split.holdout_cameras);
  EXPECT_EQ(read.split.holdout_frames, config.split.holdout_frames);
  EXPECT_EQ(read.split.validation_cameras, config.split.validation_cameras);
  EXPECT_EQ(read.split.validation_frames, config.split.validation_frames);
  EXPECT_EQ(read.pack.iuv, config.pack.iuv);
  EXPECT_EQ(read.pack.frames, config.split.train_frames);
  EXPECT_EQ(read.pack.size_px, 96);
  EXPECT_EQ(read.template_iou, 0.83);
}

TEST(RunConfig, DamagedFilesAreNamedWithTheirPlace) {
  const TemporaryFolder folder("run_config_bad");
  const std::string path = folder.path() + "/config.json";
  RunConfig config;
  config.half_extent_m = 1;
  config.split = {{"00_00"}, {}, {1}, {}, {}, {}};
  WriteRunConfig(config, path);
  const std::string good = ReadFile(path);
  WriteFileAtomic(path, good.substr(0, good.size() / 2));
  EXPECT_THAT(MessageOf<FormatError>([&] { ReadRunConfig(path); }), HasSubstr(path));
  std::string bad = good;
  bad.replace(bad.find("\"fill\": 0.97"), 12, "\"fill\": \"no\"");
  WriteFileAtomic(path, bad);
  EXPECT_THAT(MessageOf<FormatError>([&] { ReadRunConfig(path); }), HasSubstr("/crop/fill"));
  WriteFileAtomic(path, std::string(200000, '['));
  EXPECT_THAT(MessageOf<FormatError>([&] { ReadRunConfig(path); }), HasSubstr(path));
  EXPECT_THROW(ReadRunConfig(folder.path() + "/none.json"), IoError);
}

}  // namespace
}  // namespace mvstudio::avatar
