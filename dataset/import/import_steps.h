// Private: the steps of ImportPanoptic.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "dataset/import/panoptic_import.h"
#include "dataset/panoptic/sequence.h"
#include "dataset/panoptic/time.h"
#include "dataset/session/session.h"
#include "dataset/verify/findings.h"

namespace mvstudio::dataset::internal {

struct FrameRange {
  int first = 0, last = 99999999;
  bool Has(int frame) const { return frame >= first && frame <= last; }
};
FrameRange ParseFrameRange(const std::string& text);

struct ImportJob {
  const PanopticImportOptions& options;
  const RunContext& run;
  PanopticSequence sequence;
  geometry::Rig rig;       ///< the selected cameras
  std::string take, work;  ///< name of the take; the session's folder under construction
  FrameRange range;
  Findings findings;
};

/// Converts the joints of `scenes` to the session's pose3d/TAKE, one file at a time; unreadable ones are listed. Returns
/// the times that the files state, by frame.
std::map<int, double> ImportJoints(ImportJob* job, const PanopticFrames& scenes, const std::string& take,
                                   PanopticImportReport* report);

/// Path of a camera's footage in the session, and its frame numbers.
struct ImportedFootage {
  std::string camera, path;  ///< relative to the session; empty: unreadable
  std::vector<int> frames;   ///< numbers as in the session's footage
  int64_t images = 0;        ///< copied or decoded
};
/// Links, copies or decodes the footage and masks of a camera; reports unreadable files in `findings`.
ImportedFootage ImportFootage(const ImportJob& job, const geometry::RigCamera& camera, const std::string& take,
                              Findings* findings);

/// Known clocks of the selected cameras, by kind ("hd", "vga") and of each Kinect by name. Adds findings about tables that
/// contradict the joints.
std::map<std::string, PanopticClock> ImportClocks(ImportJob* job, const std::map<int, double>& hd_scene_times);

}  // namespace mvstudio::dataset::internal
