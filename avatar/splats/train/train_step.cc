#include "avatar/splats/train/train_step.h"

#include "avatar/splats/bend.h"
#include "core/check.h"
#include "core/parallel.h"

namespace mvstudio::splats {
namespace {

struct ImageResult {
  LossTerms loss;
  Parameters<float> gradient;
  std::vector<float> view_space;
  std::vector<int> seen;
  SkippedSplats skipped;
};

ImageResult ImageGradient(const Cloud& cloud, const Eigen::Matrix3Xi& faces, const TrainView& from, const LossWeights& weights,
                          const RenderSettings& settings) {
  ImageResult out;
  const PinholeView<float> view = ViewOf<float>(from.camera);
  const Surface<float> surface{faces, *from.vertices};
  const Projected<float> projected = ProjectSplats(cloud, surface, view, settings);
  const Tiles tiles = BinSplats(projected.splats, view.width, view.height);
  const RasterImage<float> image = Rasterise(projected.splats, tiles, view.width, view.height, settings.num_threads);
  RasterImage<float> by_image;
  out.loss = Loss(image, TruthOf<float>(from.image, from.mask), weights, &by_image);
  const std::vector<SplatGradient<float>> by_splat =
      RasteriseBackward(projected.splats, tiles, image, by_image, settings.num_threads);
  out.gradient = ZeroParameters<float>(cloud.size(), cloud.values.degree);
  out.view_space.assign(cloud.size(), 0.f), out.seen.assign(cloud.size(), 0);
  AddGradients(cloud, surface, view, settings, projected.splats, by_splat, &out.gradient, &out.view_space);
  for (const Splat<float>& splat : projected.splats) out.seen[static_cast<size_t>(splat.index)] = 1;
  out.skipped = projected.skipped;
  return out;
}

/// The same for a cloud with a corrective of poses.
ImageResult BentGradient(const Cloud& cloud, const Bending<float>& bending, const Eigen::Matrix3Xi& faces,
                         const TrainView& from, const LossWeights& weights, const RenderSettings& settings) {
  ImageResult out = ImageGradient(Bent(cloud, bending), faces, from, weights, settings);
  Parameters<float> gradient = out.gradient;
  gradient.bends = true, gradient.bend.assign(cloud.values.bend.size(), 0.f);
  AddBendGradient(cloud, bending, out.gradient, &gradient);
  out.gradient = std::move(gradient);
  return out;
}

void AddTerms(const LossTerms& from, double share, LossTerms* to) {
  to->l1 += share * from.l1, to->ssim += share * from.ssim, to->mask += share * from.mask, to->total += share * from.total;
}

void AddParameters(const Parameters<float>& from, float share, Parameters<float>* to) {
  std::vector<const std::vector<float>*> arrays;
  ForEachGroup(from, [&](Group, int, const std::vector<float>& array) { arrays.push_back(&array); });
  size_t group = 0;
  ForEachGroup(*to, [&](Group, int, std::vector<float>& array) {
    const std::vector<float>& other = *arrays[group++];
    for (size_t i = 0; i < array.size(); ++i) array[i] += share * other[i];
  });
}

}  // namespace

BatchResult BatchGradient(const Cloud& cloud, const Eigen::Matrix3Xi& faces, const std::vector<const TrainView*>& batch,
                          const BatchBends& bends, const LossWeights& weights, bool mip, int num_threads) {
  const int threads = ResolveThreads(num_threads), images = static_cast<int>(batch.size());
  const RenderSettings settings{mip, std::max(1, threads / std::max(1, images))};
  MVS_CHECK(!cloud.values.bends || bends.turns.size() == batch.size(), "turns of the bones are not those of the images");
  std::vector<ImageResult> results(batch.size());
  ParallelFor(images, threads, [&](int64_t i) {
    const auto at = static_cast<size_t>(i);
    results[at] = cloud.values.bends ? BentGradient(cloud, {bends.bones, bends.turns[at]}, faces, *batch[at], weights, settings)
                                     : ImageGradient(cloud, faces, *batch[at], weights, settings);
  });
  BatchResult out;
  out.gradient = ZeroParameters<float>(cloud.size(), cloud.values.degree, cloud.values.bends);
  out.view_space.assign(cloud.size(), 0.f), out.seen.assign(cloud.size(), 0);
  const double share = 1.0 / images;
  for (const ImageResult& result : results) {
    AddTerms(result.loss, share, &out.loss);
    AddParameters(result.gradient, static_cast<float>(share), &out.gradient);
    for (size_t i = 0; i < cloud.size(); ++i) out.view_space[i] += result.view_space[i], out.seen[i] += result.seen[i];
    out.skipped = result.skipped;
  }
  return out;
}

}  // namespace mvstudio::splats
