#include "dataset/build/given_masks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "core/error.h"
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

/// Frames of a video count from 0. A first mask 0, a gap and footage of images, which has numbers itself, say nothing.
TEST(GivenMasks, MasksFromOneBesideAVideoAreSaid) {
  const testing::TempDir folder;
  std::ofstream(folder / "cam1.mp4") << "video";
  BuildInputs inputs;
  inputs.footage.resize(1);
  inputs.footage[0].camera = "cam1";
  inputs.footage[0].path = folder / "cam1.mp4";
  const auto notice = [&](const std::map<int64_t, std::string>& files) {
    return internal::NoticeOfMasksFromOne(inputs, {{"cam1", {files, {}}}});
  };
  ASSERT_TRUE(notice({{1, "1.png"}, {2, "2.png"}, {3, "3.png"}}));
  EXPECT_THAT(notice({{1, "1.png"}, {2, "2.png"}})->text, AllOf(HasSubstr("cam1"), HasSubstr("the second frame")));
  EXPECT_FALSE(notice({{0, "0.png"}, {1, "1.png"}}));
  EXPECT_FALSE(notice({{1, "1.png"}, {3, "3.png"}}));
  inputs.footage[0].path = folder.path();
  EXPECT_FALSE(notice({{1, "1.png"}, {2, "2.png"}}));
}

}  // namespace
}  // namespace mvstudio::dataset
