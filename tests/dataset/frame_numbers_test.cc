#include "dataset/footage/frame_numbers.h"

#include <filesystem>
#include <fstream>
#include <limits>

#include "core/disk/paths.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::dataset {
namespace {

namespace fs = std::filesystem;
using Numbers = std::vector<int64_t>;

/// The numbers of files of these names under a pattern, in the order of the names.
Numbers Numbered(const std::vector<std::string>& names, const std::string& pattern) {
  const mvstudio::testing::TempDir folder;
  for (const std::string& name : names) {
    const fs::path file = folder / ("in/" + name);
    fs::create_directories(file.parent_path());
    std::ofstream(file) << "x";
  }
  const std::string path = folder / (pattern.empty() ? "in" : "in/" + pattern);
  const std::vector<std::string> files = FilesMatching(path);
  EXPECT_FALSE(files.empty()) << pattern;
  return NumberFrames(path, files).numbers;
}

TEST(NumberFrames, TheWildcardIsTheFrame) {
  const std::vector<std::string> pairs = {"00_0.jpg", "00_1.jpg", "01_0.jpg", "01_1.jpg"};
  EXPECT_EQ(Numbered(pairs, "*_0.jpg"), (Numbers{0, 1}));
  EXPECT_EQ(Numbered(pairs, "0?_1.jpg"), (Numbers{0, 1}));
  EXPECT_EQ(Numbered(pairs, "[0-9][0-9]_1.jpg"), (Numbers{0, 1}));
  EXPECT_EQ(Numbered({"f_007_cam2.png", "f_012_cam2.png"}, "f_*_cam2.png"), (Numbers{7, 12}));
  EXPECT_EQ(Numbered({"cam1_03.png", "cam1_05.png"}, "cam1_*.png"), (Numbers{3, 5}));
  EXPECT_EQ(Numbered({"left12.png", "left13.png"}, "left1?.png"), (Numbers{12, 13})) << "the whole number";
  EXPECT_EQ(Numbered({"3/cam1.png", "8/cam1.png", "8/cam2.png"}, "*/cam1.png"), (Numbers{3, 8})) << "a folder a frame";
}

TEST(NumberFrames, OfAFolderTheLastNumberThatDiffers) {
  EXPECT_EQ(Numbered({"a1_05.png", "a1_07.png"}, ""), (Numbers{5, 7}));
  EXPECT_EQ(Numbered({"00_0.jpg", "01_0.jpg", "02_0.jpg"}, ""), (Numbers{0, 1, 2}));
  EXPECT_EQ(Numbered({"00_0.jpg", "01_0.jpg"}, "*.jpg"), (Numbers{0, 1}));
  EXPECT_EQ(Numbered({"a.png", "b.png"}, ""), (Numbers{0, 1})) << "positions";
}

/// Two cameras in one folder stay what they are: the numbers come twice.
TEST(NumberFrames, TwoCamerasInOneFolderAreNotMadeOne) {
  EXPECT_EQ(Numbered({"00_0.jpg", "00_1.jpg", "01_0.jpg", "01_1.jpg"}, ""), (Numbers{0, 1, 0, 1}));
  EXPECT_EQ(Numbered({"1_5.png", "2_5.png", "1_6.png", "2_6.png"}, ""), (Numbers{5, 6, 5, 6}));
}

/// Seconds alone would come twice, or pair images of other minutes.
TEST(NumberFrames, ATimeOfDayIsOneNumber) {
  const std::vector<std::string> images = {"Image__2018-02-12__15-11-38.png", "Image__2018-02-12__15-13-40.png",
                                           "Image__2018-02-12__15-14-38.png"};
  constexpr int64_t kDay = 86400, k20180212 = 6617 * kDay, k20230811 = 8623 * kDay;  // since 2000-01-01, by `date -d`
  const Numbers of_images = {k20180212 + 54698, k20180212 + 54820, k20180212 + 54878};
  EXPECT_EQ(Numbered(images, ""), of_images);
  EXPECT_EQ(Numbered(images, "Image__*.png"), of_images);
  EXPECT_EQ(Numbered({"WIN_20230811_10_13_10_Pro.png", "WIN_20230811_10_13_15_Pro.png"}, ""),
            (Numbers{k20230811 + 36790, k20230811 + 36795}));
  EXPECT_EQ(Numbered({"img2025-03-21 18_09_53.864305.png", "img2025-03-21 18_10_03.1.png"}, ""), (Numbers{65393864, 65403100}));
  EXPECT_EQ(Numbered({"a 10-11-38.png", "a 10-12-38.png", "a 11-11-38.png"}, ""), (Numbers{36698, 36758, 40298}));
  for (const int64_t number : of_images)
    EXPECT_LE(number, std::numeric_limits<int>::max()) << "joints and masks count in 32 bits";
  EXPECT_EQ(Numbered({"cam_01_02_03.png", "cam_01_02_04.png"}, ""), (Numbers{3, 4})) << "camera, take and frame";
  EXPECT_EQ(Numbered({"IMG_20180212_151138.jpg", "IMG_20180212_151240.jpg"}, ""), (Numbers{151138, 151240}));
}

/// As EuRoC and ROS name images. Positions would pair the images of two cameras wrongly from the first that one lacks on.
TEST(NumberFrames, TimesSince1970FitThirtyTwoBits) {
  const Numbers milliseconds = {26379763, 26379863};  // 2014-06-24 07:19:39.763 and .863, by `date -u`
  EXPECT_EQ(Numbered({"1403594379763555584.png", "1403594379863555584.png"}, ""), milliseconds);
  EXPECT_EQ(Numbered({"left_1403594379763555.png", "left_1403594379863555.png"}, ""), milliseconds);
  EXPECT_EQ(Numbered({"1403594379763.png", "1403594379863.png"}, "*.png"), milliseconds);
}

TEST(NumberFrames, ImagesWithoutANumberComeAfterTheOthers) {
  EXPECT_EQ(Numbered({"GOPR0032.jpg", "GOPR0033.jpg", "test_image.jpg"}, ""), (Numbers{32, 33, 34}));
  EXPECT_EQ(Numbered({"IMG_3.png", "a.png", "b.png"}, ""), (Numbers{3, 4, 5}));
  const FrameNumbers numbers = NumberFrames("in", {"in/5.png", "in/x.png"});
  EXPECT_EQ(numbers.without_number, (std::vector<bool>{false, true}));
  EXPECT_TRUE(NumberFrames("in", {"in/a.png", "in/x.png"}).without_number.empty());
}

}  // namespace
}  // namespace mvstudio::dataset
