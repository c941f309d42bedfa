#include "stages/triangulate/project_parts.h"

#include <filesystem>

#include "core/disk/files.h"
#include "core/text/shortest_text.h"
#include "dataset/trackers/project_world.h"
#include "geometry/rig/rig_covariance.h"
#include "geometry/rig/rig_io.h"

namespace mvstudio::stages {
namespace {

/// A filter that counts in frames, in seconds.
std::string FilterInSeconds(const std::string& filter, double rate_hz) {
  constexpr char kFrames[] = "gaussian-frames:";
  if (filter.rfind(kFrames, 0) != 0) return filter;
  return "gaussian:" + ShortestText(std::stod(filter.substr(sizeof(kFrames) - 1)) / rate_hz) + "s";
}

bool AsksForWorld(const dataset::ProjectSettings& settings) {
  return !settings.axes.empty() || !settings.reference_point.empty();
}

}  // namespace

ProjectUse UseProject(ProjectInput project, const std::set<std::string>& given, triangulate::TakeOptions* take,
                      MarkerOptions* markers, InputNotes* notes) {
  ProjectUse used;
  used.input = std::move(project);
  const dataset::ProjectSettings& settings = used.input.settings;
  const auto use = [&](const char* option, const std::string& value) {
    if (given.count(option) > 0) return false;
    used.settings.emplace_back(option, value);
    return true;
  };
  if (settings.min_score && use("min-score", ShortestText(*settings.min_score))) take->min_score = *settings.min_score;
  if (settings.min_views && use("min-views", std::to_string(*settings.min_views))) take->min_views = *settings.min_views;
  if (settings.frame_rate_hz && use("frame-rate", ShortestText(*settings.frame_rate_hz)))
    markers->rate_hz = *settings.frame_rate_hz;
  const bool smooths = !settings.filter.empty() || settings.fill_frames.value_or(0) > 0;
  if (smooths && markers->rate_hz > 0) {
    if (markers->to.empty() && use("to", "trc")) markers->to = "trc";
    const std::string filter = settings.filter.empty() ? "" : FilterInSeconds(settings.filter, markers->rate_hz);
    if (!filter.empty() && use("filter", filter)) markers->filter = filter;
    if (settings.fill_frames && use("fill", std::to_string(*settings.fill_frames)))
      markers->fill_frames = *settings.fill_frames;
  } else if (smooths) {
    notes->warnings.push_back({"POSE-PROJECT", "the project's filter and filled gaps need its frame rate, which is not stated",
                               "give option 'frame-rate'"});
  }
  return used;
}

std::vector<std::string> ProjectFiles(const dataset::ProjectSettings& settings) {
  std::vector<std::string> files;
  if (AsksForWorld(settings)) files.push_back("calibration.json");
  if (!settings.angles.empty()) files.push_back("angles.csv");
  return files;
}

void WriteProjectParts(const geometry::Rig& rig, const std::string& project, const std::string& out, dataset::Pose3d* pose,
                       ProjectUse* use) {
  namespace fs = std::filesystem;
  const dataset::ProjectSettings& settings = use->input.settings;
  if (AsksForWorld(settings)) {
    const dataset::ProjectWorld world = WorldOfProject(settings, pose->rows, project);
    MoveTo(world, &pose->rows);
    geometry::Rig moved = geometry::InWorld(rig, world.new_from_old);
    pose->world = use->world = world.text;
    moved.gauge = geometry::RigGauge::Other(world.text);
    use->calibration = (fs::path(out) / "calibration.json").string();
    geometry::WriteRig(moved, use->calibration);
  }
  if (settings.angles.empty()) return;
  use->angles = (fs::path(out) / "angles.csv").string();
  WriteFileAtomic(use->angles, ProjectAnglesCsv(settings, pose->rows));
}

}  // namespace mvstudio::stages
