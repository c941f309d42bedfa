#include <algorithm>

#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "core/disk/output.h"
#include "core/disk/place.h"
#include "core/error.h"
#include "core/format.h"
#include "core/join.h"
#include "core/some_of.h"
#include "dataset/pack/build.h"
#include "dataset/panoptic/own_joints.h"
#include "geometry/skeleton/skeleton.h"
#include "stages/frame_notice.h"
#include "stages/input/mask_notice.h"

namespace mvstudio::cli {
namespace {

using nlohmann::ordered_json;

struct PackArguments {
  std::string dataset, out, shard, frames, single;
  bool merge = false, allow_lost_joints = false;
  dataset::PackOptions options;
};

// "K/N".
dataset::ShardShare ParseShare(const std::string& text) {
  dataset::ShardShare share;
  int used = 0;
  const bool whole =
      std::sscanf(text.c_str(), "%d/%d%n", &share.index, &share.count, &used) == 2 && used == static_cast<int>(text.size());
  if (!whole || share.count < 1 || share.index < 0 || share.index >= share.count) {
    throw UsageError("--shard '" + text + "': use K/N with 0 <= K < N");
  }
  return share;
}

void CheckUse(const PackArguments& arguments) {
  if (arguments.merge && !arguments.shard.empty())
    throw UsageError("--merge and --shard exclude each other: merge when all are made");
  if (!arguments.merge && arguments.dataset.empty())
    throw UsageError("the dataset folder is missing (only --merge does without)");
  if (!arguments.single.empty() && !arguments.shard.empty())
    throw UsageError("--single needs the whole pack, not a share of it");
}

ordered_json Metrics(const dataset::PackBuildReport& report) {
  const dataset::PackTimes& t = report.times;
  ordered_json metrics = {{"shards", report.num_shards}, {"built", report.built},     {"kept", report.kept},
                          {"busy", report.busy},         {"samples", report.samples}, {"bytes", report.bytes},
                          {"complete", report.complete}, {"skipped", report.skipped}};
  metrics["missing"] = ordered_json::parse(dataset::MissingToJsonText(report.missing));
  metrics["frames_without_person"] = report.frames_without_person;
  metrics["times"] = {{"decode_s", t.decode_s}, {"hash_s", t.hash_s},       {"resample_s", t.resample_s},
                      {"encode_s", t.encode_s}, {"write_s", t.write_s},     {"verify_s", t.verify_s},
                      {"wall_s", t.wall_s},     {"threads", report.threads}};
  // How far the build is from doing nothing but decoding its input.
  const double decode_wall_s = t.decode_s / std::max(report.threads, 1);
  metrics["wall_over_decode"] = decode_wall_s > 0 ? FiniteOrNull(t.wall_s / decode_wall_s) : ordered_json();
  if (!report.colour_reason.empty()) metrics["colour"] = report.colour_reason;
  for (const dataset::PackUndistortion& u : report.undistortion) {
    metrics["undistortion"].push_back({{"camera", u.camera},
                                       {"max_joint_px", FiniteOrNull(u.max_joint_px)},
                                       {"max_map_px", FiniteOrNull(u.max_map_px)},
                                       {"lost_share", u.lost_share},
                                       {"empty_share", u.empty_share}});
  }
  return metrics;
}

std::string UndistortionText(const dataset::PackBuildReport& report) {
  if (report.undistortion.empty()) return "";
  double map_px = 0, lost = 0;
  for (const dataset::PackUndistortion& u : report.undistortion) {
    map_px = std::max(map_px, u.max_map_px), lost = std::max(lost, u.lost_share);
  }
  return Format("  undistorted: images are within %.1g px of the lens; at most %.1f %% of a camera's image is not shown\n",
                map_px, 100 * lost);
}

std::string Text(const PackArguments& arguments, const dataset::PackBuildReport& report) {
  const dataset::PackTimes& t = report.times;
  std::string text = Format("%s: %zu of %d shards (%zu made, %zu kept), %lld images, %.1f MB in %.1f s%s\n",
                            arguments.out.c_str(), report.built.size() + report.kept.size(), report.num_shards,
                            report.built.size(), report.kept.size(), static_cast<long long>(report.samples),
                            static_cast<double>(report.bytes) / 1e6, t.wall_s, report.complete ? "; complete" : "");
  if (!report.built.empty()) {
    text +=
        Format("  decode %.1f s, hash %.1f s, resample %.1f s, encode %.1f s (over %d threads); write %.1f s, verify %.1f s\n",
               t.decode_s, t.hash_s, t.resample_s, t.encode_s, report.threads, t.write_s, t.verify_s);
  }
  if (!report.colour_reason.empty()) text += "  colours: " + report.colour_reason + "\n";
  text += UndistortionText(report);
  for (const std::string& note : report.notes) text += "  " + note + "\n";
  return text;
}

void AddNotices(const dataset::PackBuildReport& report, CommandResult* result) {
  stages::TellFrames(report.frames_beyond, result);
  if (!report.skipped.empty()) {
    const std::string text = report.missing.missing() > 0 ? dataset::MissingText(report.missing)
                                                          : std::to_string(report.skipped.size()) + " pictures were left out";
    result->warnings.push_back(
        {"PCK-SKIPPED", text + "; the first: " + report.skipped.front(), dataset::MissingHint(report.missing)});
    result->exit = kExitPartial;
  } else if (report.missing.missing() > 0) {
    result->warnings.push_back({"PCK-MISSING", dataset::MissingText(report.missing), dataset::MissingHint(report.missing)});
  }
  if (report.colour_status != Status::kOk) {
    result->warnings.push_back({"PCK-COLOUR", "colours were not matched: " + report.colour_reason,
                                "check the masks, pack more frames, or leave out --match-colours"});
  }
  if (report.busy.empty()) return;
  const std::string numbers = Join(report.busy, ", ", [](int number) { return std::to_string(number); });
  result->errors.push_back({"PCK-BUSY", "shards being made by someone else: " + numbers + " (" + report.busy_owner + ")",
                            "run the same command again when that is done"});
  result->exit = kExitTryAgain;
}

/// A pack holds Panoptic's 19 joints. Says which of a dataset's own it does not; throws FormatError where they are most of
/// them.
void CheckJoints(const PackArguments& arguments, CommandResult* result) {
  const std::string folder = dataset::FindOwnJoints(arguments.dataset);
  if (folder.empty()) return;
  const geometry::Skeleton skeleton = dataset::ListOwnJoints(folder).skeleton;
  std::vector<bool> kept(skeleton.joints.size(), false);
  for (const std::vector<int>& sources : geometry::Coco19From(skeleton)) {
    for (const int joint : sources) kept[static_cast<size_t>(joint)] = true;
  }
  std::vector<std::string> lost;
  for (size_t j = 0; j < kept.size(); ++j) {
    if (!kept[j]) lost.push_back(skeleton.joints[j]);
  }
  if (lost.empty()) return;
  result->metrics["lost_joints"] = lost;
  const std::string text = "a pack holds Panoptic's 19 joints alone: " + std::to_string(lost.size()) + " of the " +
                           std::to_string(kept.size()) + " joints of '" + skeleton.name + "' are left out, " + SomeOf(lost);
  if (2 * lost.size() > kept.size() && !arguments.allow_lost_joints)
    throw FormatError(folder, "", text + "; read them from the dataset, or pack the images with --allow-lost-joints");
  result->warnings.push_back({"PCK-JOINTS", text, "the dataset keeps them, in " + folder});
}

/// The pack's own files have names of this kind.
void RequireApart(const PackArguments& arguments) {
  const std::filesystem::path file = PathOnDisk(arguments.single);
  const std::string name = file.filename().string();
  const bool own = name.rfind("shard-", 0) == 0 || name == "INDEX.json";
  if (own && file.parent_path() == PathOnDisk(arguments.out + "/"))
    throw UsageError("--single " + arguments.single + ": the pack itself has a file of this kind there; choose another name");
}

CommandResult RunPack(PackArguments arguments, CommandContext& context) {
  CheckUse(arguments);
  dataset::PackOptions& options = arguments.options;
  if (!arguments.frames.empty()) options.frames = ParseRanges("--frames", arguments.frames);
  const dataset::ShardShare share = arguments.shard.empty() ? dataset::ShardShare{} : ParseShare(arguments.shard);
  CommandResult result;
  if (!arguments.single.empty()) RequireApart(arguments);
  if (!arguments.dataset.empty()) CheckJoints(arguments, &result);
  const dataset::PackBuildReport report =
      arguments.merge ? dataset::MergePack(arguments.out, context.run)
                      : dataset::BuildPack(arguments.dataset, arguments.out, options, share, context.run);
  result.metrics.update(Metrics(report));
  result.text = Text(arguments, report);
  result.outputs.push_back({arguments.out, "pack"});
  if (!arguments.dataset.empty()) result.inputs.push_back(arguments.dataset);
  AddNotices(report, &result);
  if (arguments.options.masks) stages::TellMasks(report.masks, arguments.dataset + "/masks", &result);
  if (!arguments.single.empty() && report.complete) {
    const OutputFiles place({arguments.single}, {arguments.dataset});
    dataset::WriteSinglePack(arguments.out, arguments.single);
    result.outputs.push_back({arguments.single, "pack"});
  }
  return result;
}

}  // namespace

void RegisterDatasetPack(CLI::App& dataset, Registry& registry) {
  auto arguments = std::make_shared<PackArguments>();
  CLI::App* sub = dataset.add_subcommand(
      "pack", "Dataset -> HDF5 shards of crops or whole images with cameras, masks and joints, for training and archive");
  StartGroup(sub, "Pack");
  AddOption(sub, "dataset", arguments->dataset, "dataset folder in Panoptic layout");
  AddOutput(sub, "--out", arguments->out, OutputKind::kFolder, "folder of the pack; an unfinished one is continued")
      ->required();
  AddOption(sub, "--shard", arguments->shard,
            "K/N: make only every N-th shard, from K; several terminals or a job array share a pack");
  AddFlag(sub, "--merge", arguments->merge, "check that all shards are there and write INDEX.json");
  AddFlag(sub, "--allow-lost-joints", arguments->allow_lost_joints,
          "pack a dataset of another skeleton although most of its joints are none of Panoptic's 19");
  AddOutput(sub, "--single", arguments->single, OutputKind::kFile, "copy the finished pack into this one HDF5 file as well");
  StartGroup(sub, "Content");
  AddOption(sub, "--cameras", arguments->options.cameras, "Panoptic or studio names, separated by commas; default: all")
      ->delimiter(',');
  AddOption(sub, "--frames", arguments->frames, "frames to pack, e.g. 0-99,150; default: all with 3D joints");
  AddOption(sub, "--split", arguments->options.split,
            "split file: pack its images only, each marked train, validation or test");
  AddOptions(sub, arguments->options);
  StartGroup(sub, "Undistortion and colours");
  AddOptions(sub, arguments->options.undistort_view);
  AddOptions(sub, arguments->options.colour);
  registry.Add(sub, "dataset pack", [arguments](CommandContext& context) { return RunPack(*arguments, context); });
}

}  // namespace mvstudio::cli
