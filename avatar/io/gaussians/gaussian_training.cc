#include "avatar/io/gaussians/gaussian_training.h"

#include <ATen/ATen.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "core/check.h"
#include "core/format.h"
#include "core/statistics.h"
#include "splats/render.h"

namespace mvstudio::avatar {
namespace {

/// (channels, H, W) uint8 -> picture.
Image ToImage(const at::Tensor& chw) {
  const at::Tensor hwc = chw.permute({1, 2, 0}).contiguous();
  Image image(static_cast<int>(hwc.size(1)), static_cast<int>(hwc.size(0)), static_cast<int>(hwc.size(2)));
  std::copy_n(hwc.data_ptr<uint8_t>(), image.pixels.size(), image.pixels.begin());
  return image;
}

std::vector<int> DegreesOf(ColourDegree degree, bool validation) {
  switch (degree) {
    case ColourDegree::kZero:
      return {0};
    case ColourDegree::kOne:
      return {1};
    case ColourDegree::kTwo:
      return {2};
    case ColourDegree::kAuto:
      break;
  }
  return validation ? std::vector<int>{0, 1, 2} : std::vector<int>{0};
}

/// Copies a picture of three channels into a sheet.
void Paste(const Image& picture, int x0, int y0, Image* sheet) {
  for (int y = 0; y < picture.height; ++y)
    std::copy_n(picture.Pixel(0, y), static_cast<size_t>(3) * picture.width, sheet->Pixel(x0, y0 + y));
}

}  // namespace

std::vector<splats::TrainView> TrainViewsOf(const AvatarPack& pack, const std::vector<PackView>& views) {
  MVS_CHECK(static_cast<int64_t>(views.size()) == pack.size(), views.size() << " views of " << pack.size() << " images");
  std::vector<splats::TrainView> out(views.size());
  for (int64_t i = 0; i < pack.size(); ++i) {
    splats::TrainView& view = out[static_cast<size_t>(i)];
    view.camera = views[static_cast<size_t>(i)].crop;
    view.vertices = views[static_cast<size_t>(i)].vertices;
    view.image = ToImage(pack.images[i]);
    view.mask = ToImage(pack.masks[i].unsqueeze(0));
    view.name = PictureName(pack, i);
  }
  return out;
}

splats::TrainOptions TrainOptionsOf(const GaussianOptions& gaussians, const TrainOptions& networks,
                                    const std::function<bool(const std::string&)>& given) {
  Validate(gaussians), Validate(networks);
  splats::TrainOptions out;
  out.count = gaussians.gaussians;
  out.densify = gaussians.densify, out.smooth = gaussians.mip_filter;
  if (given("steps")) out.steps = networks.steps;
  if (given("batch")) out.batch = networks.batch;
  if (given("save-every")) out.check_every = networks.save_every;
  if (given("weight-l1")) out.weights.l1 = networks.weight_l1;
  if (given("weight-ssim")) out.weights.ssim = networks.weight_ssim;
  if (given("weight-mask")) out.weights.mask = networks.weight_mask;
  return out;
}

GaussianTraining TrainGaussians(const body::TexturedPerson& fitted, const std::vector<splats::TrainView>& views,
                                const std::vector<splats::TrainView>& validation, ColourDegree degree,
                                const splats::TrainOptions& options, const RunContext& run,
                                const std::function<void(int, const splats::TrainRow&, const splats::Cloud&)>& on_row) {
  const std::vector<int> degrees = DegreesOf(degree, !validation.empty());
  std::vector<GaussianTraining> trained;
  std::vector<HeldOutCandidate> candidates;
  for (const int d : degrees) {
    GaussianTraining one;
    one.options = options;
    one.options.degree = d;
    const auto look = [&](const splats::TrainRow& row, const splats::Cloud& cloud) {
      if (on_row) on_row(d, row, cloud);
    };
    one.result = splats::TrainCloud(fitted.person.body, fitted.textures, views, validation, one.options, run, look);
    HeldOutCandidate candidate{"degree " + std::to_string(d), {}};
    for (const double ssim : one.result.validation_ssim) candidate.units.push_back(1 - ssim);
    candidates.push_back(candidate);
    trained.push_back(std::move(one));
    if (trained.back().result.status != Status::kOk) return trained.back();
  }
  size_t chosen = 0;
  std::string reason =
      degree == ColourDegree::kAuto ? "no validation images: colours do not depend on the direction" : "as asked for";
  if (degrees.size() > 1) {
    const HeldOutChoice choice = ChooseHeldOut(candidates, HeldOutRule{});
    chosen = static_cast<size_t>(choice.index), reason = choice.reason;
  }
  std::vector<DegreeTrial> trials;
  for (const GaussianTraining& one : trained)
    trials.push_back({one.options.degree, Mean(one.result.validation_ssim), static_cast<int64_t>(one.result.cloud.size())});
  GaussianTraining out = std::move(trained[chosen]);
  out.trials = trials, out.reason = reason;
  return out;
}

Image GaussianSheet(const splats::Cloud& cloud, const body::BodyTemplate& body, const std::vector<splats::TrainView>& views,
                    bool mip, int num_threads) {
  const size_t count = std::min<size_t>(views.size(), 6);
  const int width = views.front().image.width, height = views.front().image.height;
  Image sheet(static_cast<int>(count) * width, 3 * height, 3);
  for (size_t k = 0; k < count; ++k) {
    const splats::TrainView& view = views[(2 * k + 1) * views.size() / (2 * count)];
    Image truth = view.image;
    for (size_t i = 0; i < view.mask.pixels.size(); ++i)
      for (size_t c = 0; c < 3 && view.mask.pixels[i] < 128; ++c) truth.pixels[3 * i + c] = 0;
    Image shown = splats::RenderGaussians(cloud, body, *view.vertices, view.camera, {mip, num_threads}).image;
    Image error = shown;
    for (size_t i = 0; i < error.pixels.size(); ++i)
      error.pixels[i] = static_cast<uint8_t>(std::abs(static_cast<int>(truth.pixels[i]) - static_cast<int>(shown.pixels[i])));
    int row = 0;
    for (const Image* picture : {&truth, &shown, &error}) Paste(*picture, static_cast<int>(k) * width, height * row++, &sheet);
  }
  return sheet;
}

}  // namespace mvstudio::avatar
