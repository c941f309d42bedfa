#include "avatar/run/evaluate/subject.h"

#include <ATen/ATen.h>

#include <algorithm>

#include "avatar/data/safetensors.h"
#include "avatar/nets/generator.h"
#include "avatar/nets/sequence.h"
#include "avatar/scores/image_scores.h"
#include "avatar/splats/render.h"
#include "core/parallel.h"

namespace mvstudio::avatar {
namespace {

// The same views in images of another size; images and masks stay as they are and are not looked at.
AvatarPack AtSize(AvatarPack pack, int size_px) {
  const double ratio = static_cast<double>(size_px) / pack.size_px;
  pack.intrinsics = pack.intrinsics.clone();
  pack.intrinsics.slice(1, 0, 2).mul_(ratio);
  pack.intrinsics.slice(1, 2, 4).add_(0.5).mul_(ratio).sub_(0.5);
  pack.size_px = size_px;
  return pack;
}

at::Tensor Scaled(const at::Tensor& images, int size_px) {
  return images.size(2) == size_px ? images : at::_upsample_bilinear2d_aa(images, {size_px, size_px}, false);
}

RenderedRows RenderNetwork(Subject& subject, const TrainingSet& rows, int batch, const RunContext& run) {
  AvatarModel& model = *subject.network;
  AvatarPack pack = rows.pack;
  if (subject.references) FillReferences(*subject.references, rows.views, model.options, run.num_threads, &pack);
  ProgressStage stage(run, "rendering", pack.size());
  const RenderedPack rendered =
      RenderPack(model, AtSize(pack, model.size_px), std::max(1, batch), [&](int64_t count) { stage.Advance(count); });
  return {EightBit(Scaled(rendered.images, pack.size_px)),
          Scaled(rendered.masks.unsqueeze(1), pack.size_px).squeeze(1).to(at::kDouble)};
}

/// 8 bits (channels, H, W) of row i, from rows of pixels.
void FillRow(const Image& image, int64_t i, const at::Tensor& rows) {
  const at::Tensor hwc = at::from_blob(const_cast<uint8_t*>(image.pixels.data()),  // read only
                                       {image.height, image.width, image.channels}, at::kByte);
  rows[i].copy_(hwc.permute({2, 0, 1}));
}

RenderedRows RenderCloud(const splats::CloudFile& file, const RunConfig& config, const TrainingSet& rows,
                         const RunContext& run) {
  const int64_t n = rows.pack.size(), size = rows.pack.size_px;
  const at::Tensor images = at::zeros({n, 3, size, size}, at::kByte), masks = at::zeros({n, 1, size, size}, at::kByte);
  ProgressStage stage(run, "rendering", n);
  for (int64_t i = 0; i < n; ++i) {
    const RowView& view = rows.views[static_cast<size_t>(i)];
    const body::RenderedBody rendered = splats::RenderGaussians(file.cloud, config.pack.fitted->person.body, *view.vertices,
                                                                view.crop, {file.mip, run.num_threads});
    FillRow(rendered.image, i, images);
    FillRow(rendered.cover, i, masks);
    stage.Advance();
  }
  return {images.to(at::kDouble) / 255, masks.select(1, 0).to(at::kDouble) / 255};
}

Subject ReadNetwork(const std::string& run_folder, const RunConfig& config) {
  Subject subject;
  const std::string path = run_folder + "/" + kCheckpointFile;
  const TensorFile file = ReadTensorFile(path);
  subject.network = LoadModel(path);
  for (const auto& [key, value] : file.metadata) {
    const std::string prefix = key.substr(0, key.find('.') + 1);
    if (prefix == "model." || prefix == "train." || key == "seed" || key == "perceptual") subject.training[key] = value;
  }
  subject.step = subject.network->step;
  if (subject.step > 0) subject.num_parameters = NumParameters(subject.network->options);
  subject.references = ReadReferences(run_folder, config, subject.network->options);
  return subject;
}

}  // namespace

bool Subject::HasMemory() const { return network && NumPreviousChannels(network->options) > 0; }

Subject ReadSubject(const std::string& run_folder, const RunConfig& config) {
  if (!HoldsGaussians(run_folder)) return ReadNetwork(run_folder, config);
  Subject subject;
  const auto faces = static_cast<int>(config.pack.fitted->person.body.faces.cols());
  subject.gaussians = splats::ReadCloud(run_folder + "/" + kGaussiansFile, faces);
  const splats::CloudFile& file = *subject.gaussians;
  subject.training = file.options;
  if (file.options.empty())  // a file of an older version tells what became of them
    subject.training = {{"model.gaussians", std::to_string(file.cloud.size())},
                        {"model.colour-degree", std::to_string(file.cloud.values.degree)},
                        {"model.mip-filter", file.mip ? "true" : "false"},
                        {"train.steps", std::to_string(file.step)}};
  subject.training["model.method"] = "gaussians", subject.training["seed"] = std::to_string(file.seed);
  subject.step = file.step;
  ForEachGroup(file.cloud.values, [&](splats::Group, int, const std::vector<float>& array) {
    subject.num_parameters += static_cast<int64_t>(array.size());
  });
  return subject;
}

RenderedRows RenderRows(Subject& subject, const RunConfig& config, const TrainingSet& rows, int batch, const RunContext& run) {
  if (subject.gaussians) return RenderCloud(*subject.gaussians, config, rows, run);
  return RenderNetwork(subject, rows, batch, run);
}

}  // namespace mvstudio::avatar
