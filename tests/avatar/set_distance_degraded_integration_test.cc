// The distance grows with blur and noise, by the hand-made features and by PoseNet's, on photograph-like images of a person.
#include <ATen/ATen.h>

#include <cmath>
#include <cstdio>

#include "avatar/run/evaluate/posenet_features.h"
#include "avatar/scores/set_distance.h"
#include "core/error.h"
#include "core/format.h"
#include "core/random.h"
#include "dataset/footage/image_io.h"
#include "tests/support/test.h"
#include "tests/support/test_data.h"

namespace mvstudio::avatar {
namespace {

constexpr int64_t kImages = 24, kSizePx = 192;

/// The middle of images of six cameras, times spread over the take: (24, 3, 192, 192).
at::Tensor TestImages() {
  std::vector<at::Tensor> images;
  for (int64_t i = 0; i < kImages; ++i) {
    const std::string name = Format("/person_a/hdImgs/00_%02d/00_%02d_%08d.jpg", static_cast<int>(i % 6),
                                    static_cast<int>(i % 6), static_cast<int>(5 * i));
    const Image image = dataset::ReadImage(mvstudio::testing::DataRoot() + name);
    const at::Tensor bytes =
        at::from_blob(const_cast<uint8_t*>(image.pixels.data()), {image.height, image.width, 3}, at::kByte).clone();
    const int64_t top = (image.height - kSizePx) / 2, left = (image.width - kSizePx) / 2;
    images.push_back(bytes.slice(0, top, top + kSizePx).slice(1, left, left + kSizePx).permute({2, 0, 1}).to(at::kDouble) /
                     255);
  }
  return at::stack(images);
}

at::Tensor Blur(const at::Tensor& x, double sigma) {
  const auto r = static_cast<int64_t>(std::ceil(3 * sigma));
  at::Tensor k = at::exp(-at::arange(-r, r + 1, at::kDouble).square() / (2 * sigma * sigma));
  k = k / k.sum();
  const at::Tensor flat = x.reshape({-1, 1, x.size(2), x.size(3)});
  const at::Tensor rows = at::conv2d(at::replication_pad2d(flat, {r, r, 0, 0}), k.view({1, 1, 1, -1}));
  return at::conv2d(at::replication_pad2d(rows, {0, 0, r, r}), k.view({1, 1, -1, 1})).view(x.sizes());
}

at::Tensor Noise(at::IntArrayRef sizes) {
  Rng rng(3);
  at::Tensor noise = at::empty(sizes, at::kDouble);
  for (int64_t i = 0; i < noise.numel(); ++i) noise.data_ptr<double>()[i] = rng.Normal();
  return noise;
}

void ExpectToGrow(const FeatureNet& net) {
  const at::Tensor x = TestImages(), real = FeatureRows(net, x.to(at::kFloat)), noise = Noise(x.sizes());
  const auto distance = [&](const at::Tensor& worse) { return FrechetDistance(real, FeatureRows(net, worse.to(at::kFloat))); };
  double last = 0;
  for (const double sigma_px : {1.0, 2.0, 4.0}) {
    const double fd = distance(Blur(x, sigma_px));
    EXPECT_GT(fd, last) << net.name() << ", blur " << sigma_px;
    std::printf("%s, blur of %g px: FD %.4g\n", net.name().c_str(), sigma_px, fd);
    last = fd;
  }
  last = 0;
  for (const double sigma : {10.0, 25.0}) {
    const double fd = distance((x + sigma / 255 * noise).clamp(0, 1));
    EXPECT_GT(fd, last) << net.name() << ", noise " << sigma;
    std::printf("%s, noise of %g levels: FD %.4g\n", net.name().c_str(), sigma, fd);
    last = fd;
  }
}

TEST(DegradedImages, AreFartherTheWorseByGabor) {
  MVS_NEEDS_DATA("person_a");
  ExpectToGrow(*GaborNet());
}

TEST(DegradedImages, AreFartherTheWorseByPoseNet) {
  MVS_NEEDS_DATA("person_a");
  std::shared_ptr<const FeatureNet> net;
  try {
    net = PoseNetFeatures();
  } catch (const MissingToolError& error) {
    GTEST_SKIP() << error.what();
  }
  ExpectToGrow(*net);
}

}  // namespace
}  // namespace mvstudio::avatar
