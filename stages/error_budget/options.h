#pragma once

#include <string>
#include <vector>

#include "core/choice/option_group.h"
#include "core/choice/option_style.h"
#include "stages/input/pose_input.h"
#include "stages/input/session_input.h"

/// Which stage an error comes from, and whether sigmas are true: what a caller gives.
namespace mvstudio::stages {

struct ErrorBudgetOptions {
  PoseArguments pose;
  SessionArguments session;
  std::string sync;                            ///< sync.json of the take; may be empty
  std::string truth, truth_calib, truth_sync;  ///< 3D joints, calibration, offsets; empty: those of a studio with truth
  bool stated = false;                         ///< from sigmas alone, also where there is truth
  bool reliability = false;
  std::vector<std::string> more;  ///< sessions with truth whose errors count with those of the first
  double sigma_px = 0, min_score = 0.3;
  int max_persons = 1, seeds = 5;
  std::string out;
};

template <class Visitor>
void VisitFields(Visitor&& visit, ErrorBudgetOptions& o) {
  VisitFields(visit, o.pose);
  VisitSession(visit, o.session, "calibration, 2D poses, time offsets and truth", "people");
  StartGroup(visit, "Timing");
  visit("sync", o.sync, "sync.json of `mvstudio sync`: time offsets of the cameras; the session's unless given");
  StartGroup(visit, "Truth");
  visit("truth", o.truth, "true 3D joints: a folder of body3DScene files, or points as `markers convert` takes them");
  visit("truth-calib", o.truth_calib, "true calibration of the same cameras");
  visit("truth-sync", o.truth_sync, "true time offsets as sync.json; without it frames of one number are simultaneous");
  VisitStyled(visit, OptionStyle::kSwitch, "stated", o.stated,
              "leave the truth out: shares from the sigmas that the stages state");
  StartGroup(visit, "Are the sigmas true");
  VisitStyled(visit, OptionStyle::kSwitch, "reliability", o.reliability,
              "how often errors stay within their stated regions, stage by stage; needs truth");
  VisitStyled(visit, OptionStyle::kList, "more", o.more, "further sessions with truth, with commas, counted together");
  StartGroup(visit, "Detections");
  visit("sigma-px", o.sigma_px, "px; standard deviation of a detection; 0 estimates it from the take");
  visit("min-score", o.min_score, "0..1; detections with a lower score are left out");
  visit("max-persons", o.max_persons, "persons kept where the truth does not say how many there are");
  visit("seeds", o.seeds, "without truth: draws of each stage's error");
  StartGroup(visit, "Output");
  VisitStyled(visit, OptionStyle::kFolder, "out", o.out,
              "folder for error-budget.html; SESSION/error_budget/TAKE unless given");
}

}  // namespace mvstudio::stages
