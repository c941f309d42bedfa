#include "avatar/metrics/ssim.h"

#include <cmath>
#include <limits>

#include "avatar/metrics/psnr.h"
#include "avatar/metrics/ssim_window.h"
#include "core/error.h"
#include "core/random.h"
#include "tests/support/test.h"

namespace mvstudio::metrics {
namespace {

PlanarImage Constant(int width, int height, double value, double range = 1) {
  return {width, height, 1, range, std::vector<double>(static_cast<size_t>(width) * height, value)};
}

PlanarImage Noise(int width, int height, int channels, double range, uint64_t seed) {
  PlanarImage planar{width, height, channels, range, {}};
  Rng rng(seed);
  for (size_t i = 0; i < planar.PlaneSize() * static_cast<size_t>(channels); ++i)
    planar.samples.push_back(range * rng.Uniform());
  return planar;
}

PlanarImage Mixed(const PlanarImage& a, const PlanarImage& b, double share) {
  PlanarImage mixed = a;
  for (size_t i = 0; i < a.samples.size(); ++i) mixed.samples[i] = (1 - share) * a.samples[i] + share * b.samples[i];
  return mixed;
}

/// The definition, window by window in long double, in two passes.
double Definition(const PlanarImage& a, const PlanarImage& b, int side, double sigma, bool sample) {
  long double sum = 0;
  const int r = side / 2;
  const auto weight = [&](int x, int y) {
    return sigma > 0 ? std::exp(-static_cast<long double>(x * x + y * y) / (2 * sigma * sigma)) : 1.0L;
  };
  long double total = 0;
  for (int y = -r; y <= r; ++y)
    for (int x = -r; x <= r; ++x) total += weight(x, y);
  const long double scale = sample ? side * side / (side * side - 1.0L) : 1, c1 = 1e-4L, c2 = 9e-4L;
  const int rows = a.height - side + 1, cols = a.width - side + 1;
  for (int channel = 0; channel < a.channels; ++channel) {
    for (int top = 0; top < rows; ++top) {
      for (int left = 0; left < cols; ++left) {
        long double ma = 0, mb = 0, va = 0, vb = 0, cov = 0;
        for (int pass = 0; pass < 2; ++pass) {
          for (int y = 0; y < side; ++y) {
            for (int x = 0; x < side; ++x) {
              const size_t i = static_cast<size_t>(top + y) * a.width + left + x;
              const long double w = weight(x - r, y - r) / total, pa = a.Plane(channel)[i] / a.range,
                                pb = b.Plane(channel)[i] / a.range;
              if (pass == 0) ma += w * pa, mb += w * pb;
              if (pass == 1) va += w * (pa - ma) * (pa - ma), vb += w * (pb - mb) * (pb - mb), cov += w * (pa - ma) * (pb - mb);
            }
          }
        }
        sum += (2 * ma * mb + c1) * (2 * scale * cov + c2) / ((ma * ma + mb * mb + c1) * (scale * (va + vb) + c2));
      }
    }
  }
  return static_cast<double>(sum / (static_cast<long double>(rows) * cols * a.channels));
}

TEST(SsimWindow, IsAGaussianWithSumOne) {
  const auto weights = WangWeights();
  double sum = 0;
  for (int k = 0; k < kWangSide; ++k) {
    sum += weights[k];
    EXPECT_EQ(weights[k], weights[kWangSide - 1 - k]);
    EXPECT_NEAR(weights[k] / weights[5], std::exp(-(k - 5) * (k - 5) / 4.5), 1e-15);
  }
  EXPECT_NEAR(sum, 1, 1e-15);
}

TEST(Ssim, IsTheDefinition) {
  for (const double range : {1.0, 255.0, 65535.0}) {
    for (const double share : {0.0, 1e-7, 0.05, 0.5, 1.0}) {
      const PlanarImage a = Noise(37, 23, 3, range, 1), b = Mixed(a, Noise(37, 23, 3, range, 2), share);
      EXPECT_NEAR(Ssim(a, b).value, Definition(a, b, 11, 1.5, false), 1e-13) << range << " " << share;
      EXPECT_NEAR(Ssim(a, b, SsimWindow::kUniform7).value, Definition(a, b, 7, 0, true), 1e-13) << range << " " << share;
    }
  }
}

TEST(Ssim, ConstantsHaveAClosedForm) {
  const double c1 = 1e-4;
  for (const auto& [a, b] : {std::pair{0.6, 0.6}, {0.6, 0.6 + 1e-7}, {0.0, 1.0}, {0.0, 0.0}, {1.0, 1.0}, {0.25, 0.75}}) {
    const double expected = (2 * a * b + c1) / (a * a + b * b + c1);
    EXPECT_NEAR(Ssim(Constant(40, 30, a), Constant(40, 30, b)).value, expected, 1e-13) << a << " " << b;
    EXPECT_LE(Ssim(Constant(40, 30, a), Constant(40, 30, b)).value, 1.0);
  }
}

TEST(Ssim, EqualImagesAreOneAndNegativesStayAboveMinusOne) {
  const PlanarImage a = Noise(64, 48, 3, 1, 3);
  EXPECT_EQ(Ssim(a, a).value, 1.0);
  PlanarImage negative = a;
  for (double& v : negative.samples) v = 1 - v;
  const SsimMap map = ComputeSsimMap(a, negative);
  for (const double v : map.values) ASSERT_TRUE(v >= -1 && v <= 1);
  EXPECT_LT(Mean(map).value, -0.5);
}

TEST(Ssim, ThreadsDoNotChangeABit) {
  const PlanarImage a = Noise(301, 203, 3, 255, 4), b = Noise(301, 203, 3, 255, 5);
  EXPECT_EQ(ComputeSsimMap(a, b).values, ComputeSsimMap(a, b, SsimWindow::kWang2004, 7).values);
  EXPECT_EQ(Ssim(a, b).value, Ssim(a, b, SsimWindow::kWang2004, 7).value);
}

Image Bytes(int width, int height, int channels, uint64_t seed) {
  Image image(width, height, channels);
  Rng rng(seed);
  for (uint8_t& v : image.pixels) v = static_cast<uint8_t>(rng.Index(256));
  return image;
}

TEST(Ssim, OfBytesIsThatOfTheSameImageInDouble) {
  for (const int channels : {1, 2, 3}) {
    const Image a = Bytes(201, 57, channels, 20), b = Bytes(201, 57, channels, 21);
    const PlanarImage pa = FromImage(a), pb = FromImage(b);
    for (const SsimWindow window : {SsimWindow::kWang2004, SsimWindow::kUniform7}) {
      EXPECT_EQ(Ssim(a, b, window).value, Ssim(pa, pb, window).value) << channels;
      EXPECT_NEAR(Ssim(a, b, window).value, Mean(ComputeSsimMap(pa, pb, window)).value, 1e-14) << channels;
      if (channels == 2) continue;
      EXPECT_EQ(SsimOfLuma(a, b, window).value, SsimOfLuma(pa, pb, window).value) << channels;
      EXPECT_NEAR(SsimOfLuma(a, b, window).value, Ssim(Luma(pa), Luma(pb), window).value, 1e-14) << channels;
    }
    EXPECT_NEAR(PsnrDb(a, b).value, PsnrDb(pa, pb).value, 1e-12);
  }
  EXPECT_THROW(SsimOfLuma(Bytes(20, 20, 2, 1), Bytes(20, 20, 2, 2)), ContractViolation);
}

TEST(Ssim, EveryWidthIsCoveredOnce) {
  for (int width = 11; width < 150; width += 3) {
    const PlanarImage a = Noise(width, 13, 1, 1, 30), b = Noise(width, 13, 1, 1, 31);
    EXPECT_NEAR(Ssim(a, b).value, Definition(a, b, 11, 1.5, false), 1e-13) << width;
    EXPECT_NEAR(Ssim(a, b, SsimWindow::kUniform7).value, Definition(a, b, 7, 0, true), 1e-13) << width;
  }
}

TEST(Ssim, SixteenBitsAreNotEightBitsScaled) {
  PlanarImage a = Noise(40, 30, 1, 65535, 32);
  for (double& v : a.samples) v = std::floor(v);
  PlanarImage b = a;
  for (double& v : b.samples) v = std::max(0.0, v - 7);  // below a level of 8 bits
  EXPECT_NEAR(Ssim(a, b).value, Definition(a, b, 11, 1.5, false), 1e-13);
  EXPECT_LT(Ssim(a, b).value, 1);
}

TEST(Ssim, SmallestImageHasOneWindow) {
  const PlanarImage a = Noise(11, 11, 1, 1, 6), b = Noise(11, 11, 1, 1, 7);
  EXPECT_EQ(ComputeSsimMap(a, b).values.size(), 1u);
  EXPECT_EQ(Ssim(Noise(10, 40, 1, 1, 1), Noise(10, 40, 1, 1, 2)).status, Status::kTooSmall);
  EXPECT_EQ(Ssim(Noise(7, 7, 1, 1, 1), Noise(7, 7, 1, 1, 2), SsimWindow::kUniform7).status, Status::kOk);
}

TEST(Ssim, WhatHasNoValueSaysWhy) {
  const PlanarImage a = Noise(20, 20, 3, 1, 8);
  PlanarImage nan = a, outside = a, other = Noise(20, 21, 3, 1, 8), range = a;
  nan.samples[77] = std::numeric_limits<double>::quiet_NaN();
  outside.samples[3] = 1.01;
  range.range = 255;
  const std::pair<const PlanarImage*, Status> cases[] = {{&nan, Status::kNotFinite},
                                                         {&outside, Status::kOutsideRange},
                                                         {&other, Status::kSizesDiffer},
                                                         {&range, Status::kSizesDiffer}};
  for (const auto& [b, status] : cases) {
    for (const Score& score : {Ssim(a, *b), PsnrDb(a, *b)}) {
      EXPECT_EQ(score.status, status);
      EXPECT_TRUE(std::isnan(score.value));
    }
  }
  EXPECT_EQ(Ssim(PlanarImage(), PlanarImage()).status, Status::kTooSmall);
  EXPECT_EQ(Ssim(Image(), Image()).status, Status::kTooSmall);
  EXPECT_EQ(Ssim(Image(20, 20, 3), Image(20, 20, 1)).status, Status::kSizesDiffer);
}

TEST(Ssim, ABoxIsItsCutOut) {
  const PlanarImage a = Noise(50, 40, 3, 1, 9), b = Noise(50, 40, 3, 1, 10);
  const Box box{5, 7, 31, 29};
  const auto cut = [&](const PlanarImage& p) {
    PlanarImage out{box.x1 - box.x0, box.y1 - box.y0, 3, p.range, {}};
    for (int c = 0; c < 3; ++c)
      for (int y = box.y0; y < box.y1; ++y)
        out.samples.insert(out.samples.end(), p.Plane(c) + y * 50 + box.x0, p.Plane(c) + y * 50 + box.x1);
    return out;
  };
  EXPECT_NEAR(Mean(ComputeSsimMap(a, b), box).value, Ssim(cut(a), cut(b)).value, 1e-14);
  EXPECT_NEAR(PsnrDb(a, b, box).value, PsnrDb(cut(a), cut(b)).value, 1e-12);
  EXPECT_EQ(Mean(ComputeSsimMap(a, b), Box{0, 0, 10, 40}).status, Status::kNothingLeft);
}

TEST(Ssim, AMaskTakesTheWindowsAroundItsPixels) {
  const PlanarImage a = Noise(30, 30, 1, 1, 11), b = Noise(30, 30, 1, 1, 12);
  const SsimMap map = ComputeSsimMap(a, b);
  Mask mask(900, 0);
  mask[12 * 30 + 17] = 1;
  EXPECT_EQ(Mean(map, mask).value, map.values[7 * 20 + 12]);
  EXPECT_EQ(Mean(map, Mask(900, 0)).status, Status::kNothingLeft);
  EXPECT_EQ(Mean(map, Mask(900, 1)).value, Mean(map).value);
}

TEST(Psnr, IsTheDefinition) {
  EXPECT_NEAR(PsnrDb(Constant(8, 8, 0.5), Constant(8, 8, 0.6)).value, 20, 1e-12);
  EXPECT_NEAR(PsnrDb(Constant(8, 8, 0, 65535), Constant(8, 8, 65535, 65535)).value, 0, 1e-12);
  EXPECT_TRUE(std::isinf(PsnrDb(Constant(8, 8, 0.5), Constant(8, 8, 0.5)).value));
  PlanarImage a = Constant(4, 4, 0.5), b = a;
  b.samples[5] = 0.7;
  Mask mask(16, 0);
  mask[5] = mask[6] = 1;
  EXPECT_NEAR(PsnrDb(a, b, mask).value, -10 * std::log10(0.02), 1e-12);
  EXPECT_EQ(PsnrDb(a, b, Mask(16, 0)).status, Status::kNothingLeft);
}

TEST(Psnr, MeanIsOfDecibelsAndCountsInfiniteOnes) {
  const double inf = std::numeric_limits<double>::infinity();
  const PsnrSummary summary = MeanPsnr({20, 30, inf});
  EXPECT_EQ(summary.mean_db, 25);
  EXPECT_EQ(summary.num_infinite, 1);
  EXPECT_TRUE(std::isinf(MeanPsnr({inf}).mean_db));
  EXPECT_TRUE(std::isnan(MeanPsnr({}).mean_db));
}

TEST(Luma, IsBt601) {
  const PlanarImage rgb{1, 1, 3, 255, {100, 200, 50}};
  EXPECT_NEAR(Luma(rgb).samples[0], 0.299 * 100 + 0.587 * 200 + 0.114 * 50, 1e-12);
  EXPECT_THROW(Luma({1, 1, 2, 1, {0, 0}}), ContractViolation);
}

}  // namespace
}  // namespace mvstudio::metrics
