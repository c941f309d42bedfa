#include "avatar/run/gaussians/gaussian_training.h"

#include <ATen/ATen.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <iterator>
#include <set>

#include "avatar/run/pack/pack_rows.h"
#include "avatar/splats/render.h"
#include "core/check.h"
#include "core/statistics.h"

namespace mvstudio::avatar {
namespace {

/// The degree that was asked for; nothing for kAuto.
std::vector<int> DegreeOf(ColourDegree degree) {
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
  return {};
}

using OnRow = std::function<void(int, const splats::TrainRow&, const splats::Cloud&)>;

/// A training with each degree; the last one is one that did not converge.
std::vector<GaussianTraining> TrainEach(const body::TexturedPerson& fitted, const std::vector<splats::TrainView>& views,
                                        const std::vector<splats::TrainView>& validation, const std::vector<int>& degrees,
                                        const splats::TrainOptions& options, const RunContext& run, const OnRow& on_row) {
  std::vector<GaussianTraining> out;
  for (const int degree : degrees) {
    GaussianTraining one;
    one.options = options, one.options.degree = degree;
    const auto look = [&](const splats::TrainRow& row, const splats::Cloud& cloud) {
      if (on_row) on_row(degree, row, cloud);
    };
    one.result = splats::TrainCloud(fitted.person.body, fitted.textures, views, validation, one.options, run, look);
    out.push_back(std::move(one));
    if (out.back().result.status != Status::kOk) break;
  }
  return out;
}

/// The trainings' scores, and which of them is taken.
struct DegreeChoice {
  size_t index = 0;
  std::string reason;
  std::vector<DegreeTrial> trials;
};

DegreeChoice ChooseDegree(const std::vector<GaussianTraining>& trained) {
  DegreeChoice out;
  std::vector<HeldOutCandidate> candidates;
  for (const GaussianTraining& one : trained) {
    const splats::TrainResult& result = one.result;
    out.trials.push_back({one.options.degree, Mean(result.validation_ssim), static_cast<int64_t>(result.cloud.size())});
    HeldOutCandidate candidate{"degree " + std::to_string(one.options.degree), {}};
    for (const double ssim : result.validation_ssim) candidate.units.push_back(1 - ssim);
    candidates.push_back(candidate);
  }
  const HeldOutChoice choice = ChooseHeldOut(candidates, HeldOutRule{});
  out.index = static_cast<size_t>(choice.index), out.reason = choice.reason;
  return out;
}

/// The images with those of the middle camera, at most 24 of them, as validation images; without any for fewer than three.
GaussianImages LeaveCameraOut(const GaussianImages& images) {
  constexpr size_t kFewest = 3, kMost = 24;
  const std::set<int64_t> cameras(images.camera.begin(), images.camera.end());
  GaussianImages out;
  if (cameras.size() < kFewest) return out;
  const int64_t left_out = *std::next(cameras.begin(), static_cast<std::ptrdiff_t>(cameras.size() / 2));
  std::vector<size_t> apart;
  for (size_t i = 0; i < images.train.size(); ++i) {
    if (images.camera[i] == left_out)
      apart.push_back(i);
    else
      out.train.push_back(images.train[i]);
  }
  const size_t count = std::min(kMost, apart.size());
  for (size_t k = 0; k < count; ++k) out.validation.push_back(images.train[apart[(2 * k + 1) * apart.size() / (2 * count)]]);
  return out;
}

/// Copies an image of three channels into a sheet.
void Paste(const Image& image, int x0, int y0, Image* sheet) {
  for (int y = 0; y < image.height; ++y)
    std::copy_n(image.Pixel(0, y), static_cast<size_t>(3) * image.width, sheet->Pixel(x0, y0 + y));
}

}  // namespace

std::vector<splats::TrainView> TrainViewsOf(const AvatarPack& pack, const std::vector<RowView>& views) {
  MVS_CHECK(static_cast<int64_t>(views.size()) == pack.size(), views.size() << " views of " << pack.size() << " images");
  std::vector<splats::TrainView> out(views.size());
  for (int64_t i = 0; i < pack.size(); ++i) {
    splats::TrainView& view = out[static_cast<size_t>(i)];
    view.camera = views[static_cast<size_t>(i)].crop;
    view.vertices = views[static_cast<size_t>(i)].vertices;
    view.image = ImageOfBytes(pack.images[i]);
    view.mask = ImageOfBytes(pack.masks[i].unsqueeze(0));
    view.name = ImageName(pack, i);
  }
  return out;
}

splats::TrainOptions TrainOptionsOf(const GaussianOptions& gaussians, const TrainOptions& networks,
                                    const std::function<bool(const std::string&)>& given) {
  Validate(gaussians), Validate(networks);
  splats::TrainOptions out;
  out.count = gaussians.gaussians;
  out.densify = gaussians.densify, out.smooth = gaussians.mip_filter, out.bends = gaussians.pose_corrective;
  if (given("steps")) out.steps = networks.steps;
  if (given("batch")) out.batch = networks.batch;
  if (given("save-every")) out.check_every = networks.save_every;
  if (given("weight-l1")) out.weights.l1 = networks.weight_l1;
  if (given("weight-ssim")) out.weights.ssim = networks.weight_ssim;
  if (given("weight-mask")) out.weights.mask = networks.weight_mask;
  return out;
}

GaussianTraining TrainGaussians(const body::TexturedPerson& fitted, const GaussianImages& images, ColourDegree degree,
                                const splats::TrainOptions& options, const RunContext& run, const OnRow& on_row) {
  MVS_CHECK(images.camera.size() == images.train.size(), "cameras of other images");
  std::vector<int> degrees = DegreeOf(degree);
  DegreeChoice choice{0, "as asked for", {}};
  if (degrees.empty() && images.validation.empty()) {
    const GaussianImages apart = LeaveCameraOut(images);
    choice.reason = "fewer than three cameras cannot show that colours depend on the direction";
    degrees = {0};
    if (!apart.validation.empty()) {
      splats::TrainOptions few = options;
      few.steps = std::max(1, options.steps / 3);
      std::vector<GaussianTraining> trials = TrainEach(fitted, apart.train, apart.validation, {0, 1, 2}, few, run, {});
      if (trials.back().result.status != Status::kOk) return std::move(trials.back());
      choice = ChooseDegree(trials);
      choice.reason += ", on a camera left out";
      degrees = {trials[choice.index].options.degree};
    }
  }
  const bool undecided = degrees.empty();
  if (undecided) degrees = {0, 1, 2};
  std::vector<GaussianTraining> trained = TrainEach(fitted, images.train, images.validation, degrees, options, run, on_row);
  if (trained.back().result.status != Status::kOk) return std::move(trained.back());
  if (undecided) choice = ChooseDegree(trained);
  GaussianTraining out = std::move(trained[undecided ? choice.index : 0]);
  out.trials = choice.trials, out.reason = choice.reason;
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
    for (const Image* tile : {&truth, &shown, &error}) Paste(*tile, static_cast<int>(k) * width, height * row++, &sheet);
  }
  return sheet;
}

}  // namespace mvstudio::avatar
