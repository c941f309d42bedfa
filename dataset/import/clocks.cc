#include "dataset/import/import_steps.h"
#include "dataset/panoptic/panoptic.h"
#include "dataset/panoptic/panoptic_json.h"

namespace mvstudio::dataset::internal {
namespace {

PanopticSyncTables ReadTables(const std::string& path, Findings* findings) {
  if (path.empty()) return {};
  try {
    return ReadPanopticSyncTables(path);
  } catch (const FormatError& error) {
    findings->Error("DAT-SYNC", path, WithoutPath(error));
    return {};
  }
}

/// The times that the joints state, with those of the table for the other frames. `trust_prior`: take the usual shift when
/// there are no joints to measure it by.
std::map<int, double> WithTable(std::map<int, double> known_ms, const PanopticSyncTrack* track, bool trust_prior,
                                const std::string& path, Findings* findings) {
  if (!track) return known_ms;
  const PanopticTableMatch match = MatchPanopticTable(known_ms, *track);
  if (match.contradicts()) {
    findings->Warning("DAT-SYNC", path,
                      track->place.back() + ": its times and those of the joints differ by " + NumberText(match.residual_ms) +
                          " ms; the joints' are taken");
  } else if (match.compared > 0 || trust_prior) {
    AddTable(*track, match, &known_ms);
  }
  return known_ms;
}

std::map<int, double> TimesOfScenes(const PanopticFrames& scenes, Findings* findings) {
  std::map<int, double> times;
  for (const auto& [frame, path] : scenes.files) {
    try {
      const double time = ReadPanopticScene(path).univ_time_ms.value_or(-1);
      if (time >= 0) times[frame] = time;
    } catch (const FormatError& error) {
      findings->Error("DAT-POSE", path, WithoutPath(error));
    }
  }
  return times;
}

/// By the numbers in the names of images, or the positions in a video, which begin at 0.
std::map<int, double> KinectTimes(const PanopticSequence& sequence, const PanopticSyncTables& tables, const std::string& camera,
                                  int node) {
  std::map<int, double> times = KinectColorTimesMs(tables, node);
  const auto footage = sequence.footage.find(camera);
  if (footage == sequence.footage.end() || !footage->second.is_video) return times;
  std::map<int, double> positions;
  for (const auto& [number, time] : times) positions[number - 1] = time;
  return positions;
}

}  // namespace

std::map<std::string, PanopticClock> ImportClocks(ImportJob* job, const std::map<int, double>& hd_scene_times) {
  const PanopticSequence& sequence = job->sequence;
  const PanopticSyncTables tables = ReadTables(sequence.sync, &job->findings);
  const PanopticSyncTables kinect = ReadTables(sequence.kinect_sync, &job->findings);
  std::map<std::string, PanopticClock> clocks;
  const auto add = [&clocks](const std::string& key, std::map<int, double> known_ms) {
    if (!known_ms.empty()) clocks[key] = FitPanopticClock(std::move(known_ms));
  };
  add("hd", WithTable(hd_scene_times, tables.Find("hd"), true, sequence.sync, &job->findings));
  add("vga",
      WithTable(TimesOfScenes(sequence.vga_scenes, &job->findings), tables.Find("vga"), false, sequence.sync, &job->findings));
  for (const auto& camera : job->rig.cameras) {
    int panel = 0, node = 0;
    const std::string& name = camera.camera.name;
    if (ParsePanopticName(name, &panel, &node) && KindOfPanel(panel) == PanopticKind::kKinect)
      add(name, KinectTimes(sequence, kinect, name, node));
  }
  return clocks;
}

}  // namespace mvstudio::dataset::internal
