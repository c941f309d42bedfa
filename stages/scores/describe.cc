#include "stages/scores/describe.h"

#include <cmath>

#include "core/format.h"
#include "stages/input/mask_notice.h"

namespace mvstudio::stages {
namespace {

using metrics::RegionScore;
using nlohmann::ordered_json;

ordered_json RegionJson(const metrics::RegionScore& score) {
  return {{"ssim", FiniteOrNull(score.ssim)},
          {"ssim_luma", FiniteOrNull(score.ssim_luma)},
          {"ssim_skimage", FiniteOrNull(score.ssim_skimage)},
          {"psnr_db", FiniteOrNull(score.psnr_db)}};
}

CommandResult DescribePartnerless(const std::vector<std::string>& names, const std::string& folder) {
  CommandResult result;
  if (names.empty()) return result;
  result.exit = kExitPartial;
  result.warnings.push_back(
      {"MET-UNMATCHED", std::to_string(names.size()) + " images of " + folder + " have no partner; the first: " + names.front(),
       "both folders must hold the same file names"});
  return result;
}

/// Mean of one region; nothing when the pairs have none.
std::optional<RegionScore> RegionMean(const ImageFilePairs& pairs, std::optional<RegionScore> ImageFilePair::*region) {
  std::vector<RegionScore> scores;
  for (const ImageFilePair& pair : pairs.pairs) {
    if (pair.*region) scores.push_back(*(pair.*region));
  }
  int64_t ignored = 0;
  if (scores.empty()) return std::nullopt;
  return metrics::Mean(scores, &ignored);
}

ordered_json PairsJson(const ImageFilePairs& pairs) {
  ordered_json rows = ordered_json::array();
  for (const ImageFilePair& pair : pairs.pairs) {
    ordered_json row = {{"name", pair.name}};
    row.update(RegionJson(pair.full));
    if (pair.bbox) row["bbox"] = RegionJson(*pair.bbox);
    if (pair.masked) row["masked"] = RegionJson(*pair.masked);
    rows.push_back(row);
  }
  return rows;
}

/// "SSIM 0.9000, PSNR 30.00 dB".
std::string RegionText(const std::optional<RegionScore>& score) {
  const auto number = [](double value) { return std::isfinite(value) ? value : INFINITY; };
  const RegionScore none = {INFINITY, INFINITY, INFINITY, INFINITY};
  const RegionScore& s = score ? *score : none;
  return Format("SSIM %.4f, PSNR %.2f dB", number(s.ssim), number(s.psnr_db));
}

/// Whether masks were used, and on how much; what is behind images with opacity.
CommandResult DescribeGround(const ScoresReport& report, const std::optional<RegionScore>& box,
                             const std::optional<RegionScore>& masked) {
  const ImageFilePairs& pairs = report.pairs;
  CommandResult result;
  int64_t mask_px = 0, all_px = 0, clear = 0;
  for (const ImageFilePair& pair : pairs.pairs) {
    mask_px += pair.mask_px, all_px += int64_t{pair.width} * pair.height, clear += pair.clear;
  }
  const auto all = static_cast<long long>(all_px);
  if (report.options.masks.empty()) {
    result.text = Format("\n  whole images, %lld pixels; no masks", all);
  } else {
    result.metrics["mask_pixels"] = mask_px;
    result.text = "\n  in the masks' boxes: " + RegionText(box) +
                  Format("; on the masks, %lld of %lld pixels: ", static_cast<long long>(mask_px), all) + RegionText(masked);
  }
  if (clear > 0) {
    result.metrics["background"] = {{"rgb", pairs.backdrop.rgb}, {"pairs", clear}, {"reason", pairs.backdrop.reason}};
    result.text += Format("\n  %lld pairs have opacity: put over ", static_cast<long long>(clear)) + ToString(pairs.backdrop) +
                   " (" + pairs.backdrop.reason + ")";
  }
  result.Add(DescribeMaskMeaning(pairs.masks, report.options.masks, result.text));
  return result;
}

CommandResult DescribePairs(const ScoresReport& report) {
  std::vector<RegionScore> full;
  for (const ImageFilePair& pair : report.pairs.pairs) full.push_back(pair.full);
  int64_t infinite = 0;
  const RegionScore mean = metrics::Mean(full, &infinite);
  CommandResult result;
  result.metrics = RegionJson(mean);
  result.metrics["n"] = full.size();
  result.metrics["psnr_infinite"] = infinite;
  const std::optional<RegionScore> box = RegionMean(report.pairs, &ImageFilePair::bbox),
                                   masked = RegionMean(report.pairs, &ImageFilePair::masked);
  if (box) result.metrics["bbox"] = RegionJson(*box);
  if (masked) result.metrics["masked"] = RegionJson(*masked);
  if (report.options.per_image) result.metrics["pictures"] = PairsJson(report.pairs);
  result.text = Format(
      "%zu pairs: SSIM %.4f (luma %.4f, scikit-image's default %.4f), PSNR %.2f dB (%lld equal pairs "
      "left out)",
      full.size(), mean.ssim, mean.ssim_luma, mean.ssim_skimage, mean.psnr_db, static_cast<long long>(infinite));
  result.Add(DescribeGround(report, box, masked));
  return result;
}

std::string DistanceText(const DistanceResult& d) {
  const auto count = [](int64_t n) { return n > 0 ? std::to_string(n) : std::string("unknown"); };
  std::string text = Format("%s %.5g", d.name.c_str(), d.fd);
  if (std::isfinite(d.floor)) text += Format(", between halves of the reference %.5g", d.floor);
  if (std::isfinite(d.kid)) text += Format("; kernel distance %.3g +- %.2g", d.kid, d.kid_se);
  return text + "; n = " + count(d.n_a) + " and " + count(d.n_b) + Format(", d = %lld", static_cast<long long>(d.d));
}

/// Beside the scores of pairs.
CommandResult DescribeDistance(const ScoresReport& report) {
  CommandResult result;
  if (!report.why_no_distance.empty()) {
    result.metrics["fd"] = nullptr;
    result.warnings.push_back(
        {"MET-NO-FD", "no Frechet distance: " + report.why_no_distance, "give at least 4 pairs of 32 px or more"});
  }
  if (!report.distance) return result;
  const DistanceResult& d = *report.distance;
  result.metrics["fd"] = {{"value", d.fd}, {"name", d.name},   {"features", d.features}, {"n", d.n_a},
                          {"d", d.d},      {"floor", d.floor}, {"kid", d.kid},           {"kid_se", d.kid_se}};
  result.text = "\n" + DistanceText(d);
  return result;
}

CommandResult DescribeDistanceAlone(const ScoresReport& report) {
  const DistanceResult& d = *report.distance;
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
  result.text = DistanceText(d);
  if (report.lone_other.empty()) return result;
  result.exit = kExitQualityGate;
  result.errors.push_back({"MET-UNPAIRED",
                           "no image of " + report.options.other + " has the name of one in " + report.options.reference +
                               " (" + report.lone_other + ", " + report.lone_reference +
                               "): no SSIM and no PSNR, the distance alone",
                           "give pairs equal names, or ask for option 'distance-only'"});
  return result;
}

CommandResult DescribeStatistics(const WrittenStatistics& written, const std::string& file) {
  CommandResult result;
  result.metrics = {{"n", written.n}, {"d", written.d}, {"features", written.features}};
  result.outputs.push_back({file, "statistics"});
  result.text = Format("%s: mean and covariance of %lld features (%s) of %lld images", file.c_str(),
                       static_cast<long long>(written.d), written.features.c_str(), static_cast<long long>(written.n));
  return result;
}

}  // namespace

CommandResult Describe(const ScoresReport& report) {
  const ScoresOptions& options = report.options;
  CommandResult result;
  if (report.statistics) {
    result = DescribeStatistics(*report.statistics, options.write_statistics);
  } else if (report.pairs.pairs.empty()) {
    result = DescribeDistanceAlone(report);
  } else {
    result = DescribePairs(report);
    result.Add(DescribeDistance(report));
    result.Add(DescribePartnerless(report.pairs.only_in_reference, options.reference));
    result.Add(DescribePartnerless(report.pairs.only_in_other, options.other));
  }
  result.inputs = {options.reference};
  if (!options.other.empty()) result.inputs.push_back(options.other);
  return result;
}

}  // namespace mvstudio::stages
