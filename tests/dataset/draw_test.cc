#include "dataset/views/draw.h"

#include <array>
#include <cmath>
#include <limits>

#include "core/error.h"
#include "tests/support/test.h"

namespace mvstudio::dataset {
namespace {

using Pixel = std::array<int, 3>;

Pixel At(const Image& image, int x, int y) {
  const uint8_t* p = image.Pixel(x, y);
  return {p[0], p[1], p[2]};
}
size_t NumTouched(const Image& image) {
  size_t touched = 0;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) touched += At(image, x, y) != Pixel{0, 0, 0};
  }
  return touched;
}

TEST(Draw, ASegmentColoursByTheShareThatItCovers) {
  Image image(20, 10, 3);
  DrawSegment({3, 4}, {12, 4}, 2, {200, 100, 50}, &image);
  for (int x = 3; x <= 12; ++x) {
    EXPECT_EQ(At(image, x, 4), (Pixel{200, 100, 50})) << x;
    EXPECT_EQ(At(image, x, 5), (Pixel{100, 50, 25})) << "half a pixel of the line's half width reaches in, " << x;
    EXPECT_EQ(At(image, x, 6), (Pixel{0, 0, 0})) << x;
  }
  EXPECT_EQ(At(image, 13, 4), (Pixel{100, 50, 25})) << "its end is round";
  EXPECT_EQ(At(image, 15, 4), (Pixel{0, 0, 0}));
}

TEST(Draw, ADiscHasItsArea) {
  Image image(101, 101, 3);
  DrawDisc({50.3, 49.6}, 20, {255, 255, 255}, &image);
  double area = 0;
  for (int y = 0; y < 101; ++y) {
    for (int x = 0; x < 101; ++x) area += At(image, x, y)[0] / 255.0;
  }
  EXPECT_NEAR(area, M_PI * 20 * 20, 0.01 * M_PI * 20 * 20);
}

TEST(Draw, ARingLeavesItsMiddle) {
  Image image(41, 41, 3);
  DrawRing({20, 20}, 10, 2, {0, 255, 0}, &image);
  EXPECT_EQ(At(image, 20, 20), (Pixel{0, 0, 0}));
  for (const auto& [x, y] : {std::pair(30, 20), std::pair(10, 20), std::pair(20, 30), std::pair(20, 10)})
    EXPECT_EQ(At(image, x, y), (Pixel{0, 255, 0}));
}

TEST(Draw, WhatIsNotFiniteOrOutsideDrawsNothing) {
  Image image(20, 10, 3);
  const double none = std::numeric_limits<double>::quiet_NaN(), far = std::numeric_limits<double>::infinity();
  DrawSegment({none, 4}, {12, 4}, 2, {}, &image);
  DrawSegment({1, 4}, {far, 4}, 2, {}, &image);
  DrawDisc({-50, 4}, 10, {}, &image);
  DrawDisc({1e300, -1e300}, 10, {}, &image);
  EXPECT_EQ(NumTouched(image), 0u);
  DrawSegment({-1e9, 5}, {1e9, 5}, 1, {}, &image);
  EXPECT_EQ(NumTouched(image), 20u) << "the row, cut at both sides";
}

TEST(Draw, TheOutlineOfAMask) {
  Image image(10, 10, 3), mask(10, 10, 1);
  for (int y = 3; y < 7; ++y) {
    for (int x = 2; x < 8; ++x) *mask.Pixel(x, y) = 255;
  }
  DrawMaskOutline(mask, {255, 0, 0}, &image);
  EXPECT_EQ(NumTouched(image), 2u * 6 + 2u * 4 - 4);
  EXPECT_EQ(At(image, 4, 4), (Pixel{0, 0, 0})) << "inside";
  EXPECT_THROW(DrawMaskOutline(Image(9, 10, 1), {}, &image), ContractViolation);
}

TEST(Draw, PastesWhatFits) {
  Image image(6, 6, 3);
  PasteImage(Image(4, 4, 3, 9), 4, -2, &image);
  EXPECT_EQ(NumTouched(image), 2u * 2);
  PasteImage(Image(4, 4, 3, 9), 40, 40, &image);
  EXPECT_EQ(NumTouched(image), 2u * 2);
}

}  // namespace
}  // namespace mvstudio::dataset
