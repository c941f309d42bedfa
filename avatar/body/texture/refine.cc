#include "avatar/body/texture/refine.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/check.h"
#include "core/parallel.h"
#include "core/units.h"

namespace mvstudio::body {
namespace {

/// Texels of one channel, (24, S, S) in [0, 1].
std::vector<float> ChannelOf(const Textures& textures, int channel) {
  std::vector<float> texels;
  for (const Image& chart : textures) {
    for (size_t i = static_cast<size_t>(channel); i < chart.pixels.size(); i += 3)
      texels.push_back(static_cast<float>(chart.pixels[i]) / 255);
  }
  return texels;
}

/// Weights of a place's four texels, in the order of memory.
struct Corners {
  size_t texel[4];
  float weight[4];
  Corners(uint32_t first, float right, float down, int size)
      : texel{first, first + size_t{1}, first + static_cast<size_t>(size), first + static_cast<size_t>(size) + 1},
        weight{(1 - right) * (1 - down), right * (1 - down), (1 - right) * down, right * down} {}
};

/// Adds the derivatives of towards |d|^2 + smooth times the squared differences of d between neighbours in a chart, of
/// d = texels - first. (24, S, S)
void AddPrior(const std::vector<float>& texels, const std::vector<float>& first, int size, const RefineOptions& options,
              std::vector<float>* gradient) {
  const auto towards = static_cast<float>(2 * options.towards_start), smooth = static_cast<float>(2 * options.smooth);
  const auto pull = [&](size_t a, size_t b) {
    const float slope = smooth * ((texels[a] - first[a]) - (texels[b] - first[b]));
    (*gradient)[a] += slope, (*gradient)[b] -= slope;
  };
  const auto width = static_cast<size_t>(size);
  for (size_t t = 0; t < texels.size(); ++t) {
    (*gradient)[t] += towards * (texels[t] - first[t]);
    if (t % width + 1 < width) pull(t, t + 1);
    if (t / width % width + 1 < width) pull(t, t + width);
  }
}

Image ResizedChart(const Image& chart, int size) {
  constexpr int kMostPlaces = 8;
  const double ratio = static_cast<double>(chart.width) / size;
  const int places = std::clamp(static_cast<int>(std::ceil(ratio)), 1, kMostPlaces);
  Image out(size, size, 3);
  for (int y = 0; y < size; ++y) {
    for (int x = 0; x < size; ++x) {
      Eigen::Array3d sum = Eigen::Array3d::Zero();
      for (int k = 0; k < places * places; ++k) {
        const Eigen::Vector2d share((k % places + 0.5) / places, (k / places + 0.5) / places);
        const Eigen::Vector2d at = ((Eigen::Vector2d(x, y) + share) * ratio).array() - 0.5;
        const auto colour = BilinearColour(chart, at.cwiseMax(0));
        for (int c = 0; c < 3; ++c) sum[c] += colour[c];
      }
      for (int c = 0; c < 3; ++c) out.Pixel(x, y)[c] = static_cast<uint8_t>(std::lround(sum[c] / (places * places)));
    }
  }
  return out;
}

}  // namespace

Textures ResizedTextures(const Textures& textures, int size_px) {
  MVS_CHECK(size_px >= 2 && textures[0].width >= 2, "charts of " << textures[0].width << " px and of " << size_px);
  Textures out;
  for (size_t k = 0; k < kNumParts; ++k)
    out[k] = textures[k].width == size_px ? textures[k] : ResizedChart(textures[k], size_px);
  return out;
}

TextureRefiner::TextureRefiner(const BodyTemplate& body, int size_px) : body_(body), size_px_(size_px) {
  MVS_CHECK(size_px >= 2 && size_px <= 1 << 13, "charts of " << size_px << " px");
}

TextureRefiner::Place TextureRefiner::PlaceOf(const PartUvMap& map, size_t at) const {
  const float u = std::max(0.0f, map.u[at] * static_cast<float>(size_px_) - 0.5f),
              v = std::max(0.0f, map.v[at] * static_cast<float>(size_px_) - 0.5f);
  const int x = std::clamp(static_cast<int>(u), 0, size_px_ - 2), y = std::clamp(static_cast<int>(v), 0, size_px_ - 2);
  const int first = ((map.part[at] - 1) * size_px_ + y) * size_px_ + x;
  return {static_cast<uint32_t>(first), std::clamp(u - static_cast<float>(x), 0.0f, 1.0f),
          std::clamp(v - static_cast<float>(y), 0.0f, 1.0f)};
}

void TextureRefiner::Add(const TextureView& view) {
  const Image &image = view.image, &mask = view.mask;
  MVS_CHECK(image.channels == 3 && mask.channels == 1 && mask.width == image.width && mask.height == image.height,
            "an image and its mask");
  const PartUvMap coarse = RasterizeBody(body_, view.vertices_in_world, view.camera),
                  fine = RasterizeBody(body_, view.vertices_in_world, FinerCamera(view.camera, kFiner));
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const Eigen::Vector2d px(x, y);
      const size_t middle = static_cast<size_t>(y) * image.width + x;
      if (coarse.part[middle] == 0 || !InsideMask(mask, px) || !NothingBefore(coarse, px, coarse.depth_m[middle])) continue;
      Places places;
      bool whole = true;
      for (int k = 0; k < kFiner * kFiner; ++k) {
        const size_t at = static_cast<size_t>(y * kFiner + k / kFiner) * fine.width + x * kFiner + k % kFiner;
        whole = whole && fine.part[at] != 0;
        if (whole) places[k] = PlaceOf(fine, at);
      }
      if (!whole) continue;
      places_.push_back(places);
      target_.push_back({image.Pixel(x, y)[0], image.Pixel(x, y)[1], image.Pixel(x, y)[2]});
    }
  }
}

double TextureRefiner::Loss(int channel, const std::vector<float>& texels, std::vector<float>* gradient) const {
  constexpr float kDelta = 0.5f / 255, kShare = 1.0f / (kFiner * kFiner);
  gradient->assign(texels.size(), 0);
  double loss = 0;
  for (size_t i = 0; i < places_.size(); ++i) {
    float colour = 0;
    for (const Place& place : places_[i]) {
      const Corners corners(place.texel, place.right, place.down, size_px_);
      for (int k = 0; k < 4; ++k) colour += kShare * corners.weight[k] * texels[corners.texel[k]];
    }
    const float off = colour - static_cast<float>(target_[i][static_cast<size_t>(channel)]) / 255;
    const float smooth = std::sqrt(off * off + kDelta * kDelta);
    loss += smooth;
    for (const Place& place : places_[i]) {
      const Corners corners(place.texel, place.right, place.down, size_px_);
      for (int k = 0; k < 4; ++k) (*gradient)[corners.texel[k]] += kShare * corners.weight[k] * off / smooth;
    }
  }
  return loss;
}

std::vector<float> TextureRefiner::RefineChannel(int channel, const Textures& start, const RefineOptions& options) const {
  constexpr float kFirst = 0.9f, kSecond = 0.999f, kEpsilon = 1e-8f;
  const std::vector<float> first = ChannelOf(start, channel);
  std::vector<float> texels = first, gradient, mean(texels.size(), 0), square(texels.size(), 0);
  for (int step = 1; step <= options.steps; ++step) {
    Loss(channel, texels, &gradient);
    AddPrior(texels, first, size_px_, options, &gradient);
    const double cosine = 0.55 + 0.45 * std::cos(kPi * (step - 1) / options.steps);
    const auto rate = static_cast<float>(options.rate * cosine);
    const float unbias_mean = 1 - static_cast<float>(std::pow(kFirst, step)),
                unbias_square = 1 - static_cast<float>(std::pow(kSecond, step));
    for (size_t t = 0; t < texels.size(); ++t) {
      const float slope = gradient[t];
      mean[t] = kFirst * mean[t] + (1 - kFirst) * slope;
      square[t] = kSecond * square[t] + (1 - kSecond) * slope * slope;
      const float move = mean[t] / unbias_mean / (std::sqrt(square[t] / unbias_square) + kEpsilon);
      texels[t] = std::clamp(texels[t] - rate * move, 0.0f, 1.0f);
    }
  }
  return texels;
}

double TextureRefiner::MeanDifference(const Textures& textures) const {
  if (target_.empty()) return std::numeric_limits<double>::quiet_NaN();
  std::vector<float> gradient;
  double sum = 0;
  for (int c = 0; c < 3; ++c) sum += Loss(c, ChannelOf(textures, c), &gradient);
  return 255 * sum / (3 * static_cast<double>(target_.size()));
}

Textures TextureRefiner::Refine(const Textures& start, const RefineOptions& options, const RunContext& run,
                                RefineReport* report) const {
  MVS_CHECK(options.steps >= 0 && options.rate > 0 && options.rate < 1 && options.towards_start >= 0 && options.smooth >= 0,
            "options of refinement");
  for (const Image& chart : start)
    MVS_CHECK(chart.width == size_px_ && chart.height == size_px_ && chart.channels == 3, "charts");
  Textures out = start;
  const size_t chart = static_cast<size_t>(size_px_) * size_px_;
  ProgressStage stage(run, "refining the texture", 3);
  ParallelFor(3, run.num_threads, [&](int64_t c) {
    const std::vector<float> texels = RefineChannel(static_cast<int>(c), start, options);
    for (size_t t = 0; t < texels.size(); ++t)
      out[t / chart].pixels[3 * (t % chart) + static_cast<size_t>(c)] = static_cast<uint8_t>(std::lround(255 * texels[t]));
  });
  stage.Advance(3);
  report->pixels = num_pixels();
  report->loss_before = MeanDifference(start), report->loss_after = MeanDifference(out);
  return out;
}

}  // namespace mvstudio::body
