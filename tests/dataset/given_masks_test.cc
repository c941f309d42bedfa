#include "dataset/build/given_masks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "core/error.h"
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
  EXPECT_THAT(message(folder.path()), AllOf(HasSubstr("none of the cameras"), HasSubstr("cam1")));
  std::filesystem::create_directories(folder / "cam1/000000");  // a folder of objects for each frame
  EXPECT_THAT(message(folder.path()), AllOf(HasSubstr("`000000`"), HasSubstr("the objects of a frame in one image")));
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
