#include "calib/detect/corner_refine.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "calib/board/charuco_layout.h"
#include "core/random.h"
#include "core/statistics.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

/// A crossing of two edges in an image: where, its axes in px a square, the blur of a lens, and noise of the grey values.
struct Crossing {
  Eigen::Vector2d px{30.3, 29.6}, along_x{21, 4}, along_y{-6, 19};
  double blur_px = 1, contrast = 80, noise = 0;
};

constexpr int kCorner = 8;  // row 1, column 2
constexpr int kSize = 60;

Board Chessboard() { return ParseBoard("chessboard:6x5:50mm"); }

/// Grey values at the pixels' centres: the product of two edges, each the integral of a Gaussian.
Image Draw(const Crossing& c, Rng* rng) {
  const double sign = IsBlack(Chessboard(), {kCorner % 6, kCorner / 6}) ? -1 : 1;
  const auto edge = [&](const Eigen::Vector2d& d, const Eigen::Vector2d& along) {
    const double across = (along.x() * d.y() - along.y() * d.x()) / along.norm();
    return std::erf(across / (std::sqrt(2.0) * c.blur_px));
  };
  Image image(kSize, kSize, 1);
  for (int v = 0; v < kSize; ++v) {
    for (int u = 0; u < kSize; ++u) {
      const Eigen::Vector2d d = Eigen::Vector2d(u, v) - c.px;
      const double grey = 128 - sign * c.contrast * edge(d, c.along_x) * edge(d, c.along_y) + c.noise * rng->Normal();
      *image.Pixel(u, v) = static_cast<uint8_t>(std::lround(std::clamp(grey, 0.0, 255.0)));
    }
  }
  return image;
}

CornerGuess Guess(const Crossing& c, const Eigen::Vector2d& off = {1.1, -0.7}) {
  return {kCorner, c.px + off, c.along_x, c.along_y};
}

TEST(CornerRefine, FindsTheCrossingThatWasDrawn) {
  Rng rng(1);
  Crossing slanted, sharp, soft, flat;
  slanted.along_x = {18, 11}, slanted.along_y = {3, 20}, slanted.px = {28.75, 31.5};
  sharp.blur_px = 0.6, soft.blur_px = 2, flat.contrast = 20;
  for (const Crossing& c : {Crossing(), slanted, sharp, soft, flat}) {
    const RefinedCorner corner = RefineCorner(Chessboard(), Draw(c, &rng), Guess(c));
    ASSERT_EQ(corner.status, Status::kOk);
    EXPECT_LT((corner.px - c.px).norm(), 0.01) << c.px.transpose();
    EXPECT_LT(corner.misfit, 0.02);
  }
}

/// Scatter over many images with noise against the stated sigma. Pixels far away weigh less, so the stated one is larger.
TEST(CornerRefine, ItsSigmaIsThatOfNoisyImages) {
  Rng rng(2);
  for (const double noise : {2.0, 8.0}) {
    Crossing c;
    c.noise = noise;
    std::vector<double> normalized;
    for (int i = 0; i < 400; ++i) {
      const RefinedCorner corner = RefineCorner(Chessboard(), Draw(c, &rng), Guess(c));
      ASSERT_EQ(corner.status, Status::kOk);
      for (int k = 0; k < 2; ++k) normalized.push_back((corner.px[k] - c.px[k]) / corner.sigma_px);
    }
    EXPECT_GT(Rms(normalized), 0.75) << noise;
    EXPECT_LT(Rms(normalized), 1.05) << noise;
  }
}

TEST(CornerRefine, ThePatternInTheWrongColoursIsNone) {
  Rng rng(3);
  Crossing negative;
  negative.contrast = -80;
  EXPECT_NE(RefineCorner(Chessboard(), Draw(negative, &rng), Guess(negative)).status, Status::kOk);
}

/// Without contrast nothing says where the corner is, whatever contrast is asked for.
TEST(CornerRefine, APlainImageHasNoCorner) {
  const Image plain(kSize, kSize, 1, 128);
  EXPECT_NE(RefineCorner(Chessboard(), plain, Guess({})).status, Status::kOk);
  RefineOptions any_contrast;
  any_contrast.min_contrast = 0;
  EXPECT_NE(RefineCorner(Chessboard(), plain, Guess({}), any_contrast).status, Status::kOk);
}

TEST(CornerRefine, GuessesThatCannotBeRefined) {
  Rng rng(4);
  const Image image = Draw({}, &rng);
  CornerGuess lost = Guess({}), tiny = Guess({}), folded = Guess({}), outside = Guess({});
  lost.px.x() = std::numeric_limits<double>::quiet_NaN();
  tiny.along_x *= 0.1, tiny.along_y *= 0.1;
  folded.along_y = 1.01 * folded.along_x;
  outside.px = {1, 30};
  EXPECT_EQ(RefineCorner(Chessboard(), image, lost).status, Status::kNonFiniteInput);
  EXPECT_EQ(RefineCorner(Chessboard(), image, tiny).status, Status::kDegenerate);
  EXPECT_EQ(RefineCorner(Chessboard(), image, folded).status, Status::kDegenerate);
  EXPECT_EQ(RefineCorner(Chessboard(), image, outside).status, Status::kOutsideValidRadius);
}

}  // namespace
}  // namespace mvstudio::calib
