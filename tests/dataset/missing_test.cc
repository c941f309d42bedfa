#include "dataset/panoptic/missing.h"

#include <filesystem>
#include <nlohmann/json.hpp>

#include "core/disk/files.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::dataset {
namespace {

namespace fs = std::filesystem;

/// Empty files: only names are looked at.
class Missing : public ::testing::Test {
 protected:
  Missing() {
    data_.root = folder_.path();
    for (const char* camera : {"00_00", "00_01", "00_02"}) {
      for (int frame = 0; frame < 10; ++frame) {
        WriteFileAtomic(data_.ImagePath(camera, frame), "");
        WriteFileAtomic(data_.MaskPath(camera, frame), "");
      }
    }
  }
  MissingImages Find() const { return FindMissing(data_, cameras_, frames_); }

  mvstudio::testing::TempDir folder_;
  PanopticDataset data_;
  std::vector<std::string> cameras_ = {"00_02", "00_00", "00_01"};
  std::vector<int> frames_ = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9};
};

TEST_F(Missing, NothingIsMissingOfAWholeDataset) {
  EXPECT_EQ(Find().asked(), 30);
  EXPECT_EQ(Find().missing(), 0);
  EXPECT_EQ(MissingText(Find()), "0 of 30 images are not in the dataset");
  const auto json = nlohmann::json::parse(MissingToJsonText(Find()));
  EXPECT_EQ(json["cameras"], nlohmann::json::object());
  EXPECT_EQ(json["names"], nlohmann::json::array());
}

TEST_F(Missing, ImagesAndMasksAreCountedByCameraAndNamed) {
  for (const int frame : {1, 2, 3, 4, 6, 7}) fs::remove(data_.ImagePath("00_01", frame));
  fs::remove(data_.MaskPath("00_01", 1));  // its image is gone too
  fs::remove(data_.MaskPath("00_01", 9));
  fs::remove(data_.MaskPath("00_02", 0));
  const MissingImages missing = Find();
  EXPECT_EQ(missing.missing(), 8);
  EXPECT_TRUE(missing.Has("00_01", 1));
  EXPECT_TRUE(missing.Has("00_01", 9));
  EXPECT_FALSE(missing.Has("00_01", 5));
  EXPECT_FALSE(missing.Has("00_07", 1)) << "nobody asked for it";
  EXPECT_THAT(missing.by_camera.at("00_01").no_mask, ElementsAre(9));
  EXPECT_TRUE(missing.CamerasWithout().empty());
  EXPECT_THAT(MissingText(missing), AllOf(HasSubstr("8 of 30"), HasSubstr("2 of them, have no mask"),
                                          HasSubstr("00_01: 7 of 10, 00_02: 1 of 10"), Not(HasSubstr("00_00"))));
  EXPECT_THAT(MissingHint(missing), HasSubstr("only some frames"));
  const auto json = nlohmann::json::parse(MissingToJsonText(missing));
  EXPECT_EQ(json["asked"], 30);
  EXPECT_EQ(json["pictures"], 6);
  EXPECT_EQ(json["masks"], 2);
  EXPECT_EQ(json["cameras"]["00_01"], (nlohmann::json{{"asked", 10}, {"pictures", 6}, {"masks", 1}}));
  EXPECT_EQ(json["names"].size(), 8u);
  EXPECT_EQ(json["names"][0], "camera 00_01, frame 1: no image");
  EXPECT_EQ(json["names"][6], "camera 00_01, frame 9: no mask");
}

TEST_F(Missing, ACameraWithoutAnyIsNamedAndNamesAreFew) {
  fs::remove_all(fs::path(data_.root) / "hdImgs/00_01");
  fs::remove_all(fs::path(data_.root) / "masks");
  EXPECT_THAT(Find().CamerasWithout(), ElementsAre("00_00", "00_01", "00_02"));
  EXPECT_EQ(nlohmann::json::parse(MissingToJsonText(Find()))["names"].size(), 20u) << "of 30";
  const MissingImages images = FindMissing(data_, cameras_, frames_, false);
  EXPECT_THAT(images.CamerasWithout(), ElementsAre("00_01"));
  EXPECT_EQ(images.missing(), 10);
}

TEST_F(Missing, OneOfTheTwoFormatsIsEnough) {
  fs::rename(data_.ImagePath("00_00", 3), fs::path(data_.root) / "hdImgs/00_00/00_00_00000003.png");
  EXPECT_EQ(Find().missing(), 0);
}

}  // namespace
}  // namespace mvstudio::dataset
