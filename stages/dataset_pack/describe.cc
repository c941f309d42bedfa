#include "stages/dataset_pack/describe.h"

#include <algorithm>

#include "core/format.h"
#include "core/join.h"
#include "stages/frame_notice.h"
#include "stages/input/mask_notice.h"

namespace mvstudio::stages {
namespace {

using nlohmann::ordered_json;

ordered_json UndistortionJson(const dataset::PackUndistortion& u) {
  return {{"camera", u.camera},
          {"max_joint_px", FiniteOrNull(u.max_joint_px)},
          {"max_map_px", FiniteOrNull(u.max_map_px)},
          {"lost_share", u.lost_share},
          {"empty_share", u.empty_share}};
}

ordered_json PackMetrics(const DatasetPackReport& report) {
  const dataset::PackBuildReport& built = report.built;
  const dataset::PackTimes& t = built.times;
  ordered_json m = ordered_json::object();
  if (report.lost) m["lost_joints"] = report.lost->names;
  m.update({{"shards", built.num_shards},
            {"built", built.built},
            {"kept", built.kept},
            {"busy", built.busy},
            {"samples", built.samples},
            {"bytes", built.bytes},
            {"complete", built.complete},
            {"skipped", built.skipped}});
  m["missing"] = ordered_json::parse(dataset::MissingToJsonText(built.missing));
  m["frames_without_person"] = built.frames_without_person;
  m["times"] = {{"decode_s", t.decode_s}, {"hash_s", t.hash_s},     {"resample_s", t.resample_s}, {"encode_s", t.encode_s},
                {"write_s", t.write_s},   {"verify_s", t.verify_s}, {"wall_s", t.wall_s},         {"threads", built.threads}};
  // How far the build is from doing nothing but decoding its input.
  const double decode_wall_s = t.decode_s / std::max(built.threads, 1);
  m["wall_over_decode"] = decode_wall_s > 0 ? FiniteOrNull(t.wall_s / decode_wall_s) : ordered_json();
  if (!built.colour_reason.empty()) m["colour"] = built.colour_reason;
  for (const dataset::PackUndistortion& u : built.undistortion) m["undistortion"].push_back(UndistortionJson(u));
  return m;
}

std::string UndistortionText(const dataset::PackBuildReport& built) {
  if (built.undistortion.empty()) return "";
  double map_px = 0, lost = 0;
  for (const dataset::PackUndistortion& u : built.undistortion) {
    map_px = std::max(map_px, u.max_map_px), lost = std::max(lost, u.lost_share);
  }
  return Format("  undistorted: images are within %.1g px of the lens; at most %.1f %% of a camera's image is not shown\n",
                map_px, 100 * lost);
}

std::string PackSummary(const std::string& out, const dataset::PackBuildReport& built) {
  const dataset::PackTimes& t = built.times;
  std::string text = Format("%s: %zu of %d shards (%zu made, %zu kept), %lld images, %.1f MB in %.1f s%s\n", out.c_str(),
                            built.built.size() + built.kept.size(), built.num_shards, built.built.size(), built.kept.size(),
                            static_cast<long long>(built.samples), static_cast<double>(built.bytes) / 1e6, t.wall_s,
                            built.complete ? "; complete" : "");
  if (!built.built.empty()) {
    text +=
        Format("  decode %.1f s, hash %.1f s, resample %.1f s, encode %.1f s (over %d threads); write %.1f s, verify %.1f s\n",
               t.decode_s, t.hash_s, t.resample_s, t.encode_s, built.threads, t.write_s, t.verify_s);
  }
  if (!built.colour_reason.empty()) text += "  colours: " + built.colour_reason + "\n";
  text += UndistortionText(built);
  for (const std::string& note : built.notes) text += "  " + note + "\n";
  return text;
}

/// What is not in the pack, or not as it should be.
CommandResult DescribeLacks(const dataset::PackBuildReport& built) {
  CommandResult result;
  NoteFrames(built.frames_beyond, &result);
  if (!built.skipped.empty()) {
    const std::string text = built.missing.missing() > 0 ? dataset::MissingText(built.missing)
                                                         : std::to_string(built.skipped.size()) + " pictures were left out";
    result.warnings.push_back(
        {"PCK-SKIPPED", text + "; the first: " + built.skipped.front(), dataset::MissingHint(built.missing)});
    result.exit = kExitPartial;
  } else if (built.missing.missing() > 0) {
    result.warnings.push_back({"PCK-MISSING", dataset::MissingText(built.missing), dataset::MissingHint(built.missing)});
  }
  if (built.colour_status != Status::kOk) {
    result.warnings.push_back({"PCK-COLOUR", "colours were not matched: " + built.colour_reason,
                               "check the masks, pack more frames, or leave out option 'match-colours'"});
  }
  if (built.busy.empty()) return result;
  const std::string numbers = Join(built.busy, ", ", [](int number) { return std::to_string(number); });
  result.errors.push_back({"PCK-BUSY", "shards being made by someone else: " + numbers + " (" + built.busy_owner + ")",
                           "run the same command again when that is done"});
  result.exit = kExitTryAgain;
  return result;
}

}  // namespace

CommandResult Describe(const DatasetPackReport& report) {
  const DatasetPackOptions& options = report.options;
  CommandResult result;
  if (report.lost)
    result.warnings.push_back({"PCK-JOINTS", report.lost->Text(), "the dataset keeps them, in " + report.lost->folder});
  result.metrics = PackMetrics(report);
  result.text = PackSummary(options.out, report.built);
  result.outputs.push_back({options.out, "pack"});
  if (!options.dataset.empty()) result.inputs.push_back(options.dataset);
  result.Add(DescribeLacks(report.built));
  if (options.pack.masks) result.Add(DescribeMaskMeaning(report.built.masks, options.dataset + "/masks", result.text));
  if (report.wrote_single) result.outputs.push_back({options.single, "pack"});
  return result;
}

}  // namespace mvstudio::stages
