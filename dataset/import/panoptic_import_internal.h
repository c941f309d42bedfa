#pragma once

#include <map>
#include <string>
#include <vector>

#include "dataset/import/panoptic_import.h"
#include "dataset/panoptic/sequence.h"
#include "dataset/panoptic/time.h"
#include "dataset/session/session.h"
#include "dataset/verify/verify_internal.h"

/// The halves of ImportPanoptic; not part of the module's public face.
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
  geometry::Rig rig;       ///< the chosen cameras
  std::string take, work;  ///< name of the take; the session's folder while it is made
  FrameRange range;
  Findings findings;
};

/// Joints of `scenes` become the session's pose3d/TAKE, a file at a time; what cannot be read is listed. Returns the times that
/// the files state, by frame.
std::map<int, double> ImportJoints(ImportJob* job, const PanopticFrames& scenes, const std::string& take,
                                   PanopticImportReport* report);

/// Where a camera's footage lies in the session, and its frames' numbers.
struct ImportedFootage {
  std::string camera, path;  ///< relative to the session; empty: it could not be read
  std::vector<int> frames;   ///< numbers as in the session's footage
  int64_t pictures = 0;      ///< copied or decoded
};
/// Links, copies or decodes the footage of a camera, and its masks; says in `findings` what could not be read.
ImportedFootage ImportFootage(const ImportJob& job, const geometry::RigCamera& camera, const std::string& take,
                              Findings* findings);

/// Clocks of the chosen cameras by kind ("hd", "vga") and of each Kinect by name; findings about tables that contradict the
/// joints. Those not known are not there.
std::map<std::string, PanopticClock> ImportClocks(ImportJob* job, const std::map<int, double>& hd_scene_times);

}  // namespace mvstudio::dataset::internal
