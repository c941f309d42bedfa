#include "stages/input/image_file_pairs.h"

#include <cmath>

#include "core/error.h"
#include "core/random.h"
#include "dataset/footage/image_io.h"
#include "tests/support/folder_state.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::stages {
namespace {

/// Noise of 100 … 149, and `added`.
Image Noise(int width, int height, int added = 0) {
  Image image(width, height, 3);
  Rng rng(9);
  for (uint8_t& p : image.pixels) p = static_cast<uint8_t>(100 + rng.Index(50) + added);
  return image;
}

TEST(ImageFilePairs, NamesDecideNotExtensions) {
  const TempDir folder;
  for (const char* file : {"a/p1.png", "a/p2.png", "a/p3.jpg", "b/p2.jpeg", "b/p3.PNG", "b/p4.png", "a/notes.txt"}) {
    Put(folder / file, "not opened");
  }
  const ImageFilePairs pairs = PairImages(folder / "a", folder / "b", "");
  ASSERT_EQ(pairs.pairs.size(), 2u);
  EXPECT_EQ(pairs.pairs[0].name, "p2");
  EXPECT_EQ(pairs.pairs[0].reference, folder / "a/p2.png");
  EXPECT_EQ(pairs.pairs[0].other, folder / "b/p2.jpeg");
  EXPECT_EQ(pairs.pairs[1].name, "p3");
  EXPECT_EQ(pairs.pairs[1].mask, "");
  EXPECT_THAT(pairs.only_in_reference, ElementsAre("p1"));
  EXPECT_THAT(pairs.only_in_other, ElementsAre("p4"));
}

TEST(ImageFilePairs, FoldersOfCamerasAreRead) {
  const TempDir folder;
  for (const char* file : {"a/c1/0.png", "a/c2/0.png", "b/c2/0.png"}) Put(folder / file, "not opened");
  const ImageFilePairs pairs = PairImages(folder / "a", folder / "b", "");
  ASSERT_EQ(pairs.pairs.size(), 1u);
  EXPECT_EQ(pairs.pairs[0].name, "c2/0");
}

TEST(ImageFilePairs, OpacityLiesOverWhatTheOtherImageShowsThere) {
  const TempDir folder;
  Image truth = Noise(32, 32), render(32, 32, 4, 255);
  for (size_t i = 0; i < 32 * 32; ++i) {
    const bool clear = i % 32 < 12;
    for (size_t k = 0; k < 3; ++k) {
      if (clear) truth.pixels[3 * i + k] = 7;
      render.pixels[4 * i + k] = clear ? 255 : truth.pixels[3 * i + k];
    }
    render.pixels[4 * i + 3] = clear ? 0 : 255;
  }
  dataset::WriteImage(truth, folder / "truth.png"), dataset::WriteImage(render, folder / "render.png");
  ImageFilePairs pairs = PairImages(folder / "truth.png", folder / "render.png", "");
  pairs.backdrop = BackdropOf(pairs.pairs);
  EXPECT_EQ(ToString(pairs.backdrop), "the colour 7,7,7");
  ScorePairs(&pairs, {});
  EXPECT_NEAR(pairs.pairs[0].full.ssim, 1, 1e-12);
  EXPECT_TRUE(pairs.pairs[0].clear);
  pairs.backdrop = BackdropOf("white");
  ScorePairs(&pairs, {});
  EXPECT_LT(pairs.pairs[0].full.ssim, 0.9);
  EXPECT_THROW(BackdropOf("1,2,300"), UsageError);
}

TEST(ImageFilePairs, WhatCannotBePairedIsNamed) {
  const TempDir folder;
  for (const char* file : {"a/p1.png", "b/p2.png", "twice/p1.png", "twice/p1.jpg", "none/x.txt", "masks/q.png"})
    Put(folder / file, "x");
  const auto refused = [&](const char* other, const std::string& masks) {
    return MessageOf<IoError>([&] { PairImages(folder / "a", folder / other, masks); });
  };
  EXPECT_THAT(refused("missing", ""), HasSubstr(folder / "missing"));
  EXPECT_THAT(refused("none", ""), HasSubstr("no PNG or JPEG"));
  EXPECT_THAT(refused("b", ""), HasSubstr("no image has the name of one in " + (folder / "a")));
  EXPECT_THAT(refused("a", folder / "masks"), HasSubstr("has no mask called p1"));
  EXPECT_THAT(MessageOf<FormatError>([&] { PairImages(folder / "a", folder / "twice", ""); }), HasSubstr("p1"));
}

TEST(ImageFilePairs, EqualImagesAreAlikeAndAConstantHasItsDecibels) {
  const TempDir folder;
  dataset::WriteImage(Noise(24, 20), folder / "a/same.png");
  dataset::WriteImage(Noise(24, 20), folder / "b/same.png");
  dataset::WriteImage(Noise(24, 20), folder / "a/added.png");
  dataset::WriteImage(Noise(24, 20, 10), folder / "b/added.png");
  ImageFilePairs pairs = PairImages(folder / "a", folder / "b", "");
  ScorePairs(&pairs, {});
  ASSERT_EQ(pairs.pairs.size(), 2u);
  const ImageFilePair &added = pairs.pairs[0], &same = pairs.pairs[1];
  EXPECT_NEAR(same.full.ssim, 1, 1e-12);
  EXPECT_NEAR(same.full.ssim_luma, 1, 1e-12);
  EXPECT_NEAR(same.full.ssim_skimage, 1, 1e-12);
  EXPECT_TRUE(std::isinf(same.full.psnr_db));
  EXPECT_NEAR(added.full.psnr_db, 20 * std::log10(25.5), 1e-6);
  EXPECT_LT(added.full.ssim, 1);
  EXPECT_FALSE(added.masked || added.bbox);
  EXPECT_EQ(added.width, 24);
  EXPECT_EQ(added.height, 20);
}

TEST(ImageFilePairs, ImagesThatHaveNoScoreAreRefusedWithTheirSizes) {
  const TempDir folder;
  dataset::WriteImage(Noise(24, 20), folder / "a.png");
  dataset::WriteImage(Noise(25, 20), folder / "wider.png");
  dataset::WriteImage(Noise(24, 10), folder / "low.png");
  dataset::WriteImage(Image(24, 20, 1), folder / "nobody.png");
  Image low(24, 10, 1);
  std::fill_n(low.pixels.begin(), 24, uint8_t{255});
  dataset::WriteImage(low, folder / "low_mask.png");
  Put(folder / "text.png", "x");
  const auto refused = [&](const char* reference, const char* other, const char* mask) {
    ImageFilePairs pairs = PairImages(folder / reference, folder / other, *mask ? folder / mask : "");
    return MessageOf<FormatError>([&] { ScorePairs(&pairs, {}); });
  };
  EXPECT_THAT(refused("a.png", "wider.png", ""),
              HasSubstr("wider.png: is 25x20, its partner " + (folder / "a.png") + " is 24x20"));
  EXPECT_THAT(refused("low.png", "low.png", ""), HasSubstr("24x10, smaller than SSIM's window"));
  EXPECT_THAT(refused("a.png", "a.png", "low_mask.png"), HasSubstr("low_mask.png: is 24x10"));
  EXPECT_THAT(refused("a.png", "a.png", "nobody.png"), HasSubstr("nobody.png: is empty"));
  EXPECT_THAT(refused("a.png", "text.png", ""), HasSubstr("text.png"));
}

}  // namespace
}  // namespace mvstudio::stages
