#include "stages/nets/metrics_distance.h"

#include <ATen/ATen.h>
#include <ATen/Parallel.h>

#include <algorithm>
#include <filesystem>
#include <limits>
#include <map>
#include <optional>

#include "avatar/data/safetensors.h"
#include "avatar/run/evaluate/posenet_features.h"
#include "avatar/scores/set_distance.h"
#include "core/disk/files.h"
#include "core/disk/npy.h"
#include "core/disk/npy_write.h"
#include "core/error.h"
#include "core/join.h"
#include "core/parallel.h"
#include "dataset/arrays/npz.h"

namespace mvstudio::stages {
namespace {

constexpr char kUnnamed[] = "unnamed";

/// Rows where they are known, else the Gaussian alone.
struct Features {
  at::Tensor rows;
  std::optional<avatar::GaussianFit> gaussian;
  int64_t n = 0, d = 0;
  std::string name = kUnnamed, sha256;
};

at::Tensor ToTensor(const NpyArray& array) {
  return at::tensor(array.values, at::kDouble).view(at::IntArrayRef(array.shape.data(), array.shape.size()));
}

Features ReadNpyFeatures(const std::string& path) {
  const NpyArray array = ReadNpy(path);
  if (array.shape.size() != 2) throw FormatError(path, "shape", "must be (images, dimensions)");
  Features features;
  features.rows = ToTensor(array);
  return features;
}

Features ReadTensorFeatures(const std::string& path) {
  const avatar::TensorFile file = avatar::ReadTensorFile(path, false);
  const auto found = file.tensors.find("features");
  if (found == file.tensors.end() || found->second.dim() != 2 || !found->second.is_floating_point())
    throw FormatError(path, "features", "must be a floating-point tensor of (images, dimensions)");
  const auto named = file.metadata.find("features");
  Features features;
  features.rows = found->second.to(at::kDouble);
  if (named != file.metadata.end()) features.name = named->second;
  return features;
}

/// What else such archives hold.
std::string KindOfNpz(const std::map<std::string, std::string>& members) {
  const auto has = [&](const char* name) { return members.count(name) > 0; };
  if (has("poses") && has("trans")) return "motion in AMASS's layout";
  if (has("v_template") || has("shapedirs")) return "a body in SMPL's layout";
  if (has("arr_0")) return "arrays without names";
  return "something else";
}

/// Variances are not negative, and no correlation is beyond 1.
void RequireCorrelations(const at::Tensor& covariance, const std::string& path) {
  constexpr double kRounding = 1e-6;
  const at::Tensor variance = covariance.diagonal();
  const double most = covariance.abs().max().item<double>();
  const bool negative = variance.min().item<double>() < -kRounding * most;
  const at::Tensor bound = at::outer(variance, variance).clamp_min(0).sqrt() + kRounding * most;
  if (negative || (covariance.abs() > bound).any().item<bool>())
    throw FormatError(
        path, "sigma",
        negative ? "has negative variances: it is no covariance" : "has correlations beyond 1: it is no covariance");
}

Features StatisticsOf(const std::map<std::string, std::string>& members, const std::string& path) {
  const NpyArray mu = ParseNpy(members.at("mu"), path + ": mu"), sigma = ParseNpy(members.at("sigma"), path + ": sigma");
  if (mu.shape.size() != 1 || sigma.shape != std::vector<int64_t>{mu.shape[0], mu.shape[0]} || mu.shape[0] == 0)
    throw FormatError(path, "mu, sigma", "must be (d) and (d, d)");
  const at::Tensor mean = ToTensor(mu), covariance = ToTensor(sigma);
  if (!at::isfinite(mean).all().item<bool>() || !at::isfinite(covariance).all().item<bool>())
    throw FormatError(path, "mu, sigma", "hold NaN or infinity");
  const double most = covariance.abs().max().item<double>();
  if ((covariance - covariance.t()).abs().max().item<double>() > 1e-6 * most)
    throw FormatError(path, "sigma", "is not symmetric");
  RequireCorrelations(covariance, path);
  Features features;
  features.gaussian = avatar::GaussianOf(mean, covariance);
  features.d = mu.shape[0];
  if (members.count("n")) features.n = static_cast<int64_t>(ParseNpy(members.at("n"), path + ": n").values.at(0));
  if (members.count("features")) features.name = ParseNpyTexts(members.at("features"), path + ": features").at(0);
  if (members.count("sha256")) features.sha256 = ParseNpyTexts(members.at("sha256"), path + ": sha256").at(0);
  return features;
}

Features ReadNpzFeatures(const std::string& path) {
  const std::map<std::string, std::string> members = dataset::ReadNpzMembers(path);
  if (members.count("mu") && members.count("sigma")) return StatisticsOf(members, path);
  if (!members.count("features"))
    throw FormatError(path, "", "holds " + KindOfNpz(members) + " (" + Join(members, ", ", [](const auto& member) {
                                  return member.first;
                                }) + "): neither statistics (mu, sigma) nor features");
  const NpyArray array = ParseNpy(members.at("features"), path + ": features");
  if (array.shape.size() != 2) throw FormatError(path, "features", "must be (images, dimensions)");
  Features features;
  features.rows = ToTensor(array);
  return features;
}

Features Checked(Features features, const std::string& path) {
  if (features.gaussian) return features;
  features.n = features.rows.size(0), features.d = features.rows.size(1);
  if (features.n < 4) throw FormatError(path, "features", "has fewer than 4 rows");
  if (!at::isfinite(features.rows).all().item<bool>()) throw FormatError(path, "features", "holds NaN or infinity");
  return features;
}

Features ReadFeatures(const std::string& path) {
  const std::string extension = std::filesystem::path(path).extension().string();
  return Checked(extension == ".npy"   ? ReadNpyFeatures(path)
                 : extension == ".npz" ? ReadNpzFeatures(path)
                                       : ReadTensorFeatures(path),
                 path);
}

at::Tensor ReadScoredImage(const std::string& path, const Backdrop& backdrop) {
  const Image image = ReadOver(path, backdrop);
  const at::Tensor bytes =
      at::from_blob(const_cast<uint8_t*>(image.pixels.data()), {image.height, image.width, image.channels}, at::kByte);
  return (bytes.to(at::kFloat) / 255).permute({2, 0, 1}).unsqueeze(0).contiguous();
}

using NetPointer = std::shared_ptr<const avatar::FeatureNet>;

Features FeaturesOfImages(const DistanceSide& side, const NetPointer& net, const Backdrop& backdrop, const RunContext& run) {
  if (side.images.size() < 4)
    throw FormatError(side.path, "", "a distance needs at least 4 images, here are " + std::to_string(side.images.size()));
  ProgressStage stage(run, "features (" + net->name() + ")", static_cast<int64_t>(side.images.size()));
  std::vector<at::Tensor> rows;
  for (const std::string& path : side.images) {
    const at::Tensor image = ReadScoredImage(path, backdrop);
    if (std::min(image.size(2), image.size(3)) < 32) throw FormatError(path, "", "is smaller than 32 px");
    rows.push_back(avatar::FeatureRows(*net, image));
    stage.Advance();
  }
  Features features;
  features.rows = at::cat(rows), features.name = net->name(), features.sha256 = net->sha256();
  return Checked(std::move(features), side.path);
}

NetPointer NetByName(const std::string& name) {
  NetPointer net = name == "gabor" ? nullptr : avatar::FeatureNetByName(name);
  return net ? net : avatar::GaborNet();
}

Features FeaturesOf(const DistanceSide& side, const NetPointer& net, const Backdrop& backdrop, const RunContext& run) {
  return net && !side.images.empty() ? FeaturesOfImages(side, net, backdrop, run) : ReadFeatures(side.path);
}

/// Names that contradict each other; statistics of other programs have none.
void RequireComparable(const Features& a, const DistanceSide& reference, const Features& b, const DistanceSide& other) {
  if (a.d != b.d) {
    throw FormatError(other.path, "features",
                      "has " + std::to_string(b.d) + " dimensions, " + reference.path + " has " + std::to_string(a.d) +
                          (reference.images.empty() == other.images.empty()
                               ? ""
                               : ": the statistics are of another net; name theirs with option 'features'"));
  }
  const bool unknown = (a.gaussian && a.name == kUnnamed) || (b.gaussian && b.name == kUnnamed);
  if (a.name != b.name && !unknown)
    throw FormatError(other.path, "__metadata__.features",
                      "is '" + b.name + "', in " + reference.path + " it is '" + a.name + "': not comparable");
}

DistanceResult Compare(const Features& a, const Features& b, uint64_t seed) {
  const Features& named = a.name == kUnnamed ? b : a;
  const std::string name = avatar::DistanceName(named.name, named.sha256);
  if (!a.gaussian && !b.gaussian) {
    const avatar::SetDistance s = avatar::CompareFeatures(a.rows, b.rows, named.name, seed);
    return {s.fd, s.floor, s.kid.value, s.kid.standard_error, s.n, s.n_other, s.d, s.features, name};
  }
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  const auto fit = [](const Features& f) { return f.gaussian ? *f.gaussian : avatar::FitGaussian(f.rows); };
  const double floor = a.gaussian ? kNone : avatar::FrechetSplitHalfFloor(a.rows, seed);
  return {avatar::FrechetDistance(fit(a), fit(b)), floor, kNone, kNone, a.n, b.n, a.d, named.name, name};
}

}  // namespace

bool IsFeatureFile(const std::string& path) {
  const std::string extension = std::filesystem::path(path).extension().string();
  return extension == ".npy" || extension == ".npz" || extension == ".safetensors";
}

DistanceResult CompareSides(const DistanceSide& reference, const DistanceSide& other, const std::string& net_name,
                            const Backdrop& backdrop, const RunContext& run) {
  at::set_num_threads(ResolveThreads(run.num_threads));
  const bool images = !reference.images.empty() || !other.images.empty();
  const NetPointer net = images ? NetByName(net_name) : nullptr;
  const Features a = FeaturesOf(reference, net, backdrop, run), b = FeaturesOf(other, net, backdrop, run);
  RequireComparable(a, reference, b, other);
  return Compare(a, b, run.seed);
}

WrittenStatistics WriteStatistics(const DistanceSide& side, const std::string& net_name, const Backdrop& backdrop,
                                  const std::string& out, const RunContext& run) {
  at::set_num_threads(ResolveThreads(run.num_threads));
  const Features features = FeaturesOf(side, side.images.empty() ? nullptr : NetByName(net_name), backdrop, run);
  const avatar::GaussianFit fit = features.gaussian ? *features.gaussian : avatar::FitGaussian(features.rows);
  const at::Tensor covariance = fit.root.t().matmul(fit.root).contiguous();
  const auto doubles = [](const at::Tensor& t) {
    return std::vector<double>(t.data_ptr<double>(), t.data_ptr<double>() + t.numel());
  };
  const auto d = static_cast<size_t>(features.d);
  std::vector<std::pair<std::string, std::string>> members = {{"mu", NpyOfDoubles({d}, doubles(fit.mean.contiguous()))},
                                                              {"sigma", NpyOfDoubles({d, d}, doubles(covariance))},
                                                              {"features", NpyOfTexts({features.name})},
                                                              {"n", NpyOfInts({1}, {features.n})}};
  if (!features.sha256.empty()) members.push_back({"sha256", NpyOfTexts({features.sha256})});
  WriteFileAtomic(out, NpzOf(members));
  return {features.n, features.d, features.name};
}

}  // namespace mvstudio::stages
