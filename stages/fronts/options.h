#pragma once

#include <string>
#include <vector>

#include "core/choice/option_group.h"
#include "core/choice/option_style.h"

/// What time, memory and accuracy cost each other, stage by stage, on one page: what a caller gives.
namespace mvstudio::stages {

struct FrontsOptions {
  std::string session;            ///< empty: a synthetic studio, made and removed again
  std::string take;               ///< empty: the only one with people
  std::vector<std::string> only;  ///< stages; empty: all
  std::string from;               ///< results of an earlier run, of which the page is made; nothing is measured
  bool quick = false;
  std::string peers;  ///< a program that measures other programs on the same data; empty: none
  std::string out;    ///< the page; the results go beside it, with the extension .json
};

template <class Visitor>
void VisitFields(Visitor&& visit, FrontsOptions& o) {
  visit("session", o.session,
        "folder with mvstudio.toml, whose results are used and left as they are; a small synthetic studio unless given");
  visit("take", o.take, "take of the session; its only one with people unless given");
  VisitStyled(visit, OptionStyle::kList, "only", o.only,
              "with commas, of calibrate, pose2d, mask, triangulate, pack, avatar; all unless given");
  VisitStyled(visit, OptionStyle::kSwitch, "quick", o.quick, "a smaller studio, fewer frames and shorter trainings");
  visit("peers", o.peers,
        "program that is called with a stage and where its data are, and prints ways of other programs as JSON "
        "(bench/peers/fronts.py)");
  visit("from", o.from, "results of an earlier run (.json): makes the page of them and measures nothing");
}

}  // namespace mvstudio::stages
