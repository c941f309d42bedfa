#include "avatar/io/compare_folders.h"

#include <ATen/ATen.h>
#include <ATen/Parallel.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <map>

#include "avatar/features.h"
#include "avatar/safetensors.h"
#include "core/error.h"
#include "core/parallel.h"
#include "dataset/image_io.h"

namespace mvstudio::avatar {
namespace {

namespace fs = std::filesystem;

// Stem -> path of the pictures of a folder.
std::map<std::string, std::string> Pictures(const std::string& folder) {
  if (!fs::is_directory(folder)) throw IoError(folder, "no such folder");
  std::map<std::string, std::string> pictures;
  for (const auto& entry : fs::directory_iterator(folder)) {
    std::string extension = entry.path().extension().string();
    for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    if (extension != ".png" && extension != ".jpg" && extension != ".jpeg") continue;
    if (!pictures.emplace(entry.path().stem().string(), entry.path().string()).second) {
      throw FormatError(folder, entry.path().stem().string(), "is there with two extensions; keep one");
    }
  }
  if (pictures.empty()) throw IoError(folder, "holds no PNG or JPEG pictures");
  return pictures;
}

// (1, 3, H, W) float64 in [0, 1].
at::Tensor ReadPicture(const std::string& path) {
  const Image image = dataset::ReadImage(path);
  const at::Tensor bytes =
      at::from_blob(const_cast<uint8_t*>(image.pixels.data()), {image.height, image.width, image.channels}, at::kByte);
  return (bytes.to(at::kDouble) / 255).permute({2, 0, 1}).unsqueeze(0).contiguous();
}

struct Pair {
  FolderComparison::Picture picture;
  at::Tensor features_a, features_b;  // (1, d), undefined for small pictures
  std::pair<int64_t, int64_t> size;
};

Pair ComparePair(const std::string& name, const std::string& path_a, const std::string& path_b) {
  const at::Tensor a = ReadPicture(path_a), b = ReadPicture(path_b);
  if (a.sizes() != b.sizes()) {
    throw FormatError(path_b, "",
                      "is " + std::to_string(b.size(3)) + "x" + std::to_string(b.size(2)) + ", its partner " + path_a + " is " +
                          std::to_string(a.size(3)) + "x" + std::to_string(a.size(2)));
  }
  if (std::min(a.size(2), a.size(3)) < kSsimWindow) throw FormatError(path_a, "", "is smaller than SSIM's window of 11x11 px");
  Pair pair;
  pair.picture = {name,
                  {Ssim(a, b).item<double>(), Ssim(a, b, SsimChannels::kLuma).item<double>(), PsnrDb(a, b).item<double>()}};
  pair.size = {a.size(2), a.size(3)};
  if (std::min(a.size(2), a.size(3)) >= kGaborFeatureMinPx)
    pair.features_a = GaborFeatures(a), pair.features_b = GaborFeatures(b);
  return pair;
}

SetDistance Distance(const at::Tensor& x, const at::Tensor& y, const std::string& features, uint64_t seed) {
  return {FrechetDistance(x, y), FrechetSplitHalfFloor(x, seed), KernelInceptionDistance(x, y), x.size(0), x.size(1), features};
}

void AddDistance(const std::vector<Pair>& pairs, uint64_t seed, FolderComparison* result) {
  if (pairs.size() < 4) result->fd_missing = "fewer than 4 pairs";
  std::vector<at::Tensor> a, b;
  for (const Pair& pair : pairs) {
    if (pair.size != pairs.front().size) result->fd_missing = "the pictures have several sizes";
    if (!pair.features_a.defined()) result->fd_missing = "a picture is smaller than 32 px";
    a.push_back(pair.features_a), b.push_back(pair.features_b);
  }
  if (result->fd_missing.empty()) result->fd = Distance(at::cat(a), at::cat(b), kGaborFeatureName, seed);
}

at::Tensor ReadFeatures(const std::string& path, std::string* name) {
  const TensorFile file = ReadTensorFile(path, false);
  const auto found = file.tensors.find("features");
  if (found == file.tensors.end() || found->second.dim() != 2 || !found->second.is_floating_point()) {
    throw FormatError(path, "features", "must be a floating-point tensor of (pictures, dimensions)");
  }
  if (found->second.size(0) < 4) throw FormatError(path, "features", "has fewer than 4 rows");
  if (!at::isfinite(found->second).all().item<bool>()) throw FormatError(path, "features", "holds NaN or infinity");
  const auto named = file.metadata.find("features");
  *name = named == file.metadata.end() ? "unnamed" : named->second;
  return found->second;
}

}  // namespace

FolderComparison CompareFolders(const std::string& reference, const std::string& other, const RunContext& run) {
  at::set_num_threads(ResolveThreads(run.num_threads));
  const auto in_a = Pictures(reference), in_b = Pictures(other);
  FolderComparison result;
  std::vector<std::string> names;
  for (const auto& [name, path] : in_a) (in_b.count(name) ? names : result.only_in_reference).push_back(name);
  for (const auto& [name, path] : in_b) {
    if (!in_a.count(name)) result.only_in_other.push_back(name);
  }
  if (names.empty()) throw IoError(other, "no picture has the name of one in " + reference);
  std::vector<Pair> pairs(names.size());
  const auto count = static_cast<int64_t>(names.size());
  ProgressStage stage(run, "comparing pictures", count);
  constexpr int64_t kChunk = 32;
  for (int64_t first = 0; first < count; first += kChunk) {
    const int64_t last = std::min(count, first + kChunk);
    at::parallel_for(first, last, 1,
                     [&](int64_t begin, int64_t end) {  // one pair a thread: what is called inside runs serially
                       for (int64_t i = begin; i < end; ++i)
                         pairs[i] = ComparePair(names[i], in_a.at(names[i]), in_b.at(names[i]));
                     });
    stage.Advance(last - first);
  }
  std::vector<double> psnr;
  for (const Pair& pair : pairs) {
    const RegionScore& score = pair.picture.score;
    result.pictures.push_back(pair.picture);
    result.mean.ssim += score.ssim / static_cast<double>(count);
    result.mean.ssim_luma += score.ssim_luma / static_cast<double>(count);
    psnr.push_back(score.psnr_db);
  }
  const PsnrSummary mean = MeanPsnr(psnr);
  result.mean.psnr_db = mean.mean_db, result.psnr_infinite = mean.num_infinite;
  AddDistance(pairs, run.seed, &result);
  return result;
}

SetDistance CompareFeatureFiles(const std::string& reference, const std::string& other, const RunContext& run) {
  std::string name_a, name_b;
  const at::Tensor a = ReadFeatures(reference, &name_a), b = ReadFeatures(other, &name_b);
  if (a.size(1) != b.size(1)) {
    throw FormatError(other, "features",
                      "has " + std::to_string(b.size(1)) + " dimensions, " + reference + " has " + std::to_string(a.size(1)));
  }
  if (name_a != name_b)
    throw FormatError(other, "__metadata__.features",
                      "is '" + name_b + "', in " + reference + " it is '" + name_a + "': not comparable");
  return Distance(a, b, name_a, run.seed);
}

}  // namespace mvstudio::avatar
