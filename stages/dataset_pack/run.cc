#include "stages/dataset_pack/run.h"

#include <cstdio>
#include <filesystem>
#include <utility>

#include "core/disk/output.h"
#include "core/disk/place.h"
#include "core/error.h"
#include "core/some_of.h"
#include "dataset/panoptic/own_joints.h"
#include "geometry/skeleton/skeleton.h"
#include "stages/words.h"

namespace mvstudio::stages {
namespace {

/// Of "K/N".
dataset::ShardShare ParseShare(const std::string& text) {
  dataset::ShardShare share;
  int used = 0;
  const bool whole =
      std::sscanf(text.c_str(), "%d/%d%n", &share.index, &share.count, &used) == 2 && used == static_cast<int>(text.size());
  if (!whole || share.count < 1 || share.index < 0 || share.index >= share.count) {
    throw UsageError("option 'shard' '" + text + "': use K/N with 0 <= K < N");
  }
  return share;
}

void CheckPackUse(const DatasetPackOptions& options) {
  if (options.merge && !options.shard.empty())
    throw UsageError("option 'merge' and option 'shard' exclude each other: merge when all are made");
  if (!options.merge && options.dataset.empty())
    throw UsageError("the dataset folder is missing (only option 'merge' does without)");
  if (!options.single.empty() && !options.shard.empty())
    throw UsageError("option 'single' needs the whole pack, not a share of it");
}

/// The pack's own files have names of this kind.
void RequireApartFromPack(const DatasetPackOptions& options) {
  const std::filesystem::path file = PathOnDisk(options.single);
  const std::string name = file.filename().string();
  const bool own = name.rfind("shard-", 0) == 0 || name == "INDEX.json";
  if (own && file.parent_path() == PathOnDisk(options.out + "/"))
    throw UsageError("option 'single' " + options.single +
                     ": the pack itself has a file of this kind there; choose another name");
}

/// Throws FormatError where they are most of the joints.
std::optional<LostJoints> FindLostJoints(const DatasetPackOptions& options) {
  LostJoints lost;
  lost.folder = dataset::FindOwnJoints(options.dataset);
  if (lost.folder.empty()) return std::nullopt;
  const geometry::Skeleton skeleton = dataset::ListOwnJoints(lost.folder).skeleton;
  std::vector<bool> kept(skeleton.joints.size(), false);
  for (const std::vector<int>& sources : geometry::Coco19From(skeleton)) {
    for (const int joint : sources) kept[static_cast<size_t>(joint)] = true;
  }
  for (size_t j = 0; j < kept.size(); ++j) {
    if (!kept[j]) lost.names.push_back(skeleton.joints[j]);
  }
  if (lost.names.empty()) return std::nullopt;
  lost.skeleton = skeleton.name, lost.of = kept.size();
  if (2 * lost.names.size() > lost.of && !options.allow_lost_joints)
    throw FormatError(lost.folder, "",
                      lost.Text() + "; read them from the dataset, or pack the images with option 'allow-lost-joints'");
  return lost;
}

}  // namespace

std::string LostJoints::Text() const {
  return "a pack holds Panoptic's 19 joints alone: " + std::to_string(names.size()) + " of the " + std::to_string(of) +
         " joints of '" + skeleton + "' are left out, " + SomeOf(names);
}

DatasetPackReport RunDatasetPack(DatasetPackOptions options, const RunContext& run) {
  CheckPackUse(options);
  if (!options.frames.empty()) options.pack.frames = ParseRanges("option 'frames'", options.frames);
  const dataset::ShardShare share = options.shard.empty() ? dataset::ShardShare{} : ParseShare(options.shard);
  DatasetPackReport report;
  if (!options.single.empty()) RequireApartFromPack(options);
  if (!options.dataset.empty()) report.lost = FindLostJoints(options);
  report.built = options.merge ? dataset::MergePack(options.out, run)
                               : dataset::BuildPack(options.dataset, options.out, options.pack, share, run);
  if (!options.single.empty() && report.built.complete) {
    const OutputFiles place({options.single}, {options.dataset});
    dataset::WriteSinglePack(options.out, options.single);
    report.wrote_single = true;
  }
  report.options = std::move(options);
  return report;
}

}  // namespace mvstudio::stages
