#include <cmath>
#include <filesystem>

#include "app/input/picture_pairs.h"
#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "core/error.h"
#include "core/format.h"
#if MVSTUDIO_HAS_AVATAR
#include "app/nets/metrics_distance.h"
#endif

namespace mvstudio::cli {
namespace {

using nlohmann::ordered_json;

struct MetricsArguments {
  std::string reference, other, masks, features = "auto";
  bool per_picture = false;
};

ordered_json ToJson(const metrics::RegionScore& score) {
  return {{"ssim", FiniteOrNull(score.ssim)},
          {"ssim_luma", FiniteOrNull(score.ssim_luma)},
          {"ssim_skimage", FiniteOrNull(score.ssim_skimage)},
          {"psnr_db", FiniteOrNull(score.psnr_db)}};
}

void AddUnmatched(const std::vector<std::string>& names, const std::string& folder, CommandResult* result) {
  if (names.empty()) return;
  result->exit = kExitPartial;
  result->warnings.push_back(
      {"MET-UNMATCHED", std::to_string(names.size()) + " images of " + folder + " have no partner; the first: " + names.front(),
       "both folders must hold the same file names"});
}

/// Means of one region; nothing when the pairs have none.
void AddRegion(const app::PicturePairs& pairs, const std::string& key,
               std::optional<metrics::RegionScore> app::PicturePair::*region, CommandResult* result) {
  std::vector<metrics::RegionScore> scores;
  for (const app::PicturePair& pair : pairs.pairs) {
    if (pair.*region) scores.push_back(*(pair.*region));
  }
  int64_t ignored = 0;
  if (!scores.empty()) result->metrics[key] = ToJson(metrics::Mean(scores, &ignored));
}

void AddScores(const app::PicturePairs& pairs, bool per_picture, CommandResult* result) {
  std::vector<metrics::RegionScore> full;
  for (const app::PicturePair& pair : pairs.pairs) full.push_back(pair.full);
  int64_t infinite = 0;
  const metrics::RegionScore mean = metrics::Mean(full, &infinite);
  result->metrics = ToJson(mean);
  result->metrics["n"] = full.size();
  result->metrics["psnr_infinite"] = infinite;
  AddRegion(pairs, "bbox", &app::PicturePair::bbox, result);
  AddRegion(pairs, "masked", &app::PicturePair::masked, result);
  if (per_picture) {
    result->metrics["pictures"] = ordered_json::array();
    for (const app::PicturePair& pair : pairs.pairs) {
      ordered_json row = {{"name", pair.name}};
      row.update(ToJson(pair.full));
      if (pair.bbox) row["bbox"] = ToJson(*pair.bbox);
      if (pair.masked) row["masked"] = ToJson(*pair.masked);
      result->metrics["pictures"].push_back(row);
    }
  }
  result->text = Format(
      "%zu pairs: SSIM %.4f (luma %.4f, scikit-image's default %.4f), PSNR %.2f dB (%lld equal pairs "
      "left out)",
      full.size(), mean.ssim, mean.ssim_luma, mean.ssim_skimage, mean.psnr_db, static_cast<long long>(infinite));
}

#if MVSTUDIO_HAS_AVATAR
std::string Text(const app::DistanceResult& d) {
  return Format("%s %.5g, between halves of the reference %.5g; kernel distance %.3g +- %.2g; n = %lld and %lld, d = %lld",
                d.name.c_str(), d.fd, d.floor, d.kid, d.kid_se, static_cast<long long>(d.n_a), static_cast<long long>(d.n_b),
                static_cast<long long>(d.d));
}

CommandResult MetricsOfFeatures(const MetricsArguments& arguments, CommandContext& context) {
  const app::DistanceResult d = app::CompareFeatureFiles(arguments.reference, arguments.other, context.run);
  CommandResult result;
  result.metrics = {{"fd", d.fd},       {"n_a", d.n_a}, {"n_b", d.n_b},       {"d", d.d},
                    {"floor", d.floor}, {"kid", d.kid}, {"kid_se", d.kid_se}, {"features", d.features}};
  result.text = Text(d);
  return result;
}

/// Why the sets of pictures have no distance; empty when they have.
std::string WhyNoDistance(const app::PicturePairs& pairs) {
  if (pairs.pairs.size() < 4) return "fewer than 4 pairs";
  for (const app::PicturePair& pair : pairs.pairs) {
    if (std::min(pair.width, pair.height) < 32) return pair.name + " is smaller than 32 px";
  }
  return "";
}

void AddDistance(const app::PicturePairs& pairs, const MetricsArguments& arguments, const RunContext& run,
                 CommandResult* result) {
  result->metrics["fd"] = nullptr;
  const std::string why = WhyNoDistance(pairs);
  if (!why.empty()) {
    result->warnings.push_back({"MET-NO-FD", "no Frechet distance: " + why, "give at least 4 pairs of 32 px or more"});
    return;
  }
  std::vector<std::string> reference, other;
  for (const app::PicturePair& pair : pairs.pairs) reference.push_back(pair.reference), other.push_back(pair.other);
  const app::DistanceResult d = app::ComparePictureSets(reference, other, arguments.features, run);
  result->metrics["fd"] = {{"value", d.fd}, {"name", d.name},   {"features", d.features}, {"n", d.n_a},
                           {"d", d.d},      {"floor", d.floor}, {"kid", d.kid},           {"kid_se", d.kid_se}};
  result->text += "\n" + Text(d);
}
#endif

bool IsFeatureFile(const std::string& path) {
  const std::string extension = std::filesystem::path(path).extension().string();
  return extension == ".npy" || extension == ".safetensors";
}

CommandResult RunMetrics(const MetricsArguments& arguments, CommandContext& context) {
  if (IsFeatureFile(arguments.reference) != IsFeatureFile(arguments.other))
    throw UsageError("metrics compares two folders of images, two images, or two files of features, not one of each");
  CommandResult result;
  if (IsFeatureFile(arguments.reference)) {
#if MVSTUDIO_HAS_AVATAR
    result = MetricsOfFeatures(arguments, context);
#else
    throw MissingToolError("distances between features need libtorch, which this build was made without");
#endif
  } else {
    app::PicturePairs pairs = app::PairPictures(arguments.reference, arguments.other, arguments.masks);
    app::ScorePairs(&pairs, context.run);
    AddScores(pairs, arguments.per_picture, &result);
#if MVSTUDIO_HAS_AVATAR
    AddDistance(pairs, arguments, context.run, &result);
#endif
    AddUnmatched(pairs.only_in_reference, arguments.reference, &result);
    AddUnmatched(pairs.only_in_other, arguments.other, &result);
  }
  result.inputs = {arguments.reference, arguments.other};
  return result;
}

}  // namespace

void RegisterMetrics(CLI::App& app, Registry& registry) {
  auto arguments = std::make_shared<MetricsArguments>();
  CLI::App* sub = app.add_subcommand(
      "metrics", "SSIM, PSNR and Frechet distance of two folders of images or two images, or of two files of features");
  AddOption(sub, "reference", arguments->reference,
            "folder of images, an image, a .npy of (n, d) numbers, or a .safetensors file with a tensor `features`")
      ->required();
  AddOption(sub, "other", arguments->other, "the same file names, or features of the same kind")->required();
  AddOption(sub, "--masks", arguments->masks,
            "folder of masks of the same names: scores of their box and of their pixels, too");
  AddOption(sub, "--features", arguments->features,
            "net of the Frechet distance: gabor, posenet (mvstudio models fetch), a TorchScript file that gives (N, d) for "
            "images in [0, 1], inception-2015-12-05.pt for the FID, or auto: posenet when it is installed")
      ->capture_default_str();
  AddFlag(sub, "--per-picture", arguments->per_picture, "list every pair in the metrics");
  registry.Add(sub, "metrics", [arguments](CommandContext& context) { return RunMetrics(*arguments, context); });
}

}  // namespace mvstudio::cli
