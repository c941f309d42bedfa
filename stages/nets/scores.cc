#include <algorithm>
#include <filesystem>

#include "core/disk/output.h"
#include "core/error.h"
#include "stages/nets/metrics_distance.h"

namespace mvstudio::stages {
namespace {

DistanceSide SideOf(const std::string& path) {
  DistanceSide side{path, {}};
  if (IsFeatureFile(path)) return side;
  for (const auto& [name, image] : ImagesIn(path)) side.images.push_back(image);
  return side;
}

Backdrop BackdropFor(const ScoresOptions& options) {
  return options.background == "auto" ? Backdrop{{0, 0, 0}, "the default"} : BackdropOf(options.background);
}

/// Why the sets of images have no distance; empty when they have.
std::string WhyNoDistance(const ImageFilePairs& pairs) {
  if (pairs.pairs.size() < 4) return "fewer than 4 pairs";
  for (const ImageFilePair& pair : pairs.pairs) {
    if (std::min(pair.width, pair.height) < 32) return pair.name + " is smaller than 32 px";
  }
  return "";
}

/// Two folders without a name in common, large enough for a distance.
bool AreUnpaired(const ScoresOptions& options) {
  namespace fs = std::filesystem;
  if (!fs::is_directory(options.reference) || !fs::is_directory(options.other) || !options.masks.empty()) return false;
  const auto a = ImagesIn(options.reference), b = ImagesIn(options.other);
  return std::min(a.size(), b.size()) >= 4 && std::none_of(a.begin(), a.end(), [&](const auto& x) { return b.count(x.first); });
}

/// Sets without pairs.
DistanceResult DistanceAlone(const ScoresOptions& options, const RunContext& run) {
  if (!options.masks.empty()) throw UsageError("option 'masks' has no part in a distance between sets: leave it out");
  return CompareSides(SideOf(options.reference), SideOf(options.other), options.features, BackdropFor(options), run);
}

WrittenStatistics WriteStatisticsOf(const ScoresOptions& options, const RunContext& run) {
  if (!options.other.empty()) throw UsageError("option 'write-statistics' takes one set: leave the second out");
  const OutputFiles place({options.write_statistics}, {options.reference});
  return WriteStatistics(SideOf(options.reference), options.features, BackdropFor(options), options.write_statistics, run);
}

void AddPairDistance(const RunContext& run, ScoresReport* report) {
  const ImageFilePairs& pairs = report->pairs;
  report->why_no_distance = WhyNoDistance(pairs);
  if (!report->why_no_distance.empty()) return;
  DistanceSide reference{report->options.reference, {}}, other{report->options.other, {}};
  for (const ImageFilePair& pair : pairs.pairs) reference.images.push_back(pair.reference), other.images.push_back(pair.other);
  report->distance = CompareSides(reference, other, report->options.features, pairs.backdrop, run);
}

void RequireLikeSets(const ScoresOptions& options) {
  const auto is_statistics = [](const std::string& path) { return std::filesystem::path(path).extension() == ".npz"; };
  const bool one = !options.other.empty() && IsFeatureFile(options.reference) != IsFeatureFile(options.other);
  if (one && !is_statistics(options.reference) && !is_statistics(options.other))
    throw UsageError(
        "metrics compares two folders of images, two images, or two files of features, not one of each; a folder "
        "of images can be compared with statistics (.npz)");
}

}  // namespace

ScoresReport RunScores(const ScoresOptions& options, const RunContext& run) {
  RequireTwoSets(options);
  RequireLikeSets(options);
  ScoresReport report;
  report.options = options;
  if (!options.write_statistics.empty()) {
    report.statistics = WriteStatisticsOf(options, run);
  } else if (IsFeatureFile(options.reference) || IsFeatureFile(options.other) || options.distance_only) {
    report.distance = DistanceAlone(options, run);
  } else if (AreUnpaired(options)) {
    report.distance = DistanceAlone(options, run);
    report.lone_reference = ImagesIn(options.reference).begin()->first;
    report.lone_other = ImagesIn(options.other).begin()->first;
  } else {
    report = RunPairScores(options, run);
    AddPairDistance(run, &report);
  }
  return report;
}

}  // namespace mvstudio::stages
