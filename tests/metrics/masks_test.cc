#include "avatar/metrics/masks.h"

#include <cmath>

#include "core/random.h"
#include "tests/support/test.h"

namespace mvstudio::metrics {
namespace {

Mask Square(int width, int height, const Box& box) {
  Mask mask(static_cast<size_t>(width) * height, 0);
  for (int y = box.y0; y < box.y1; ++y)
    for (int x = box.x0; x < box.x1; ++x) mask[static_cast<size_t>(y) * width + x] = 255;
  return mask;
}

TEST(Masks, IouOfSquares) {
  const Mask a = Square(20, 20, {0, 0, 10, 10}), b = Square(20, 20, {5, 0, 15, 10});
  EXPECT_DOUBLE_EQ(MaskIou(a, b), 50.0 / 150);
  EXPECT_EQ(MaskIou(Mask(9, 0), Mask(9, 0)), 1);
  EXPECT_EQ(MaskIou(Mask(9, 0), Mask(9, 1)), 0);
}

TEST(Masks, DistancesAreThoseOfAllPairs) {
  Rng rng(1);
  for (const auto& [width, height] : {std::pair{1, 9}, {9, 1}, {13, 7}, {31, 40}}) {
    Mask mask(static_cast<size_t>(width) * height, 0);
    for (int i = 0; i < 5; ++i) mask[static_cast<size_t>(rng.Index(width * height))] = 1;
    const std::vector<double> squared = SquaredDistances(mask, width, height);
    for (int i = 0; i < width * height; ++i) {
      double best = std::numeric_limits<double>::infinity();
      for (int j = 0; j < width * height; ++j) {
        const int dx = i % width - j % width, dy = i / width - j / width;
        if (mask[j]) best = std::min(best, double(dx * dx + dy * dy));
      }
      ASSERT_EQ(squared[i], best) << width << "x" << height << " at " << i;
    }
  }
  for (const double d : SquaredDistances(Mask(12, 0), 4, 3)) EXPECT_TRUE(std::isinf(d));
}

TEST(Masks, BoundaryFToleratesAShift) {
  const Mask a = Square(60, 60, {10, 10, 40, 40}), b = Square(60, 60, {12, 10, 42, 40});
  EXPECT_EQ(BoundaryF(a, a, 60, 60, 0), 1);
  EXPECT_EQ(BoundaryF(a, b, 60, 60, 2), 1);
  EXPECT_LT(BoundaryF(a, b, 60, 60, 1), 1);
  EXPECT_GT(BoundaryF(a, b, 60, 60, 1), BoundaryF(a, b, 60, 60, 0));
  EXPECT_EQ(BoundaryF(a, Mask(3600, 0), 60, 60, 5), 0);
  EXPECT_EQ(BoundaryF(Mask(3600, 0), Mask(3600, 0), 60, 60, 5), 1);
  EXPECT_EQ(BoundaryF(Mask(3600, 1), Mask(3600, 1), 60, 60, 5), 1) << "no outline at all";
}

TEST(Masks, BoxGrowsWithinTheImage) {
  const Mask mask = Square(100, 80, {30, 2, 50, 42});
  const Box box = MaskBox(mask, 100, 80, 0.05, 11);
  EXPECT_EQ(box.x0, 28);
  EXPECT_EQ(box.y0, 0);
  EXPECT_EQ(box.x1, 52);
  EXPECT_EQ(box.y1, 44);
  const Box tiny = MaskBox(Square(100, 80, {99, 79, 100, 80}), 100, 80, 0.05, 11);
  EXPECT_EQ(tiny.x1 - tiny.x0, 11);
  EXPECT_EQ(tiny.y1 - tiny.y0, 11);
  EXPECT_EQ(tiny.x1, 100);
  EXPECT_EQ(MaskBox(Mask(8000, 0), 100, 80, 0.05, 11).x1, 0);
}

TEST(Flicker, SeesOnlyWhatMovesInTheRender) {
  const auto image = [](double value) { return PlanarImage{4, 4, 1, 1, std::vector<double>(16, value)}; };
  const Mask all(16, 1);
  EXPECT_NEAR(Flicker(image(0.2), image(0.5), image(0.3), image(0.6), all, all).value, 0, 1e-15);
  EXPECT_NEAR(Flicker(image(0.2), image(0.2), image(0.3), image(0.4), all, all).value, 0.1, 1e-15);
  EXPECT_EQ(Flicker(image(0), image(0), image(0), image(0), all, Mask(16, 0)).status, Status::kNothingLeft);
}

}  // namespace
}  // namespace mvstudio::metrics
