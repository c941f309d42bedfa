#include "cli/people/project_options.h"

#include <filesystem>

#include "core/disk/files.h"
#include "core/format.h"
#include "core/text/shortest_text.h"
#include "dataset/trackers/project_world.h"
#include "geometry/rig/rig_covariance.h"
#include "geometry/rig/rig_io.h"

namespace mvstudio::cli {
namespace {

/// A filter that counts in frames, in seconds.
std::string FilterInSeconds(const std::string& filter, double rate_hz) {
  constexpr char kFrames[] = "gaussian-frames:";
  if (filter.rfind(kFrames, 0) != 0) return filter;
  return "gaussian:" + ShortestText(std::stod(filter.substr(sizeof(kFrames) - 1)) / rate_hz) + "s";
}

}  // namespace

void ApplyProject(const dataset::ProjectSettings& settings, const std::set<std::string>& given, triangulate::TakeOptions* take,
                  app::MarkerOptions* markers, app::CommandResult* result) {
  nlohmann::ordered_json used = nlohmann::ordered_json::object();
  std::string text;
  const auto use = [&](const char* option, const std::string& value) {
    if (given.count(option) > 0) return false;
    used[std::string(option).substr(2)] = value;
    text += std::string(text.empty() ? "" : " ") + option + " " + value;
    return true;
  };
  if (settings.min_score && use("--min-score", ShortestText(*settings.min_score))) take->min_score = *settings.min_score;
  if (settings.min_views && use("--min-views", std::to_string(*settings.min_views))) take->min_views = *settings.min_views;
  if (settings.frame_rate_hz && use("--frame-rate", ShortestText(*settings.frame_rate_hz)))
    markers->rate_hz = *settings.frame_rate_hz;
  const bool smooths = !settings.filter.empty() || settings.fill_frames.value_or(0) > 0;
  if (smooths && markers->rate_hz > 0) {
    if (markers->to.empty() && use("--to", "trc")) markers->to = "trc";
    if (!settings.filter.empty()) {
      const std::string filter = FilterInSeconds(settings.filter, markers->rate_hz);
      if (use("--filter", filter)) markers->filter = filter;
    }
    if (settings.fill_frames && use("--fill", std::to_string(*settings.fill_frames)))
      markers->fill_frames = *settings.fill_frames;
  } else if (smooths) {
    result->warnings.push_back(
        {"POSE-PROJECT", "the project's filter and filled gaps need its frame rate, which is not stated", "give --frame-rate"});
  }
  if (used.empty()) return;
  result->metrics["project"]["settings"] = used;
  result->text += "of the project's configuration: " + text + "\n";
}

void WriteProjectParts(const dataset::ProjectSettings& settings, const geometry::Rig& rig, const std::string& project,
                       const std::string& out, dataset::Pose3d* pose, app::CommandResult* result) {
  namespace fs = std::filesystem;
  if (!settings.axes.empty() || !settings.reference_point.empty()) {
    const dataset::ProjectWorld world = WorldOfProject(settings, pose->rows, project);
    MoveTo(world, &pose->rows);
    pose->world = world.text;
    geometry::Rig moved = geometry::InWorld(rig, world.new_from_old);
    moved.gauge = geometry::RigGauge::Other(world.text);
    const std::string path = (fs::path(out) / "calibration.json").string();
    geometry::WriteRig(moved, path);
    result->outputs.push_back({path, ""});
    result->text +=
        "points are in the world " + world.text.substr(world.text.find(": ") + 2) + "; calibration.json is in it, too\n";
    result->metrics["project"]["world"] = world.text;
  }
  if (settings.angles.empty()) return;
  const std::string path = (fs::path(out) / "angles.csv").string();
  WriteFileAtomic(path, ProjectAnglesCsv(settings, pose->rows));
  result->outputs.push_back({path, "angles"});
}

}  // namespace mvstudio::cli
