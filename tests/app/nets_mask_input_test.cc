#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "app/nets/mask_input.h"
#include "core/error.h"
#include "dataset/footage/image_io.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"

namespace mvstudio::app {
namespace {

using mvstudio::testing::MessageOf;
using mvstudio::testing::TempDir;
using ::testing::HasSubstr;

/// Foreground where columns lie in [x0, x1) and rows in [y0, y1).
Image Mask(int width, int height, int x0, int x1, int y0, int y1) {
  Image mask(width, height, 1);
  for (int y = y0; y < y1; ++y) {
    for (int x = x0; x < x1; ++x) *mask.Pixel(x, y) = 255;
  }
  return mask;
}

TEST(MaskTruth, ScoresOfHandMadeMasks) {
  const TempDir folder;
  const std::string truth = folder / "truth", masks = folder / "masks";
  dataset::WriteImage(Mask(4, 4, 0, 2, 0, 4), MaskPath(masks, "a", 3));  // left half against upper half: 4 of 12
  dataset::WriteImage(Mask(4, 4, 0, 4, 0, 2), truth + "/cam_0003.png");
  dataset::WriteImage(Mask(4, 4, 0, 3, 0, 4), MaskPath(masks, "a", 4));  // 12 px against 16
  dataset::WriteImage(Mask(4, 4, 0, 4, 0, 4), truth + "/cam_0004.png");
  dataset::WriteImage(Image(4, 4, 1), MaskPath(masks, "a", 5));  // nobody on both
  dataset::WriteImage(Image(4, 4, 1), truth + "/cam_0005.png");
  dataset::WriteImage(Image(4, 4, 1), truth + "/cam_0006.png");  // without a mask of ours
  const TruthScore score = CompareWithTruth(truth, masks, "a");
  EXPECT_EQ(score.pictures, 3);
  EXPECT_EQ(score.missing, 1);
  EXPECT_NEAR(score.iou_sum, 4.0 / 12 + 12.0 / 16 + 1, 1e-12);
  EXPECT_NEAR(score.worst, 4.0 / 12, 1e-12);
  EXPECT_EQ(score.worst_picture, masks + "/a/00000003.png");
  EXPECT_EQ(score.too_much_px, 4);
  EXPECT_EQ(score.too_little_px, 4 + 4);
}

TEST(MaskTruth, WithoutTruthOrOfOtherSizesThereIsNoScore) {
  const TempDir folder;
  EXPECT_THAT(MessageOf<IoError>([&] { CompareWithTruth(folder / "none", folder / "masks", "a"); }),
              HasSubstr(folder / "none"));
  dataset::WriteImage(Image(4, 4, 1), MaskPath(folder / "masks", "a", 1));
  dataset::WriteImage(Image(5, 4, 1), folder / "truth/1.png");
  EXPECT_THAT(MessageOf<FormatError>([&] { CompareWithTruth(folder / "truth", folder / "masks", "a"); }),
              HasSubstr("1.png: is 5x4, the footage 4x4"));
}

}  // namespace
}  // namespace mvstudio::app
