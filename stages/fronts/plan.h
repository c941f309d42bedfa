// Private: what is run for each stage.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "stages/fronts/fronts.h"
#include "stages/stage_call.h"

namespace mvstudio::stages {

/// What there is to measure with. Empty: not there, and the stages that need it say so.
struct FrontsMaterial {
  std::string session, take, calibration, pose3d, dataset;
  std::vector<std::string> cameras;  ///< of the take
  std::string held_out;              ///< a camera of the dataset
  std::string truth_masks;           ///< a folder for each camera in it
  std::string runs;                  ///< folder for what the ways write
  bool quick = false;
  bool whole_take = false;  ///< `pose2d` and `mask` are of all frames
  int threads = 0;
  unsigned long long seed = 1;
};

using ReadFigures = std::function<void(const CommandResult& work, const CommandResult& judge, FrontWay* way)>;

/// One way: the command that is measured, one that judges what it made, if it does not do so itself, and where the figures are.
struct PlannedWay {
  std::string name;
  WayMark mark = WayMark::kNone;
  CommandLine work;
  CommandLine judge = {};  ///< no command: none
  ReadFigures read;
};

struct PlannedFront {
  StageFront front;  ///< its names; why_not: it cannot be measured
  std::vector<PlannedWay> ways;
};

/// In the order of the stages. `only`: their names; empty for all.
std::vector<PlannedFront> PlanFronts(const FrontsMaterial& material, const std::vector<std::string>& only);

}  // namespace mvstudio::stages
