#pragma once

#include <string>
#include <string_view>

#include "core/choice/option_group.h"
#include "core/choice/option_style.h"
#include "core/fields.h"
#include "stages/input/pose_input.h"
#include "stages/input/project_input.h"
#include "stages/input/session_input.h"
#include "triangulate/sync/sync.h"

/// Time offsets of the cameras of a take: what a caller gives.
namespace mvstudio::stages {

enum class SyncSource { kPoses, kTimestamps, kTimecodes, kMotionEnergy };

inline constexpr ChoiceWords<SyncSource, 4> kSyncSourceWords = {{{SyncSource::kPoses, "poses"},
                                                                 {SyncSource::kTimestamps, "timestamps"},
                                                                 {SyncSource::kTimecodes, "timecodes"},
                                                                 {SyncSource::kMotionEnergy, "motion-energy"}}};
inline std::string_view ToString(SyncSource source) { return WordOf(kSyncSourceWords, source); }
inline void FromString(const std::string& text, SyncSource* source) {
  *source =
      KnownChoice(kSyncSourceWords, text, "option 'from' " + text + ": expected poses, timestamps, timecodes or motion-energy");
}

struct SyncOptions {
  PoseArguments pose;
  SessionArguments session;
  std::string project;  ///< a folder, instead of the session and the poses
  SyncSource from = SyncSource::kPoses;
  double fps_hz = 0;  ///< of all cameras; 0: as the session states it, else unknown
  triangulate::SyncOptions search;
  bool keep_range = false;  ///< search.max_offset_frames holds also where the frame rate is known; else 3 s are searched
  std::string out;          ///< folder of sync.json; empty: that of the session's take
};

template <class Visitor>
void VisitFields(Visitor&& visit, SyncOptions& o) {
  VisitFields(visit, o.pose);
  VisitSession(visit, o.session, "calibration, poses and footage", "people");
  visit("project", o.project, kProjectHelp);
  StartGroup(visit, "Offsets");
  visit("from", o.from,
        "poses: people's 2D joints; timestamps: the take's table of times; timecodes: of the videos, to a frame; "
        "motion-energy: images only, coarse");
  VisitStyled(visit, OptionStyle::kUnset, "fps,frame-rate", o.fps_hz,
              "Hz; frame rate of all cameras; then offsets are searched within 3 s and given in ms, too");
  VisitFields(visit, o.search);
  StartGroup(visit, "Output");
  VisitStyled(visit, OptionStyle::kFolder, "out", o.out, "folder for sync.json; SESSION/sync/TAKE unless given");
}

}  // namespace mvstudio::stages
