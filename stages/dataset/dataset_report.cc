#include "stages/dataset/dataset_report.h"

#include <algorithm>
#include <filesystem>

#include "core/error.h"
#include "core/format.h"
#include "core/text/shell_word.h"
#include "dataset/pack/pack.h"
#include "dataset/panoptic/panoptic.h"
#include "dataset/panoptic/sequence.h"
#include "dataset/verify/session_check.h"
#include "stages/dataset/session_table.h"
#include "stages/words.h"

namespace mvstudio::stages {
namespace {

using nlohmann::ordered_json;

CommandResult VerifyFolder(const std::string& folder, const dataset::VerifyOptions& options, const RunContext& run,
                           const dataset::KeptChecks& kept) {
  const dataset::VerifyReport report = dataset::VerifyDataset(folder, options, run, kept);
  CommandResult result;
  result.metrics = {{"num_errors", report.num_errors()}, {"num_warnings", report.num_warnings()}};
  result.Add(DescribeDatasetFindings(report.findings));
  const std::pair<const char*, int> counts[] = {
      {"cameras", report.cameras}, {"frames", report.frames}, {"pictures", report.images}, {"masks", report.masks},
      {"videos", report.videos},   {"faces", report.faces},   {"hands", report.hands}};
  for (const auto& [name, count] : counts) result.metrics[name] = count;
  result.metrics["skeleton"] = report.skeleton.empty() ? "coco19" : report.skeleton;
  result.metrics["own_frames"] = report.own_frames;
  result.metrics["missing_pictures"] = report.no_image;
  result.metrics["missing_masks"] = report.no_mask;
  result.text += std::to_string(report.cameras) + " cameras with images, " + std::to_string(report.frames) +
                 " frames: " + Counted(report.num_errors(), "error") + ", " + Counted(report.num_warnings(), "warning") + "\n";
  if (!report.unusable.empty()) {
    result.errors.push_back({"DAT-UNUSABLE", folder + ": " + report.unusable, ""});
    result.text += "nothing can be made of it: " + report.unusable + "\n";
  }
  result.exit = !report.unusable.empty() ? kExitBadInput : report.num_errors() > 0 ? kExitPartial : kExitOk;
  return result;
}

/// A pack of which no image can be read is bad input; else what is damaged is a part.
CommandResult VerifyPackFile(const std::string& path, const RunContext& run) {
  const dataset::PackReport report = dataset::VerifyPack(path, {}, run);
  CommandResult result;
  const int errors = report.num_errors();
  result.metrics = {{"num_errors", errors}, {"num_warnings", static_cast<int>(report.findings.size()) - errors}};
  result.Add(DescribeDatasetFindings(report.findings));
  result.metrics["shards"] = report.info.shards;
  result.metrics["samples"] = report.info.samples;
  result.metrics["images"] = report.images;
  result.metrics["masks"] = report.masks;
  result.text += std::to_string(report.info.shards) + " shards, " + std::to_string(report.images) +
                 " images: " + Counted(errors, "error") + ", " +
                 Counted(static_cast<int64_t>(report.findings.size()) - errors, "warning") + "\n";
  result.exit = errors == 0 ? kExitOk : report.images == 0 ? kExitBadInput : kExitPartial;
  return result;
}

bool IsSession(const std::string& path) { return std::filesystem::exists(std::filesystem::path(path) / "mvstudio.toml"); }

/// First and last number and how many there are; null without any.
template <class Value>
ordered_json RangeMetrics(const std::map<int, Value>& frames) {
  if (frames.empty()) return nullptr;
  return {{"count", frames.size()}, {"first", frames.begin()->first}, {"last", frames.rbegin()->first}};
}

template <class Value>
std::string RangeText(const char* what, const std::map<int, Value>& frames) {
  if (frames.empty()) return "";
  return std::string("  ") + what + ": " + std::to_string(frames.size()) + ", frames " + std::to_string(frames.begin()->first) +
         " to " + std::to_string(frames.rbegin()->first) + "\n";
}

std::string AliasOf(const std::map<std::string, std::string>& aliases, const std::string& name) {
  for (const auto& [alias, panoptic] : aliases) {
    if (panoptic == name) return alias;
  }
  return "";
}

/// Its entry of the metrics, and its line of text.
std::pair<ordered_json, std::string> DescribeCamera(const geometry::Camera& camera, const dataset::PanopticSequence& sequence,
                                                    const std::string& alias) {
  const auto found = sequence.footage.find(camera.name);
  const bool none = found == sequence.footage.end();
  const bool video = !none && found->second.is_video, images = !none && !video;
  ordered_json entry = {{"name", camera.name},
                        {"alias", alias},
                        {"width", camera.width_px},
                        {"height", camera.height_px},
                        {"model", std::string(geometry::ToString(camera.model))},
                        {"footage", none    ? "none"
                                    : video ? "video"
                                            : "pictures"}};
  if (images) entry["pictures"] = RangeMetrics(found->second.images);
  if (none && !sequence.footage.empty()) return {entry, ""};  // 479 lines of cameras without images help nobody
  std::string line = "  " + camera.name + (alias.empty() ? "" : " (" + alias + ")") + " " + std::to_string(camera.width_px) +
                     "x" + std::to_string(camera.height_px) + " " + entry["model"].get<std::string>();
  if (images) line += ", " + std::to_string(found->second.images.size()) + " images";
  return {entry, line + (video ? ", video\n" : "\n")};
}

int MostPeople(const dataset::PanopticFrames& scenes) {
  size_t most = 0;
  for (const auto& [frame, path] : scenes.files) {
    const dataset::PanopticScene scene = dataset::ReadPanopticScene(path);
    most = std::max(most, static_cast<size_t>(std::count_if(scene.bodies.begin(), scene.bodies.end(),
                                                            [](const dataset::PanopticBody& b) { return b.id >= 0; })));
  }
  return static_cast<int>(most);
}

CommandResult FolderInfo(const std::string& folder) {
  const dataset::PanopticSequence sequence = dataset::ScanPanopticSequence(folder);
  const geometry::Rig rig = dataset::ReadPanopticCalibration(sequence.calibration);
  const auto aliases = dataset::ReadPanopticAliases(folder);
  const auto& scenes = sequence.hd_scenes.files;
  CommandResult result;
  result.inputs = {folder};
  const int people = MostPeople(sequence.hd_scenes);
  result.metrics = {{"sequence", sequence.name}, {"cameras", sequence.footage.size()}, {"frames", scenes.size()}};
  result.metrics["first_frame"] = scenes.empty() ? ordered_json() : ordered_json(scenes.begin()->first);
  result.metrics["last_frame"] = scenes.empty() ? ordered_json() : ordered_json(scenes.rbegin()->first);
  result.metrics["most_people"] = people;
  std::map<std::string, int> kinds;
  for (const auto& c : rig.cameras) {
    int panel = 0, node = 0;
    ++kinds[dataset::ParsePanopticName(c.camera.name, &panel, &node) ? ToString(dataset::KindOfPanel(panel)) : "other"];
  }
  result.metrics["calibrated"] = kinds;
  result.metrics["vga_scenes"] = RangeMetrics(sequence.vga_scenes.files);
  result.metrics["faces"] = RangeMetrics(sequence.faces.files);
  result.metrics["hands"] = RangeMetrics(sequence.hands.files);
  result.metrics["camera_list"] = ordered_json::array();
  result.text = "sequence " + sequence.name + ", calibrated:";
  for (const auto& [kind, count] : kinds) result.text += " " + std::to_string(count) + " " + kind;
  result.text +=
      "; " + std::to_string(sequence.footage.size()) + " with footage; " + std::to_string(people) + " people at most\n";
  result.text += RangeText("joints", scenes) + RangeText("joints at 25 fps", sequence.vga_scenes.files) +
                 RangeText("faces", sequence.faces.files) + RangeText("hands", sequence.hands.files);
  if (sequence.footage.empty()) result.text += "  no images and no videos\n";
  for (const auto& c : rig.cameras) {
    if (rig.cameras.size() > 60 && sequence.footage.empty()) break;
    const auto [entry, line] = DescribeCamera(c.camera, sequence, AliasOf(aliases, c.camera.name));
    result.metrics["camera_list"].push_back(entry);
    result.text += line;
  }
  return result;
}

const char* ViewName(dataset::PackView view) {
  return view == dataset::PackView::kCrop ? "crop" : view == dataset::PackView::kFull ? "full" : "undistorted";
}

CommandResult PackFileInfo(const std::string& path) {
  const dataset::PackInfo info = dataset::ReadPackInfo(path);
  CommandResult result;
  result.inputs = {path};
  result.metrics = {{"sequence", info.sequence},     {"view", ViewName(info.view)}, {"image_codec", info.image_codec},
                    {"mask_codec", info.mask_codec}, {"width", info.width_px},      {"height", info.height_px},
                    {"shards", info.shards},         {"cameras", info.cameras},     {"frames", info.frames},
                    {"people", info.people},         {"samples", info.samples},     {"bytes", info.bytes},
                    {"complete", info.complete}};
  result.text = Format("pack of %s: %lld %s images, %s, masks %s; %d cameras, %d frames, %d people; %d shards, %.1f MB%s\n",
                       info.sequence.c_str(), static_cast<long long>(info.samples), ViewName(info.view),
                       info.image_codec.c_str(), info.mask_codec.c_str(), info.cameras, info.frames, info.people, info.shards,
                       static_cast<double>(info.bytes) / 1e6, info.complete ? "" : "; not complete");
  return result;
}

/// A session's takes, and what was made of them.
CommandResult SessionInfo(const std::string& folder) {
  const dataset::Session session = dataset::ReadSession(folder);
  dataset::InspectOptions options;
  options.compare = false;
  const dataset::SessionReport report = dataset::InspectSession(session, options);
  CommandResult result;
  result.inputs = {folder};
  result.metrics = {{"session", session.folder}, {"units", session.units}, {"cameras", session.cameras.size()}};
  const std::string calibration = dataset::CalibrationOf(session, true);
  result.metrics["calibration"] = calibration.empty() ? ordered_json() : ordered_json(calibration);
  result.metrics["takes"] = ordered_json::array();
  result.text = "session " + session.folder + ": " + std::to_string(session.cameras.size()) + " cameras, lengths in " +
                session.units + ", " + (calibration.empty() ? "no calibration" : "calibration " + calibration) + "\n";
  for (const dataset::SessionTake& take : session.takes) {
    const std::string filmed(ToString(take.kind));
    ordered_json entry = {{"name", take.name}, {"kind", filmed}, {"cameras", take.footage.size()}};
    result.text += "  take " + take.name + " (" + filmed + "): " + std::to_string(take.footage.size()) + " cameras";
    for (const char* kind : {"pose2d", "masks", "sync", "pose3d", "dataset"}) {
      const bool there = std::filesystem::is_directory(dataset::TakeFolder(session, kind, take.name));
      entry[kind] = there;
      if (there) result.text += std::string(", ") + kind;
    }
    result.text += "\n";
    result.metrics["takes"].push_back(entry);
  }
  result.metrics["footage"] = FootageJson(report);
  result.text += FootageText(report);
  result.Add(DescribeFootageFindings(report));
  return result;
}

}  // namespace

CommandResult DescribeDatasetFindings(const std::vector<dataset::Finding>& findings) {
  CommandResult result;
  result.metrics["findings"] = ordered_json::array();
  for (const dataset::Finding& f : findings) {
    const bool error = f.severity == dataset::Finding::Severity::kError;
    result.metrics["findings"].push_back(
        {{"severity", error ? "error" : "warning"}, {"code", f.code}, {"path", f.path}, {"text", f.text}});
    (error ? result.errors : result.warnings).push_back({f.code, f.path + ": " + f.text, ""});
  }
  return result;
}

CommandResult VerifyDatasetOrPack(const std::string& path, const dataset::VerifyOptions& options, const RunContext& run,
                                  const dataset::KeptChecks& kept) {
  if (IsSession(path)) {
    throw UsageError(path + " is a session: see mvstudio doctor " + ShellWord(path) +
                     "; dataset verify looks at datasets and packs");
  }
  CommandResult result = dataset::IsPack(path) ? VerifyPackFile(path, run) : VerifyFolder(path, options, run, kept);
  result.inputs = {path};
  return result;
}

CommandResult DescribeDataset(const std::string& path) {
  if (IsSession(path)) return SessionInfo(path);
  return dataset::IsPack(path) ? PackFileInfo(path) : FolderInfo(path);
}

}  // namespace mvstudio::stages
