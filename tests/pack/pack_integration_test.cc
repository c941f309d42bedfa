#include <gmock/gmock.h>

#include <fstream>

#include "core/choice/frame_choice.h"
#include "core/disk/lock.h"
#include "core/parallel.h"
#include "dataset/pack/build.h"
#include "dataset/pack/image_codec.h"
#include "dataset/pack/pack.h"
#include "dataset/views/crop.h"
#include "dataset/views/split.h"
#include "tests/pack/pack_test_util.h"
#include "tests/support/message_of.h"

namespace mvstudio::dataset {
namespace {

namespace fs = std::filesystem;
using mvstudio::testing::MessageOf;
using mvstudio::testing::TempDir;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

PackOpenOptions Trusting() {
  PackOpenOptions options;
  options.check_in_child = false;
  return options;
}

TEST(Codec, Crc32IsZlibs) {
  EXPECT_EQ(internal::Crc32("123456789"), 0xcbf43926u);  // check value of the CRC catalogue
  EXPECT_EQ(internal::Crc32(""), 0u);
  EXPECT_EQ(internal::Crc32("The quick brown fox jumps over the lazy dog"), 0x414fa339u);
}

TEST(Codec, NamesAreCheckedAndSizesAreReadBeforeUnpacking) {
  for (const char* bad :
       {"", "jpg", "jpeg", "jpeg:", "jpeg:0", "jpeg:101", "jpeg:9x", "jpeg:-5", "jpeg:99999999999", "png:3"}) {
    PackCodec codec;
    EXPECT_THROW(FromString(bad, &codec), UsageError) << bad;
  }
  const Image image = RandomImage(31, 17, 3, 4);
  for (const char* name : {"png", "raw", "jpeg:95"}) {
    PackCodec codec;
    FromString(name, &codec);
    EXPECT_EQ(ToString(codec), name);
    const std::string bytes = internal::EncodeImage(image, codec);
    const Image back = internal::DecodeImage(bytes, codec, 31, 17, "p", "w");
    EXPECT_TRUE(codec.kind == PackCodec::Kind::kJpeg || back.pixels == image.pixels) << name;
    EXPECT_THROW(internal::DecodeImage(bytes, codec, 31, 18, "p", "w"), FormatError);
    EXPECT_THROW(internal::DecodeImage(bytes.substr(0, 10), codec, 31, 17, "p", "w"), FormatError);
  }
}

TEST(BuildPack, HoldsWhatTheDatasetHolds) {
  const TempDir folder;
  WriteStudio(folder / "data", 3, 4, 2);
  const PackBuildReport report = BuildPack(folder / "data", folder / "pack", SmallPack());
  EXPECT_TRUE(report.complete);
  EXPECT_EQ(report.num_shards, 4) << "a frame has 6 pictures, a shard takes 6";
  EXPECT_EQ(report.samples, 24);

  const PanopticDataset data = OpenPanopticDataset(folder / "data");
  const Pack pack = OpenPack(folder / "pack");
  ASSERT_EQ(pack.samples().size(), 24u);
  EXPECT_EQ(pack.info().width_px, 32);
  EXPECT_EQ(pack.info().people, 2);
  ASSERT_EQ(pack.rig().cameras.size(), 3u);
  EXPECT_EQ(pack.rig().cameras[0].camera.params, data.rig.cameras[0].camera.params) << "nothing of the lens is lost";
  for (size_t i = 0; i < pack.samples().size(); ++i) {
    const PackSample& s = pack.samples()[i];
    EXPECT_EQ(s.frame, 5 + static_cast<int>(i) / 6);
    EXPECT_EQ(s.camera_idx, static_cast<int>(i) % 6 / 2);
    EXPECT_EQ(s.person, static_cast<int>(i) % 2);
    EXPECT_EQ(s.univ_time_ms, 40.0 * s.frame);
    const geometry::RigCamera& source = data.rig.cameras[s.camera_idx];
    const Coco19Pose& pose = data.poses.at(s.frame).at(s.person);
    EXPECT_EQ(s.pose.x_in_world, pose.x_in_world);
    EXPECT_EQ(s.pose.valid, pose.valid);
    EXPECT_EQ(s.view.CenterInWorld().isApprox(source.CenterInWorld(), 1e-12), true);
    EXPECT_EQ(s.view.camera.model, geometry::LensModel::kPinhole);
    const Image image = ReadImage(data.ImagePath(source.camera.name, s.frame));
    const ResampleMap map(source, s.view);
    const Image seen = map.Apply(image), stored = pack.ReadImage(i);
    EXPECT_LE(MeanAbsDifference(seen, stored), 0.01) << "up to the rounding of the rotation";
    EXPECT_EQ(pack.ReadMask(i).pixels, map.Mask(ReadImage(data.MaskPath(source.camera.name, s.frame), true)).pixels);
    for (int j = 0; j < 19; ++j) {
      if (!s.in_view[j]) continue;
      const auto projection = geometry::Project(s.view.camera, s.view.cam_from_world * Eigen::Vector3d(pose.x_in_world.col(j)));
      EXPECT_LT((projection.px - s.joints_px.col(j)).norm(), 1e-9);
    }
    EXPECT_EQ(s.in_view[16], s.person == 1) << "an invalid joint is not in view";
  }
}

TEST(BuildPack, BytesDoNotDependOnThreadsOrOnWhoMadeThem) {
  const TempDir folder;
  WriteStudio(folder / "data", 3, 4);
  RunContext one, two;
  one.num_threads = 1, two.num_threads = 3;
  BuildPack(folder / "data", folder / "one", SmallPack(), {}, one);
  BuildPack(folder / "data", folder / "two", SmallPack(), {}, two);
  const auto expected = FolderContent(folder / "one");
  EXPECT_EQ(expected, FolderContent(folder / "two"));

  const PackBuildReport first = BuildPack(folder / "data", folder / "shared", SmallPack(), {1, 2}, two);
  EXPECT_THAT(first.built, ElementsAre(1));
  EXPECT_FALSE(first.complete);
  EXPECT_THAT(MessageOf<FormatError>([&] { MergePack(folder / "shared"); }), HasSubstr("lacks 1 of 2 shards (0)"));
  EXPECT_THAT(MessageOf<FormatError>([&] { OpenPack(folder / "shared"); }), HasSubstr("not finished"));
  BuildPack(folder / "data", folder / "shared", SmallPack(), {0, 2}, one);
  EXPECT_TRUE(MergePack(folder / "shared").complete);
  EXPECT_EQ(expected, FolderContent(folder / "shared"));
}

TEST(BuildPack, KeepsWhatIsFinishedAndMakesAgainWhatIsNot) {
  const TempDir folder;
  WriteStudio(folder / "data", 2, 8);
  const PackOptions options = SmallPack();
  EXPECT_THAT(BuildPack(folder / "data", folder / "pack", options).built, ElementsAre(0, 1, 2));
  const auto expected = FolderContent(folder / "pack");
  EXPECT_THAT(BuildPack(folder / "data", folder / "pack", options).kept, ElementsAre(0, 1, 2));
  EXPECT_EQ(expected, FolderContent(folder / "pack"));

  std::string damaged = expected.at("shard-00001.h5");
  damaged[damaged.size() / 2] ^= 16;
  std::ofstream(folder / "pack/shard-00001.h5", std::ios::binary) << damaged;
  std::ofstream(folder / "pack/shard-00002.done.json") << "{\"schema\":";
  std::ofstream(folder / ("pack/.mvstudio-" + std::string(32, '7') + ".h5")) << "left by a killed run";
  std::ofstream(folder / "pack/.mvstudio.shard-00000.lock") << "mvstudio lock: process 999999 on elsewhere";
  EXPECT_THAT(MessageOf<FormatError>([&] { MergePack(folder / "pack"); }), HasSubstr("shard-00002.done.json"));
  EXPECT_THAT(MessageOf<UsageError>([&] { BuildPack(folder / "data", folder / "pack", options); }), HasSubstr("shard-00001.h5"))
      << "it may be somebody else's file by now";
  fs::remove(folder / "pack/shard-00001.h5");
  fs::remove(folder / "pack/shard-00002.done.json");
  const PackBuildReport again = BuildPack(folder / "data", folder / "pack", options);
  EXPECT_THAT(again.built, ElementsAre(1, 2));
  EXPECT_THAT(again.notes, ElementsAre(HasSubstr("is missing"), HasSubstr("no done-marker")));
  EXPECT_EQ(expected, FolderContent(folder / "pack"));
}

TEST(BuildPack, SeesThatAnImageHasChanged) {
  const TempDir folder;
  WriteStudio(folder / "data", 2, 4);
  BuildPack(folder / "data", folder / "pack", SmallPack());
  const PanopticDataset data = OpenPanopticDataset(folder / "data");
  WriteImage(SmoothImage(96, 72, 2), data.ImagePath("00_01", 8));
  EXPECT_THAT(BuildPack(folder / "data", folder / "pack", SmallPack()).built, ElementsAre(1));
  BuildPack(folder / "data", folder / "fresh", SmallPack());
  EXPECT_EQ(FolderContent(folder / "pack"), FolderContent(folder / "fresh"));
}

TEST(BuildPack, RefusesAFolderOfAnotherPack) {
  const TempDir folder;
  WriteStudio(folder / "data", 2, 2);
  BuildPack(folder / "data", folder / "pack", SmallPack());
  const auto before = FolderContent(folder / "pack");
  PackOptions other = SmallPack();
  other.codec.kind = PackCodec::Kind::kRaw;
  EXPECT_THAT(MessageOf<UsageError>([&] { BuildPack(folder / "data", folder / "pack", other); }), HasSubstr("other options"));
  EXPECT_THAT(MessageOf<UsageError>([&] { BuildPack(folder / "data", folder / "data", other); }), HasSubstr("input"));
  EXPECT_EQ(before, FolderContent(folder / "pack"));
}

TEST(BuildPack, LeavesAShardToWhoeverHasIt) {
  const TempDir folder;
  WriteStudio(folder / "data", 2, 5);
  fs::create_directory(folder / "pack");
  PackBuildReport report;
  {
    const FileLock other(folder / "pack/.mvstudio.shard-00001.lock");
    ASSERT_TRUE(other.owned());
    report = BuildPack(folder / "data", folder / "pack", SmallPack());
  }
  EXPECT_THAT(report.built, ElementsAre(0));
  EXPECT_THAT(report.busy, ElementsAre(1));
  EXPECT_FALSE(report.complete);
  EXPECT_THAT(report.busy_owner, HasSubstr("process " + std::to_string(getpid()) + " on "));
  EXPECT_TRUE(BuildPack(folder / "data", folder / "pack", SmallPack()).complete);
  BuildPack(folder / "data", folder / "alone", SmallPack());
  EXPECT_EQ(FolderContent(folder / "pack"), FolderContent(folder / "alone"));
}

TEST(BuildPack, MissingImagesAreListedAndDamagedOnesNamed) {
  const TempDir folder;
  WriteStudio(folder / "data", 2, 2);
  const PanopticDataset data = OpenPanopticDataset(folder / "data");
  fs::remove(data.ImagePath("00_01", 6));
  fs::remove(data.MaskPath("00_00", 6));
  const PackBuildReport report = BuildPack(folder / "data", folder / "pack", SmallPack());
  EXPECT_THAT(report.skipped, ElementsAre("camera 00_01, frame 6: no image"));
  EXPECT_EQ(report.missing.asked(), 4);
  EXPECT_THAT(report.missing.by_camera.at("00_01").no_image, ElementsAre(6));
  EXPECT_THAT(report.missing.by_camera.at("00_00").no_mask, ElementsAre(6));
  const Pack pack = OpenPack(folder / "pack", Trusting());
  ASSERT_EQ(pack.samples().size(), 3u);
  EXPECT_FALSE(pack.samples()[2].has_mask);
  EXPECT_TRUE(pack.ReadMask(2).empty());
  const std::string image = data.ImagePath("00_00", 5);
  Truncate(image, image + ".part", 0.7);
  fs::rename(image + ".part", image);
  EXPECT_THAT(MessageOf<FormatError>([&] { BuildPack(folder / "data", folder / "other", SmallPack()); }), HasSubstr(image));
  EXPECT_FALSE(fs::exists(folder / "other/shard-00000.h5"));
}

TEST(BuildPack, ACameraWithoutAnyImageIsRefused) {
  const TempDir folder;
  WriteStudio(folder / "data", 2, 2);
  const PanopticDataset data = OpenPanopticDataset(folder / "data");
  for (const int frame : {5, 6}) fs::rename(data.ImagePath("00_01", frame), data.ImagePath("00_01", frame + 10));
  EXPECT_THAT(MessageOf<FormatError>([&] { BuildPack(folder / "data", folder / "pack", SmallPack()); }),
              HasSubstr("hdImgs/00_01"));
  PackOptions one = SmallPack();
  one.cameras = {"00_00"};
  EXPECT_EQ(BuildPack(folder / "data", folder / "pack", one).missing.missing(), 0);
}

TEST(BuildPack, WholeImagesKeepTheirLens) {
  const TempDir folder;
  WriteStudio(folder / "data", 2, 2, 2);
  PackOptions options;
  options.full = true;
  BuildPack(folder / "data", folder / "pack", options);
  const Pack pack = OpenPack(folder / "pack", Trusting());
  const PanopticDataset data = OpenPanopticDataset(folder / "data");
  ASSERT_EQ(pack.samples().size(), 4u) << "one a picture, not one a person";
  EXPECT_EQ(pack.samples()[0].view.camera.model, geometry::LensModel::kBrown5);
  EXPECT_EQ(pack.samples()[0].view.camera.params, data.rig.cameras[0].camera.params);
  EXPECT_EQ(pack.ReadImage(0).pixels, ReadImage(data.ImagePath("00_00", 5)).pixels);
  EXPECT_EQ(pack.ReadMask(0).pixels, ReadImage(data.MaskPath("00_00", 5), true).pixels);

  options.undistort = true;
  const PackBuildReport report = BuildPack(folder / "data", folder / "ideal", options);
  ASSERT_EQ(report.undistortion.size(), data.rig.cameras.size());
  EXPECT_LT(report.undistortion[0].max_joint_px, 1e-9);
  EXPECT_GT(report.undistortion[0].max_map_px, 0) << "the first lens is distorted";
  EXPECT_LT(report.undistortion[0].max_map_px, 5e-3);
  EXPECT_LT(report.undistortion[1].max_map_px, 1e-9) << "the others are pinholes";
  const Pack ideal = OpenPack(folder / "ideal", Trusting());
  EXPECT_EQ(ideal.info().view, PackView::kUndistorted);
  const geometry::RigCamera pinhole = IdealPinhole(data.rig.cameras[0]).camera;
  EXPECT_EQ(ideal.samples()[0].view.camera.params, pinhole.camera.params);
  const Undistorter undistorter(data.rig.cameras[0], pinhole);
  EXPECT_EQ(ideal.ReadImage(0).pixels, undistorter.Apply(ReadImage(data.ImagePath("00_00", 5))).pixels);
}

TEST(BuildPack, ASplitMarksItsImagesAndLeavesOutTheRest) {
  const TempDir folder;
  WriteStudio(folder / "data", 3, 4);
  Split split;
  split.dataset = "studio", split.rule = "by hand";
  split.train = {{"00_00", "00_01"}, {5, 6}};
  split.test = {{"00_02"}, {8}};
  split.unused_frames = {7};
  split.blocks = {{5, 8}};
  WriteSplit(split, folder / "split.json");
  PackOptions options = SmallPack();
  options.split = folder / "split.json";
  BuildPack(folder / "data", folder / "pack", options);
  const Pack pack = OpenPack(folder / "pack", Trusting());
  ASSERT_EQ(pack.samples().size(), 5u);
  for (const PackSample& s : pack.samples())
    EXPECT_EQ(s.part, s.camera_idx == 2 ? PartOfSplit::kTest : PartOfSplit::kTrain) << s.frame;
}

TEST(BuildPack, ChoosesCamerasFramesAndPeople) {
  const TempDir folder;
  WriteStudio(folder / "data", 3, 3, 2);
  PackOptions options = SmallPack();
  options.cameras = {"00_02"}, options.frames = {5, 7}, options.person = 1, options.masks = false;
  options.codec = {PackCodec::Kind::kJpeg, 95};
  BuildPack(folder / "data", folder / "pack", options);
  const Pack pack = OpenPack(folder / "pack", Trusting());
  ASSERT_EQ(pack.samples().size(), 2u);
  EXPECT_EQ(pack.samples()[1].frame, 7);
  EXPECT_EQ(pack.samples()[1].camera_idx, 2);
  EXPECT_EQ(pack.samples()[1].person, 1);
  EXPECT_FALSE(pack.samples()[1].has_mask);
  EXPECT_EQ(pack.info().mask_codec, "none");
  PackOptions wrong;
  wrong.frames = {4};
  EXPECT_THROW(BuildPack(folder / "data", folder / "x", wrong), NothingLeftError);
  wrong.frames = {}, wrong.cameras = {"00_07"};
  EXPECT_THROW(BuildPack(folder / "data", folder / "x", wrong), UsageError);
  wrong.cameras = {}, wrong.person = 9;
  EXPECT_THROW(BuildPack(folder / "data", folder / "x", wrong), UsageError);
  EXPECT_FALSE(fs::exists(folder / "x"));
}

TEST(Pack, OneFileHoldsTheSame) {
  const TempDir folder;
  WriteStudio(folder / "data", 2, 8);
  BuildPack(folder / "data", folder / "pack", SmallPack());
  WriteSinglePack(folder / "pack", folder / "pack.h5");
  EXPECT_EQ(EverythingOf(folder / "pack", Trusting()), EverythingOf(folder / "pack.h5", Trusting()));
  EXPECT_TRUE(IsPack(folder / "pack.h5") && IsPack(folder / "pack"));
  EXPECT_FALSE(IsPack(folder / "data") || IsPack(folder / "data/calibration_studio.json"));
  EXPECT_THAT(VerifyPack(folder / "pack.h5").findings, IsEmpty());
}

TEST(Pack, ManyThreadsReadTheSame) {
  const TempDir folder;
  WriteStudio(folder / "data", 3, 6);
  BuildPack(folder / "data", folder / "pack", SmallPack());
  const Pack pack = OpenPack(folder / "pack");
  std::vector<Image> alone(pack.samples().size());
  for (size_t i = 0; i < alone.size(); ++i) alone[i] = pack.ReadImage(i);
  std::vector<char> same(400);
  ParallelFor(400, 8, [&](int64_t k) {
    const size_t i = static_cast<size_t>(k * 7) % alone.size();
    same[k] = pack.ReadImage(i).pixels == alone[i].pixels && !pack.ReadMask(i).empty();
  });
  EXPECT_EQ(std::count(same.begin(), same.end(), 1), 400);
}

TEST(VerifyPack, ListsAllThatIsWrong) {
  const TempDir folder;
  WriteStudio(folder / "data", 2, 12);
  BuildPack(folder / "data", folder / "pack", SmallPack());
  EXPECT_THAT(VerifyPack(folder / "pack").findings, IsEmpty());
  EXPECT_EQ(VerifyPack(folder / "pack").images, 24);
  std::string shard = ReadFile(folder / "pack/shard-00001.h5");
  shard[shard.size() - 4000] ^= 1;
  std::ofstream(folder / "pack/shard-00001.h5", std::ios::binary) << shard;
  fs::remove(folder / "pack/shard-00002.h5");
  std::ofstream(folder / "pack/shard-00003.done.json") << "[]";
  std::ofstream(folder / "pack/shard-00077.h5") << "stray";
  const PackReport report = VerifyPack(folder / "pack");
  std::vector<std::string> found;
  for (const Finding& f : report.findings) found.push_back(f.code + " " + fs::path(f.path).filename().string());
  EXPECT_THAT(found, ::testing::IsSupersetOf({"PCK-SHARD shard-00001.h5", "PCK-SHARD shard-00002.h5",
                                              "PCK-DONE shard-00003.done.json", "PCK-STRAY shard-00077.h5"}));
  EXPECT_EQ(report.info.samples, 12 + (report.info.shards == 3 ? 6 : 0)) << "the rest is still read";
  EXPECT_THROW(VerifyPack(folder / "data"), IoError);
}

}  // namespace
}  // namespace mvstudio::dataset
