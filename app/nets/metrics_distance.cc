#include "app/nets/metrics_distance.h"

#include <ATen/ATen.h>
#include <ATen/Parallel.h>

#include <algorithm>
#include <filesystem>

#include "avatar/data/safetensors.h"
#include "avatar/io/evaluate/posenet_features.h"
#include "avatar/scores/set_distance.h"
#include "core/disk/npy.h"
#include "core/error.h"
#include "core/parallel.h"
#include "dataset/footage/image_io.h"

namespace mvstudio::app {
namespace {

struct Features {
  at::Tensor rows;
  std::string name;
};

Features ReadNpyFeatures(const std::string& path) {
  const NpyArray array = ReadNpy(path);
  if (array.shape.size() != 2) throw FormatError(path, "shape", "must be (images, dimensions)");
  return {at::tensor(array.values, at::kDouble).view({array.shape[0], array.shape[1]}), "unnamed"};
}

Features ReadTensorFeatures(const std::string& path) {
  const avatar::TensorFile file = avatar::ReadTensorFile(path, false);
  const auto found = file.tensors.find("features");
  if (found == file.tensors.end() || found->second.dim() != 2 || !found->second.is_floating_point())
    throw FormatError(path, "features", "must be a floating-point tensor of (images, dimensions)");
  const auto named = file.metadata.find("features");
  return {found->second.to(at::kDouble), named == file.metadata.end() ? "unnamed" : named->second};
}

Features ReadFeatures(const std::string& path) {
  const Features features =
      std::filesystem::path(path).extension() == ".npy" ? ReadNpyFeatures(path) : ReadTensorFeatures(path);
  if (features.rows.size(0) < 4) throw FormatError(path, "features", "has fewer than 4 rows");
  if (!at::isfinite(features.rows).all().item<bool>()) throw FormatError(path, "features", "holds NaN or infinity");
  return features;
}

DistanceResult ToResult(const avatar::SetDistance& s, const std::string& sha256 = "") {
  const std::string name = avatar::DistanceName(s.features, sha256);
  return {s.fd, s.floor, s.kid.value, s.kid.standard_error, s.n, s.n_other, s.d, s.features, name};
}

at::Tensor ReadPicture(const std::string& path) {
  const Image image = dataset::ReadImage(path);
  const at::Tensor bytes =
      at::from_blob(const_cast<uint8_t*>(image.pixels.data()), {image.height, image.width, image.channels}, at::kByte);
  return (bytes.to(at::kFloat) / 255).permute({2, 0, 1}).unsqueeze(0).contiguous();
}

at::Tensor RowsOf(const std::vector<std::string>& paths, const avatar::FeatureNet& net, ProgressStage* stage) {
  std::vector<at::Tensor> rows;
  for (const std::string& path : paths) {
    const at::Tensor picture = ReadPicture(path);
    if (std::min(picture.size(2), picture.size(3)) < 32) throw FormatError(path, "", "is smaller than 32 px");
    rows.push_back(avatar::FeatureRows(net, picture));
    stage->Advance();
  }
  return at::cat(rows);
}

}  // namespace

DistanceResult CompareFeatureFiles(const std::string& reference, const std::string& other, const RunContext& run) {
  at::set_num_threads(ResolveThreads(run.num_threads));
  const Features a = ReadFeatures(reference), b = ReadFeatures(other);
  if (a.rows.size(1) != b.rows.size(1)) {
    throw FormatError(
        other, "features",
        "has " + std::to_string(b.rows.size(1)) + " dimensions, " + reference + " has " + std::to_string(a.rows.size(1)));
  }
  if (a.name != b.name)
    throw FormatError(other, "__metadata__.features",
                      "is '" + b.name + "', in " + reference + " it is '" + a.name + "': not comparable");
  return ToResult(avatar::CompareFeatures(a.rows, b.rows, a.name, run.seed));
}

DistanceResult ComparePictureSets(const std::vector<std::string>& reference, const std::vector<std::string>& other,
                                  const std::string& net_name, const RunContext& run) {
  at::set_num_threads(ResolveThreads(run.num_threads));
  std::shared_ptr<const avatar::FeatureNet> net = net_name == "gabor" ? nullptr : avatar::FeatureNetByName(net_name);
  if (!net) net = avatar::GaborNet();
  ProgressStage stage(run, "features (" + net->name() + ")", static_cast<int64_t>(reference.size() + other.size()));
  const at::Tensor a = RowsOf(reference, *net, &stage), b = RowsOf(other, *net, &stage);
  return ToResult(avatar::CompareFeatures(a, b, net->name(), run.seed), net->sha256());
}

}  // namespace mvstudio::app
