#include "dataset/build/given_masks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "core/disk/files.h"
#include "core/error.h"
#include "core/format.h"
#include "dataset/build/joint_numbers.h"
#include "dataset/footage/image_io.h"
#include "tests/dataset/clip_writer.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"

namespace mvstudio::dataset {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

TEST(GivenMasks, WhatIsNoFolderOfMasksIsSaidByItsKind) {
  const testing::TempDir folder;
  BuildInputs inputs;
  inputs.footage.resize(1);
  inputs.footage[0].camera = "cam1";
  const auto message = [&](const std::string& masks) {
    inputs.masks = masks;
    return testing::MessageOf<IoError>([&] { internal::FindGivenMasks(inputs); });
  };
  EXPECT_THAT(message(folder / "none"), HasSubstr("no such folder"));
  std::ofstream(folder / "coco.json") << "{}";
  EXPECT_THAT(message(folder / "coco.json"), AllOf(HasSubstr("is a file"), HasSubstr("COCO's RLE")));
  const testing::TempDir empty;
  EXPECT_THAT(message(empty.path()), AllOf(HasSubstr("none of the cameras"), HasSubstr("cam1")));
  EXPECT_THAT(message(folder / "coco.json"), HasSubstr("RLE or polygons"));
  for (const char* file : {"cam1/000000.npy", "cam1.mp4"}) {
    const testing::TempDir other;
    WriteFileAtomic(other / file, "x");
    EXPECT_THAT(message(other.path()),
                AllOf(HasSubstr(std::filesystem::path(file).filename().string()),
                      HasSubstr(file[4] == '/' ? "an array" : "a video"), HasSubstr("the objects of a frame in one image")));
  }
}

/// A mask with `mark` in its corner.
Image MarkedMask(uint8_t mark, int width = 8, int height = 6) {
  Image mask(width, height, 1);
  *mask.Pixel(mark % 4, 0) = 255, *mask.Pixel(5, 4) = 255;
  return mask;
}

/// Frame f of camera c has mark f + c wherever the file lies.
TEST(GivenMasks, LayoutsOfOtherPrograms) {
  using Name = std::string (*)(int camera, int frame);
  const Name layouts[] = {[](int c, int f) { return Format("cam_%d/%06d.png", c, f); },
                          [](int c, int f) { return Format("cam_%d/cam_%d_%06d_mask.png", c, c, f); },
                          [](int c, int f) { return Format("Cam%d/%06d.jpg.png", c, f); },
                          [](int c, int f) { return Format("cam_%d/masks/%06d.PNG", c, f); },
                          [](int c, int f) { return Format("cam_%d_%06d.png", c, f); },
                          [](int c, int f) { return Format("Cam%d-%06d.png", c, f); },
                          [](int c, int f) { return Format("%06d/cam_%d.png", f, c); },
                          [](int c, int f) { return Format("%06d/CAM-%d.png", f, c); },
                          [](int c, int f) { return Format("frame_%d/cam_%d_alpha.png", f, c); }};
  for (const Name& name : layouts) {
    const testing::TempDir folder;
    BuildInputs inputs;
    inputs.masks = folder.path();
    for (int c = 1; c <= 2; ++c) {
      inputs.footage.push_back({Format("cam_%d", c), "", ""});
      for (int f = 0; f < 3; ++f) {
        const std::string lower = folder / "mask.png", path = folder / name(c, f);
        std::filesystem::create_directories(std::filesystem::path(path).parent_path());
        WriteImage(MarkedMask(static_cast<uint8_t>(f + c)), lower), std::filesystem::rename(lower, path);
      }
    }
    const auto given = internal::FindGivenMasks(inputs);
    for (int c = 1; c <= 2; ++c) {
      for (int f = 0; f < 3; ++f) {
        EXPECT_EQ(MaskOfFrame(given.at(Format("cam_%d", c)), f, 8, 6).pixels, MarkedMask(static_cast<uint8_t>(f + c)).pixels)
            << name(c, f);
      }
    }
  }
}

/// `front` begins the name of `front_left`, and `cam_1` that of a file of `cam1`.
TEST(GivenMasks, AnotherCamerasFilesAreNotJoined) {
  using Name = std::string (*)(const std::string& camera);
  const Name layouts[] = {[](const std::string& camera) { return "000123/" + camera + ".png"; },
                          [](const std::string& camera) { return camera + "_000123.png"; }};
  const std::vector<std::string> cameras = {"front", "front_left", "cam1", "cam_1"};
  for (const Name& name : layouts) {
    const testing::TempDir folder;
    for (size_t c = 0; c < cameras.size(); ++c) WriteImage(MarkedMask(static_cast<uint8_t>(c)), folder / name(cameras[c]));
    for (size_t c = 0; c < cameras.size(); ++c) {
      const FrameMasks masks = FindMasks(folder.path(), cameras[c], cameras);
      EXPECT_EQ(masks.files, (std::map<int64_t, std::string>{{123, folder / name(cameras[c])}}));
      EXPECT_TRUE(masks.objects.empty()) << name(cameras[c]);
    }
  }
}

/// Of a camera's folder numbers are demanded; a pattern's wildcards and positions number the others. Other kinds of images
/// beside PNG are no masks.
TEST(GivenMasks, NumbersOfPatternsAndFilesBesideMasks) {
  const testing::TempDir folder;
  for (const char* name : {"gt/0004/mask.png", "gt/0009/mask.png", "cam/a.png", "cam/b.png", "own/0.png"})
    WriteImage(MarkedMask(0), folder / name);
  WriteFileAtomic(folder / "own/0.tif", "depth"), WriteFileAtomic(folder / "own/1.bmp", "depth");
  using Files = std::map<int64_t, std::string>;
  EXPECT_EQ(FindMasks(folder / "gt/*/mask.png").files,
            (Files{{4, folder / "gt/0004/mask.png"}, {9, folder / "gt/0009/mask.png"}}));
  EXPECT_EQ(FindMasks(folder / "cam").files, (Files{{0, folder / "cam/a.png"}, {1, folder / "cam/b.png"}}));
  EXPECT_THAT(testing::MessageOf<FormatError>([&] { FindMasks(folder.path(), "cam", {"cam"}); }), HasSubstr("no number"));
  EXPECT_EQ(FindMasks(folder.path(), "own", {"own"}).files, (Files{{0, folder / "own/0.png"}}));
}

TEST(GivenMasks, ObjectsOfAFrameAreJoined) {
  using Name = std::string (*)(int frame, int object);
  const Name layouts[] = {[](int f, int o) { return Format("cam/%05d_%d.png", f, o); },
                          [](int f, int o) { return Format("cam/%03d/%05d.png", o, f); },
                          [](int f, int o) { return Format("cam/%05d/%d.png", f, o); }};
  for (const Name& name : layouts) {
    const testing::TempDir folder;
    BuildInputs inputs;
    inputs.masks = folder.path(), inputs.footage.push_back({"cam", "", ""});
    for (int f = 0; f < 3; ++f) {
      for (int o = 0; o < 2; ++o) WriteImage(MarkedMask(static_cast<uint8_t>(f + o)), folder / name(f, o));
    }
    const auto given = internal::FindGivenMasks(inputs);
    for (int f = 0; f < 3; ++f) {
      Image both = MarkedMask(static_cast<uint8_t>(f));
      *both.Pixel((f + 1) % 4, 0) = 255;
      EXPECT_EQ(MaskOfFrame(given.at("cam"), f, 8, 6).pixels, both.pixels) << name(f, 0);
    }
  }
}

TEST(GivenMasks, OfTheImagesShapeAreBroughtToItsSize) {
  const testing::TempDir folder;
  Image half(8, 6, 1), whole(16, 12, 1);
  for (int y = 2; y < 4; ++y) std::fill_n(half.Pixel(2, y), 4, uint8_t{255});
  for (int y = 4; y < 8; ++y) std::fill_n(whole.Pixel(4, y), 8, uint8_t{255});
  WriteImage(half, folder / "half.png"), WriteImage(whole, folder / "whole.png");
  const internal::GivenMasks masks{{{0, folder / "half.png"}, {1, folder / "whole.png"}}, {}};
  EXPECT_EQ(MaskOfFrame(masks, 0, 16, 12).pixels, whole.pixels);
  EXPECT_EQ(MaskOfFrame(masks, 1, 8, 6).pixels, half.pixels);
  const auto refused = [&](int width, int height) {
    return testing::MessageOf<FormatError>([&] { MaskOfFrame(masks, 0, width, height); });
  };
  EXPECT_THAT(refused(6, 8), HasSubstr("rotated by 90 degrees"));
  EXPECT_THAT(refused(16, 16), HasSubstr("without bars"));
}

/// A video of three frames, 0 to 2, with masks 0 or 1 to N.
TEST(GivenMasks, MasksFromOneBesideAVideoAreMovedOrSaid) {
  const testing::TempDir folder;
  testing::WriteClip(folder / "cam1.mp4", testing::Regular(3));
  BuildInputs inputs;
  inputs.footage.resize(1);
  inputs.footage[0].camera = "cam1";
  inputs.footage[0].path = folder / "cam1.mp4";
  std::map<std::string, internal::GivenMasks> given;
  const auto notices = [&](const std::map<int64_t, std::string>& files) {
    given = {{"cam1", {files, {}}}};
    return internal::NumberMasksAsFrames(inputs, &given);
  };
  using Files = std::map<int64_t, std::string>;
  const Files from_one{{1, "a"}, {2, "b"}, {3, "c"}}, from_zero{{0, "a"}, {1, "b"}, {2, "c"}};
  ASSERT_EQ(notices(from_one).size(), 1u);
  EXPECT_EQ(given.at("cam1").files, from_zero);
  EXPECT_TRUE(notices(from_zero).empty());
  EXPECT_EQ(given.at("cam1").files, from_zero);
  for (const Files& unclear : {Files{{1, "a"}, {2, "b"}}, Files{{1, "a"}, {3, "c"}}}) {
    const std::vector<Notice> said = notices(unclear);
    ASSERT_EQ(said.size(), 1u);
    EXPECT_THAT(said[0].text, AllOf(HasSubstr("cam1"), HasSubstr("the second frame")));
    EXPECT_THAT(said[0].hint, HasSubstr("option 'first-mask' 1"));
    EXPECT_EQ(given.at("cam1").files, unclear);
  }
  inputs.first_mask = 1;
  EXPECT_TRUE(notices({{1, "a"}, {2, "b"}}).empty());
  EXPECT_EQ(given.at("cam1").files, (Files{{0, "a"}, {1, "b"}}));
  EXPECT_THROW(notices(from_zero), FormatError);
}

/// Images have numbers themselves: only those from 0 leave one for masks from 1.
TEST(GivenMasks, OfImagesTheNumbersDecide) {
  const testing::TempDir folder;
  for (const char* name : {"0/0.png", "0/1.png", "1/1.png", "1/2.png"}) WriteImage(Image(2, 2, 3), folder / name);
  BuildInputs inputs;
  inputs.footage = {{"cam1", folder / "0", ""}, {"cam2", folder / "1", ""}};
  std::map<std::string, internal::GivenMasks> given = {{"cam1", {{{1, "a"}, {2, "b"}}, {}}},
                                                       {"cam2", {{{1, "a"}, {2, "b"}}, {}}}};
  EXPECT_EQ(internal::NumberMasksAsFrames(inputs, &given).size(), 1u);
  EXPECT_EQ(given["cam1"].files.begin()->first, 0);
  EXPECT_EQ(given["cam2"].files.begin()->first, 1);
}

TEST(JointNumbers, JointsFromOneAreMovedOrSaid) {
  const testing::TempDir folder;
  testing::WriteClip(folder / "cam1.mp4", testing::Regular(3));
  BuildInputs inputs;
  inputs.footage = {{"cam1", folder / "cam1.mp4", ""}};
  const auto first_of = [&](std::vector<int> frames, size_t num_notices) {
    Pose3d pose;
    for (const int frame : frames) pose.rows.emplace_back().frame = frame;
    std::vector<Notice> notices;
    internal::NumberJointsAsFrames(inputs, &pose, &notices);
    EXPECT_EQ(notices.size(), num_notices);
    return pose.rows[0].frame;
  };
  EXPECT_EQ(first_of({1, 2, 3}, 1), 0);
  EXPECT_EQ(first_of({0, 1, 2}, 0), 0);
  EXPECT_EQ(first_of({1, 2}, 1), 1);
  EXPECT_EQ(first_of({2}, 0), 2);
  inputs.first_frame = 1;
  EXPECT_EQ(first_of({2}, 0), 1);
  EXPECT_THROW(first_of({0}, 0), FormatError);
}

}  // namespace
}  // namespace mvstudio::dataset
