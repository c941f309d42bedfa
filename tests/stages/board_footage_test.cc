#include "stages/input/board_footage.h"

#include <filesystem>

#include "dataset/footage/image_io.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::stages {
namespace {

void WriteImages(const std::string& folder, const std::vector<std::string>& names, int width) {
  std::filesystem::create_directories(folder);
  for (const std::string& name : names) {
    Image image(width, 8, 3);
    dataset::WriteImage(image, folder + "/" + name);
  }
}

std::vector<int64_t> NumbersOf(calib::Footage* footage) {
  std::vector<int64_t> numbers;
  while (const auto frame = footage->next()) numbers.push_back(frame->frame_idx);
  return numbers;
}

/// The odd one may be the first that is read.
TEST(BoardFootage, ImagesOfAnotherSizeAreLeftOutAndNamed) {
  const mvstudio::testing::TempDir folder;
  WriteImages(folder / "a", {"b1.png"}, 17);
  WriteImages(folder / "a", {"b2.png", "b3.png", "b4.png"}, 16);
  CommandResult result;
  std::vector<calib::Footage> footage = OpenFootage({{"cam", folder / "a"}}, &result);
  EXPECT_THAT(NumbersOf(&footage[0]), ElementsAre(2, 3, 4));
  ASSERT_EQ(result.warnings.size(), 1u);
  EXPECT_EQ(result.warnings[0].code, "CAL-UNUSED");
  EXPECT_THAT(result.warnings[0].text, HasSubstr("1 of 4 images have another size (17x8, most are 16x8)"));
  EXPECT_THAT(result.warnings[0].text, HasSubstr("b1.png"));
}

TEST(BoardFootage, WithoutAMajorityAllAreRead) {
  const mvstudio::testing::TempDir folder;
  WriteImages(folder / "a", {"1.png"}, 17);
  WriteImages(folder / "a", {"2.png"}, 16);
  CommandResult result;
  std::vector<calib::Footage> footage = OpenFootage({{"cam", folder / "a"}}, &result);
  EXPECT_THAT(NumbersOf(&footage[0]), ElementsAre(1, 2));
  EXPECT_TRUE(result.warnings.empty());
}

TEST(BoardFootage, ImagesWithoutANumberBelongToNoTimeStepOfARig) {
  const mvstudio::testing::TempDir folder;
  WriteImages(folder / "a", {"3.png", "test.png"}, 16);
  WriteImages(folder / "b", {"3.png", "4.png"}, 16);
  CommandResult result;
  std::vector<calib::Footage> rig = OpenFootage({{"a", folder / "a"}, {"b", folder / "b"}}, &result);
  EXPECT_THAT(NumbersOf(&rig[0]), ElementsAre(3));
  ASSERT_EQ(result.warnings.size(), 1u);
  EXPECT_THAT(result.warnings[0].text, HasSubstr("test.png"));
  std::vector<calib::Footage> one = OpenFootage({{"a", folder / "a"}}, &result);
  EXPECT_THAT(NumbersOf(&one[0]), ElementsAre(3, 4));
}

}  // namespace
}  // namespace mvstudio::stages
