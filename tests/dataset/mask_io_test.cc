#include "dataset/footage/mask_io.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>

#include "core/error.h"
#include "dataset/footage/image_io.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"

namespace mvstudio::dataset {
namespace {

using mvstudio::testing::MessageOf;
using mvstudio::testing::TempDir;
using ::testing::HasSubstr;

class MaskIo : public ::testing::Test {
 protected:
  static constexpr int kWidth = 40, kHeight = 30;
  static bool OnPerson(int x, int y) { return x >= 12 && x < 28 && y >= 6 && y < 26; }

  /// A mask whose person has `on`, in the rows of the lower half `lower`.
  static cv::Mat Mask(int on, int type = CV_8U, int off = 0, int lower = -1) {
    cv::Mat mask(kHeight, kWidth, type, cv::Scalar::all(off));
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        if (!OnPerson(x, y)) continue;
        const int value = lower >= 0 && y >= kHeight / 2 ? lower : on;
        if (type == CV_16U) mask.at<uint16_t>(y, x) = static_cast<uint16_t>(value);
        if (type == CV_8U) mask.at<uint8_t>(y, x) = static_cast<uint8_t>(value);
      }
    }
    return mask;
  }
  std::string Put(const std::string& name, const cv::Mat& mask, const std::vector<int>& how = {}) const {
    const std::string path = folder_ / name;
    std::filesystem::create_directories(std::filesystem::path(path).parent_path());
    cv::imwrite(path, mask, how);
    return path;
  }
  /// Every pixel as the person's place says, bit for bit.
  static void ExpectPerson(const Image& mask) {
    ASSERT_EQ(mask.channels, 1);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) ASSERT_EQ(*mask.Pixel(x, y), OnPerson(x, y) ? 255 : 0) << x << ", " << y;
    }
  }
  static cv::Mat WithAlpha(const cv::Mat& colour, const cv::Mat& alpha) {
    cv::Mat out;
    cv::merge(std::vector<cv::Mat>{colour, colour, colour, alpha}, out);
    return out;
  }

  TempDir folder_;
};

TEST_F(MaskIo, EveryWayToWriteAPersonReadsAsTheSame) {
  const cv::Mat plain = Mask(255), black = Mask(0);
  ExpectPerson(ReadMask(Put("255.png", plain)));
  ExpectPerson(ReadMask(Put("1.png", Mask(1))));
  ExpectPerson(ReadMask(Put("labels.png", Mask(3, CV_8U, 0, 14))));
  ExpectPerson(ReadMask(Put("ids.png", Mask(24001, CV_16U, 0, 24002))));
  ExpectPerson(ReadMask(Put("16_1.png", Mask(1, CV_16U))));
  ExpectPerson(ReadMask(Put("16_255.png", Mask(255, CV_16U))));
  ExpectPerson(ReadMask(Put("16_full.png", Mask(65535, CV_16U))));
  ExpectPerson(ReadMask(Put("bit.png", plain, {cv::IMWRITE_PNG_BILEVEL, 1})));
  ExpectPerson(ReadMask(Put("alpha.png", WithAlpha(black, plain))));
  ExpectPerson(ReadMask(Put("white_alpha.png", WithAlpha(cv::Mat(kHeight, kWidth, CV_8U, cv::Scalar(255)), plain))));
  ExpectPerson(ReadMask(Put("opaque.png", WithAlpha(plain, cv::Mat(kHeight, kWidth, CV_8U, cv::Scalar(255))))));
  cv::Mat red;
  cv::merge(std::vector<cv::Mat>{black, black, Mask(128)}, red);
  ExpectPerson(ReadMask(Put("colour_label.png", red)));
}

TEST_F(MaskIo, WhatASetMeansIsToldInOneLine) {
  EXPECT_EQ(MeaningOfMasks({Put("a.png", Mask(255))}).Text(), "");
  EXPECT_EQ(MeaningOfMasks({Put("b.png", Mask(1))}).Text(), "masks of 0 and 1: 1 is the person");
  EXPECT_THAT(MeaningOfMasks({Put("c.png", Mask(2, CV_8U, 0, 9))}).Text(), HasSubstr("labels (0, 2, 9)"));
  EXPECT_FALSE(MeaningOfMasks({Put("c.png", Mask(2, CV_8U, 0, 9))}).IsDoubtful());
  EXPECT_TRUE(MeaningOfMasks({Put("d.png", Mask(128))}).IsDoubtful()) << "half a person, or a person";
  const MaskMeaning nobody = MeaningOfMasks({Put("e.png", Mask(0))});
  EXPECT_THAT(nobody.Text(), HasSubstr("without anybody"));
  EXPECT_TRUE(nobody.IsDoubtful());
}

TEST_F(MaskIo, OneMaskDoesNotMeanSomethingElseThanItsSet) {
  std::vector<std::string> set;
  for (int k = 0; k < 4; ++k) set.push_back(Put("set/" + std::to_string(k) + ".png", Mask(255)));
  const MaskMeaning meaning = MeaningOfMasks(set);
  const std::string black = Put("set/black.png", Mask(0)), one = Put("set/one.png", Mask(1));
  const Image nobody = ReadMask(black, meaning);
  EXPECT_EQ(std::count(nobody.pixels.begin(), nobody.pixels.end(), 0), kWidth * kHeight);
  EXPECT_THAT(MessageOf<FormatError>([&] { ReadMask(one, meaning); }),
              ::testing::AllOf(HasSubstr("one.png"), HasSubstr("0 and 1"), HasSubstr("0 and 255")));
  set.push_back(one);
  EXPECT_THAT(MessageOf<FormatError>([&] { MeaningOfMasks(set); }), HasSubstr("one.png"));
  // The other way round: 255 among masks of 0 and 1.
  const MaskMeaning ones = MeaningOfMasks({one, black});
  EXPECT_THAT(MessageOf<FormatError>([&] { ReadMask(set[0], ones); }), HasSubstr("0 and 255"));
}

TEST_F(MaskIo, SoftMasksKeepTheirShares) {
  cv::Mat soft = Mask(255);
  for (int x = 0; x < 10; ++x) soft.at<uint8_t>(6, 12 + x) = static_cast<uint8_t>(20 + 20 * x);
  const std::string path = Put("soft.png", soft);
  const MaskMeaning meaning = MeaningOfMasks({path});
  EXPECT_EQ(meaning.form, MaskMeaning::Form::kSoft);
  EXPECT_EQ(*ReadMask(path, meaning).Pixel(14, 6), 60);
  EXPECT_EQ(*ReadMask(path, meaning).Pixel(14, 10), 255);
}

TEST_F(MaskIo, WhatIsNoMaskIsRefusedByName) {
  const auto refused = [](const std::string& path) { return MessageOf<FormatError>([&] { ReadMask(path); }); };
  EXPECT_THAT(refused(Put("inverted.png", Mask(0, CV_8U, 255))),
              ::testing::AllOf(HasSubstr("inverted.png"), HasSubstr("inverted")));
  EXPECT_THAT(refused(Put("inverted1.png", Mask(0, CV_8U, 1))), HasSubstr("inverted"));
  EXPECT_THAT(refused(Put("from_one.png", Mask(2, CV_8U, 1))), HasSubstr("no pixel is 0"));
  EXPECT_THAT(refused(Put("two_in_one.png", WithAlpha(Mask(255), Mask(0, CV_8U, 255)))), HasSubstr("opacity"));
  cv::Mat image(60, 60, CV_8U);
  for (int i = 0; i < 3600; ++i) image.at<uint8_t>(i / 60, i % 60) = static_cast<uint8_t>(i % 251);
  EXPECT_THAT(refused(Put("picture.png", image)), HasSubstr("not a mask"));
}

/// Photographs of a person on white and on black, in colour and grey, whole and cut at the lower edge: none is a soft mask.
TEST_F(MaskIo, PhotographsAreNoMasks) {
  const auto photograph = [](bool colour, int background, bool cut) {
    cv::Mat image(120, 100, CV_8UC3, cv::Scalar::all(background));
    for (int y = 20; y < (cut ? 120 : 100); ++y) {
      for (int x = 30; x < 65; ++x) {
        const int v = (x * 7 + y * 3) % 240;
        image.at<cv::Vec3b>(y, x) = colour ? cv::Vec3b(v, 240 - v, y * 2) : cv::Vec3b(v, v, v);
      }
    }
    return image;
  };
  for (const bool colour : {true, false}) {
    for (const bool cut : {true, false}) {
      for (const int background : {255, 250, 0}) {
        const std::string path = Put("photograph.png", photograph(colour, background, cut));
        const std::string said = MessageOf<FormatError>([&] { ReadMask(path); });
        EXPECT_THAT(said, ::testing::AnyOf(HasSubstr("not a mask"), HasSubstr("a picture on white")))
            << colour << " " << cut << " " << background;
      }
    }
  }
  // A grey mask with the losses of JPEG, and labels in a few colours, are masks.
  EXPECT_EQ(*ReadMask(Put("mask.jpg", Mask(255))).Pixel(20, 16), 255);
  const MaskMeaning ones = MeaningOfMasks({Put("ones.jpg", Mask(1), {cv::IMWRITE_JPEG_QUALITY, 100})});
  EXPECT_TRUE(ones.IsDoubtful());
  EXPECT_THAT(ones.Text(), HasSubstr("as PNG"));
  cv::Mat labels(kHeight, kWidth, CV_8UC3, cv::Scalar::all(0));
  for (int y = 6; y < 26; ++y) {
    for (int x = 12; x < 28; ++x) labels.at<cv::Vec3b>(y, x) = y < 16 ? cv::Vec3b(0, 0, 128) : cv::Vec3b(0, 128, 0);
  }
  ExpectPerson(ReadMask(Put("labels.png", labels)));
}

TEST_F(MaskIo, AFolderIsDecidedOnceAndSharedByCopies) {
  Put("masks/a/0.png", Mask(1)), Put("masks/b/0.png", Mask(0));
  const MaskFolder folder;
  const MaskFolder copy = folder;
  EXPECT_EQ(folder.Of(folder_ / "masks").form, MaskMeaning::Form::kLabels);
  std::filesystem::remove_all(folder_ / "masks/a");
  EXPECT_EQ(copy.Of(folder_ / "masks").form, MaskMeaning::Form::kLabels);
  EXPECT_EQ(MaskFolder().Of(folder_ / "masks").form, MaskMeaning::Form::kNobody);
}

}  // namespace
}  // namespace mvstudio::dataset
