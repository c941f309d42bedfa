#include <algorithm>
#include <cmath>
#include <filesystem>

#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "core/disk/output.h"
#include "core/error.h"
#include "core/format.h"
#include "stages/input/mask_notice.h"
#include "stages/input/picture_pairs.h"
#if MVSTUDIO_HAS_AVATAR
#include "stages/nets/metrics_distance.h"
#endif

namespace mvstudio::cli {
namespace {

using nlohmann::ordered_json;

struct MetricsArguments {
  std::string reference, other, masks, features = "auto", background = "auto", write_statistics;
  bool per_picture = false, distance_only = false;
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

/// Whether masks were used, and on how much; what is behind images with opacity.
void AddGround(const stages::PicturePairs& pairs, const MetricsArguments& arguments, CommandResult* result) {
  int64_t mask_px = 0, all_px = 0, clear = 0;
  for (const stages::PicturePair& pair : pairs.pairs) {
    mask_px += pair.mask_px, all_px += int64_t{pair.width} * pair.height, clear += pair.clear;
  }
  if (arguments.masks.empty()) {
    result->text += Format("\n  whole images, %lld pixels; no masks", static_cast<long long>(all_px));
  } else {
    const ordered_json box = result->metrics["bbox"], masked = result->metrics["masked"];  // copies: a new key moves them
    const auto number = [](const ordered_json& value) { return value.is_number() ? value.get<double>() : INFINITY; };
    result->metrics["mask_pixels"] = mask_px;
    result->text +=
        Format("\n  in the masks' boxes: SSIM %.4f, PSNR %.2f dB; on the masks, %lld of %lld pixels: SSIM %.4f, PSNR %.2f dB",
               number(box["ssim"]), number(box["psnr_db"]), static_cast<long long>(mask_px), static_cast<long long>(all_px),
               number(masked["ssim"]), number(masked["psnr_db"]));
  }
  if (clear > 0) {
    result->metrics["background"] = {{"rgb", pairs.backdrop.rgb}, {"pairs", clear}, {"reason", pairs.backdrop.reason}};
    result->text += Format("\n  %lld pairs have opacity: put over ", static_cast<long long>(clear)) +
                    stages::ToString(pairs.backdrop) + " (" + pairs.backdrop.reason + ")";
  }
  stages::TellMasks(pairs.masks, arguments.masks, result);
}

/// Means of one region; nothing when the pairs have none.
void AddRegion(const stages::PicturePairs& pairs, const std::string& key,
               std::optional<metrics::RegionScore> stages::PicturePair::*region, CommandResult* result) {
  std::vector<metrics::RegionScore> scores;
  for (const stages::PicturePair& pair : pairs.pairs) {
    if (pair.*region) scores.push_back(*(pair.*region));
  }
  int64_t ignored = 0;
  if (!scores.empty()) result->metrics[key] = ToJson(metrics::Mean(scores, &ignored));
}

void AddScores(const stages::PicturePairs& pairs, bool per_picture, CommandResult* result) {
  std::vector<metrics::RegionScore> full;
  for (const stages::PicturePair& pair : pairs.pairs) full.push_back(pair.full);
  int64_t infinite = 0;
  const metrics::RegionScore mean = metrics::Mean(full, &infinite);
  result->metrics = ToJson(mean);
  result->metrics["n"] = full.size();
  result->metrics["psnr_infinite"] = infinite;
  AddRegion(pairs, "bbox", &stages::PicturePair::bbox, result);
  AddRegion(pairs, "masked", &stages::PicturePair::masked, result);
  if (per_picture) {
    result->metrics["pictures"] = ordered_json::array();
    for (const stages::PicturePair& pair : pairs.pairs) {
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
std::string Text(const stages::DistanceResult& d) {
  const auto count = [](int64_t n) { return n > 0 ? std::to_string(n) : std::string("unknown"); };
  std::string text = Format("%s %.5g", d.name.c_str(), d.fd);
  if (std::isfinite(d.floor)) text += Format(", between halves of the reference %.5g", d.floor);
  if (std::isfinite(d.kid)) text += Format("; kernel distance %.3g +- %.2g", d.kid, d.kid_se);
  return text + "; n = " + count(d.n_a) + " and " + count(d.n_b) + Format(", d = %lld", static_cast<long long>(d.d));
}

stages::DistanceSide SideOf(const std::string& path) {
  stages::DistanceSide side{path, {}};
  if (stages::IsFeatureFile(path)) return side;
  for (const auto& [name, picture] : stages::PicturesIn(path)) side.pictures.push_back(picture);
  return side;
}

stages::Backdrop BackdropFor(const MetricsArguments& arguments) {
  return arguments.background == "auto" ? stages::Backdrop{{0, 0, 0}, "the default"} : stages::BackdropOf(arguments.background);
}

/// Sets without pairs.
CommandResult Distance(const MetricsArguments& arguments, CommandContext& context) {
  if (!arguments.masks.empty()) throw UsageError("--masks has no part in a distance between sets: leave it out");
  const stages::DistanceSide a = SideOf(arguments.reference), b = SideOf(arguments.other);
  const stages::DistanceResult d = stages::CompareSides(a, b, arguments.features, BackdropFor(arguments), context.run);
  CommandResult result;
  result.metrics = {{"fd", d.fd},
                    {"name", d.name},
                    {"n_a", d.n_a},
                    {"n_b", d.n_b},
                    {"d", d.d},
                    {"floor", FiniteOrNull(d.floor)},
                    {"kid", FiniteOrNull(d.kid)},
                    {"kid_se", FiniteOrNull(d.kid_se)},
                    {"features", d.features}};
  result.text = Text(d);
  return result;
}

CommandResult WriteStatisticsOf(const MetricsArguments& arguments, CommandContext& context) {
  if (!arguments.other.empty()) throw UsageError("--write-statistics takes one set: leave the second out");
  const OutputFiles place({arguments.write_statistics}, {arguments.reference});
  const stages::WrittenStatistics written = stages::WriteStatistics(
      SideOf(arguments.reference), arguments.features, BackdropFor(arguments), arguments.write_statistics, context.run);
  CommandResult result;
  result.metrics = {{"n", written.n}, {"d", written.d}, {"features", written.features}};
  result.outputs.push_back({arguments.write_statistics, "statistics"});
  result.text = Format("%s: mean and covariance of %lld features (%s) of %lld images", arguments.write_statistics.c_str(),
                       static_cast<long long>(written.d), written.features.c_str(), static_cast<long long>(written.n));
  return result;
}

/// Why the sets of pictures have no distance; empty when they have.
std::string WhyNoDistance(const stages::PicturePairs& pairs) {
  if (pairs.pairs.size() < 4) return "fewer than 4 pairs";
  for (const stages::PicturePair& pair : pairs.pairs) {
    if (std::min(pair.width, pair.height) < 32) return pair.name + " is smaller than 32 px";
  }
  return "";
}

void AddDistance(const stages::PicturePairs& pairs, const MetricsArguments& arguments, const RunContext& run,
                 CommandResult* result) {
  result->metrics["fd"] = nullptr;
  const std::string why = WhyNoDistance(pairs);
  if (!why.empty()) {
    result->warnings.push_back({"MET-NO-FD", "no Frechet distance: " + why, "give at least 4 pairs of 32 px or more"});
    return;
  }
  stages::DistanceSide reference{arguments.reference, {}}, other{arguments.other, {}};
  for (const stages::PicturePair& pair : pairs.pairs)
    reference.pictures.push_back(pair.reference), other.pictures.push_back(pair.other);
  const stages::DistanceResult d = stages::CompareSides(reference, other, arguments.features, pairs.backdrop, run);
  result->metrics["fd"] = {{"value", d.fd}, {"name", d.name},   {"features", d.features}, {"n", d.n_a},
                           {"d", d.d},      {"floor", d.floor}, {"kid", d.kid},           {"kid_se", d.kid_se}};
  result->text += "\n" + Text(d);
}

/// Two folders without a name in common, large enough for a distance.
bool AreUnpaired(const MetricsArguments& arguments) {
  namespace fs = std::filesystem;
  if (!fs::is_directory(arguments.reference) || !fs::is_directory(arguments.other) || !arguments.masks.empty()) return false;
  const auto a = stages::PicturesIn(arguments.reference), b = stages::PicturesIn(arguments.other);
  return std::min(a.size(), b.size()) >= 4 && std::none_of(a.begin(), a.end(), [&](const auto& x) { return b.count(x.first); });
}

/// The distance is kept; nothing else can be said of them.
CommandResult DistanceOfUnpaired(const MetricsArguments& arguments, CommandContext& context) {
  CommandResult result = Distance(arguments, context);
  result.exit = kExitQualityGate;
  result.errors.push_back({"MET-UNPAIRED",
                           "no image of " + arguments.other + " has the name of one in " + arguments.reference + " (" +
                               stages::PicturesIn(arguments.other).begin()->first + ", " +
                               stages::PicturesIn(arguments.reference).begin()->first +
                               "): no SSIM and no PSNR, the distance alone",
                           "give pairs equal names, or ask for --distance-only"});
  return result;
}
#endif

CommandResult PairScores(const MetricsArguments& arguments, CommandContext& context) {
  CommandResult result;
  stages::PicturePairs pairs = stages::PairPictures(arguments.reference, arguments.other, arguments.masks);
  pairs.backdrop = arguments.background == "auto" ? stages::BackdropOf(pairs.pairs) : stages::BackdropOf(arguments.background);
  stages::ScorePairs(&pairs, context.run);
  AddScores(pairs, arguments.per_picture, &result);
  AddGround(pairs, arguments, &result);
#if MVSTUDIO_HAS_AVATAR
  AddDistance(pairs, arguments, context.run, &result);
#endif
  AddUnmatched(pairs.only_in_reference, arguments.reference, &result);
  AddUnmatched(pairs.only_in_other, arguments.other, &result);
  return result;
}

CommandResult RunMetrics(const MetricsArguments& arguments, CommandContext& context) {
  if (arguments.other.empty() && arguments.write_statistics.empty())
    throw UsageError("metrics compares two sets: give a second one, or --write-statistics FILE for one");
  CommandResult result;
#if MVSTUDIO_HAS_AVATAR
  const auto is_statistics = [](const std::string& path) { return std::filesystem::path(path).extension() == ".npz"; };
  const bool one =
      !arguments.other.empty() && stages::IsFeatureFile(arguments.reference) != stages::IsFeatureFile(arguments.other);
  if (one && !is_statistics(arguments.reference) && !is_statistics(arguments.other))
    throw UsageError(
        "metrics compares two folders of images, two images, or two files of features, not one of each; a folder "
        "of images can be compared with statistics (.npz)");
  const bool features = stages::IsFeatureFile(arguments.reference) || stages::IsFeatureFile(arguments.other);
  if (!arguments.write_statistics.empty()) {
    result = WriteStatisticsOf(arguments, context);
  } else if (features || arguments.distance_only) {
    result = Distance(arguments, context);
  } else if (AreUnpaired(arguments)) {
    result = DistanceOfUnpaired(arguments, context);
  } else {
    result = PairScores(arguments, context);
  }
#else
  if (arguments.distance_only || !arguments.write_statistics.empty())
    throw MissingToolError("distances between sets need libtorch, which this build was made without");
  result = PairScores(arguments, context);
#endif
  result.inputs = {arguments.reference};
  if (!arguments.other.empty()) result.inputs.push_back(arguments.other);
  return result;
}

}  // namespace

void RegisterMetrics(CLI::App& app, Registry& registry) {
  auto arguments = std::make_shared<MetricsArguments>();
  CLI::App* sub = app.add_subcommand(
      "metrics", "SSIM, PSNR and Frechet distance of two folders of images or two images, or of two files of features");
  AddOption(sub, "reference", arguments->reference,
            "folder of images (or of a folder for each camera), an image, a .npy of (n, d) numbers, a .safetensors file with a "
            "tensor `features`, or statistics: an .npz of `mu` and `sigma`")
      ->required();
  AddOption(sub, "other", arguments->other, "the same file names, or features or statistics of the same net");
  AddOption(sub, "--masks", arguments->masks,
            "folder of masks of the same names: scores of their box and of their pixels, too");
  AddOption(sub, "--features", arguments->features,
            "net of the Frechet distance: gabor, posenet (mvstudio models fetch), a TorchScript file that gives (N, d) for "
            "images in [0, 1], inception-2015-12-05.pt for the FID, or auto: posenet when it is installed")
      ->capture_default_str();
  AddOption(sub, "--background", arguments->background,
            "what is behind images with opacity: black, white, R,G,B, or auto: the colour that the opaque images have there, "
            "else black")
      ->capture_default_str();
  AddFlag(sub, "--distance-only", arguments->distance_only,
          "the Frechet and the kernel distance alone: the sets need no pairs and no equal counts");
  AddOutput(sub, "--write-statistics", arguments->write_statistics, OutputKind::kFile,
            "new .npz of the mean `mu` and the covariance `sigma` of the one set's features, as pytorch-fid keeps them");
  AddFlag(sub, "--per-picture", arguments->per_picture, "list every pair in the metrics");
  registry.Add(sub, "metrics", [arguments](CommandContext& context) { return RunMetrics(*arguments, context); });
}

}  // namespace mvstudio::cli
